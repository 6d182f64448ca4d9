"""Forces of a rigid body on many points, and the rigid motion that fits many points."""

import numpy as np

from scanwright.design.arrays import Array


def shared(points: Array, force: Array, moment: Array) -> Array:
    """Return forces on points (p, 3, cases) as a rigid seat shares forces and moments about the origin (3, cases)."""
    middle = points.mean(axis=0)
    arms = points - middle
    turn = np.linalg.solve(_second_moments(arms), moment - np.cross(middle, force, axisb=0, axisc=0))
    return force / len(points) + np.cross(turn.T[None], arms[:, None], axis=2).transpose(0, 2, 1)


def rigid(points: Array, moved: Array) -> tuple[Array, Array]:
    """Return the displacement of the origin and rotation (3, cases) that fit the moved points best."""
    middle = points.mean(axis=0)
    arms = points - middle
    turned = np.cross(arms[:, None], moved.transpose(0, 2, 1), axis=2).sum(axis=0).T
    rotation = np.linalg.solve(_second_moments(arms), turned)
    return moved.mean(axis=0) + np.cross(rotation, -middle, axisa=0, axisc=0), rotation


def _second_moments(arms: Array) -> Array:
    """Return the second moments of unit masses, shape (3, 3)."""
    return np.asarray((arms**2).sum() * np.eye(3) - arms.T @ arms)
