"""A printed part between two rigid bodies as a spring with a mass: six displacements, by finite elements.

Displacements and loads are six numbers at the origin of the rotation frame: a rotation [rad] before a shift [m], a
moment [N m] before a force [N]. With one origin, compliances of springs in a row add up.

Bodies in a row on springs are numbered from the deck; body i is on spring i, which is on body i - 1 or on the deck. The
unknowns are the springs' deformations, six each: the stiffness is block-diagonal.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, eigh

from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.loads import ShaftBend
from scanwright.cad.statics import elastic
from scanwright.design.arrays import Array
from scanwright.design.frames import cross_matrix

MOMENT_FIRST, FORCE_LAST = np.eye(6)[:3], np.eye(6)[3:]  # of six unit loads, shape (3, 6)


def shared_by(points: Array, force: Array, moment: Array) -> Array:
    """Return forces on points (p, 3, cases) as a rigid seat shares forces and moments about the origin (3, cases)."""
    middle = points.mean(axis=0)
    arms = points - middle
    turn = np.linalg.solve(_second_moments(arms), moment - np.cross(middle, force, axisb=0, axisc=0))
    return force / len(points) + np.cross(turn.T[None], arms[:, None], axis=2).transpose(0, 2, 1)


def rigid_motion(points: Array, moved: Array) -> tuple[Array, Array]:
    """Return the displacement of the origin and rotation (3, cases) that fit the moved points best."""
    middle = points.mean(axis=0)
    arms = points - middle
    turned = np.cross(arms[:, None], moved.transpose(0, 2, 1), axis=2).sum(axis=0).T
    rotation = np.linalg.solve(_second_moments(arms), turned)
    return moved.mean(axis=0) + np.cross(rotation, -middle, axisa=0, axisc=0), rotation


def _second_moments(arms: Array) -> Array:
    """Return the second moments of unit masses, shape (3, 3)."""
    return np.asarray((arms**2).sum() * np.eye(3) - arms.T @ arms)


@dataclass(frozen=True, slots=True)
class Spring:
    """A spring between two rigid bodies.

    With q the displacement of the first body and e that of the second one against it, the kinetic energy of the spring
    is that of the mass matrix ((rigid, coupled), (coupled.T, own)) for the speeds of (q, e): Guyan's reduction.
    """

    compliance: Array  # displacement of the second body against the first one by a load on it, shape (6, 6)
    rigid: Array  # mass matrix if it moves as a rigid body, shape (6, 6)
    coupled: Array  # of rigid movement and deformation, shape (6, 6)
    own: Array  # of its deformation, shape (6, 6)


def of_shaft(bend: ShaftBend, end_mm: float) -> Spring:
    """Return the massless spring of a shaft whose upper end has a height."""
    end = np.array([0.0, 0.0, end_mm / 1000])
    columns = []
    for moment, force in zip(MOMENT_FIRST.T, FORCE_LAST.T, strict=True):
        at_end = moment - np.cross(end, force)
        rotation = bend.rotation_of(force, at_end)
        columns.append(np.concatenate([rotation, bend.shift_of(force, at_end) - np.cross(rotation, end)]))
    nothing = np.zeros((6, 6))
    return Spring(np.stack(columns, axis=1), nothing, nothing, nothing)


def wrenches(model: elastic.Model, at: elastic.Places, points: Array, origin: Array) -> Array:
    """Return the loads of 1 N m and 1 N about an origin on a rigid seat of points (p, 3) [mm], shape (n, 3, 6)."""
    moments = 1000 * MOMENT_FIRST + np.cross(origin, FORCE_LAST, axisb=0, axisc=0)
    return elastic.pull(model, at, shared_by(points, FORCE_LAST, moments))


def spring_of(
    model: elastic.Model, density_g_cm3: float, seat: tuple[elastic.Places, Array, Array], R: Array, origin: Array
) -> Spring:
    """Return a part as a spring.

    R is the grid's frame in the rotation frame, whose `origin` [mm] is in the grid's frame. `seat` has the points of
    the second body's seat in the model and in the grid's frame (p, 3) [mm], and the displacements [mm] of all nodes by
    `wrenches`, shape (n, 3, 6).
    """
    at, points, moved = seat
    shift, rotation = rigid_motion(points, elastic.moved(model, at, moved))
    shift = (shift + np.cross(rotation, origin, axisa=0, axisc=0)) / 1000
    compliance = np.concatenate([rotation, shift])
    kg, middles, shares = elastic.lumps(model, density_g_cm3)
    turned = np.cross(np.eye(3), (middles - origin)[:, None] / 1000).transpose(0, 2, 1)
    as_one = np.concatenate([turned, np.tile(np.eye(3), (len(kg), 1, 1))], axis=2)
    bent = np.einsum("ca,caik->cik", shares, moved[model.nodes]) / 1000 @ np.linalg.inv(compliance)
    turn = np.kron(np.eye(2), R)

    def mass(one: Array, other: Array) -> Array:
        return turn @ np.einsum("c,cik,cil->kl", kg, one, other) @ turn.T

    return Spring(
        turn @ (compliance + compliance.T) / 2 @ turn.T, mass(as_one, as_one), mass(as_one, bent), mass(bent, bent)
    )


@dataclass(frozen=True, slots=True)
class SpringRow:
    """Bodies on springs: stiffness and mass of the springs' deformations, shape (6 n, 6 n)."""

    stiffness: Array
    mass: Array

    def frequencies_hz(self) -> Array:
        """Return the natural frequencies, ascending."""
        return np.sqrt(eigh(self.stiffness, self.mass, eigvals_only=True)) / (2 * np.pi)

    def moved(self, load: Array, frequency_hz: float, loss: float) -> Array:
        """Return the displacement of the last body by a complex load (6,) on it that turns or swings, shape (6,).

        `loss` is the energy that the material loses per radian over the energy stored.
        """
        count = len(self.mass) // 6
        dynamic = (1 + 1j * loss) * self.stiffness - (2 * np.pi * frequency_hz) ** 2 * self.mass
        return np.asarray(np.linalg.solve(dynamic, np.tile(load, count)).reshape(count, 6).sum(axis=0))


def row_of(springs: Sequence[Spring], masses: Sequence[Array]) -> SpringRow:
    """Return the bodies with these mass matrices (6, 6) on these springs."""
    count = len(springs)
    mass = np.zeros((count, 6, count, 6))
    for i, (spring, body) in enumerate(zip(springs, masses, strict=True)):
        mass[: i + 1, :, : i + 1] += body[None, :, None]
        mass[:i, :, :i] += spring.rigid[None, :, None]
        mass[:i, :, i] += spring.coupled
        mass[i, :, :i] += spring.coupled.T[:, None]
        mass[i, :, i] += spring.own
    stiffness = block_diag(*(np.linalg.inv(spring.compliance) for spring in springs))
    return SpringRow(stiffness, mass.reshape(6 * count, -1))


def mass_matrix(body: Inertial) -> Array:
    """Return the mass matrix of a rigid body for a rotation and a shift at the origin, shape (6, 6)."""
    arm = cross_matrix(body.centre_m)
    turning = body.inertia_kg_m2 - body.mass_kg * arm @ arm
    coupled = body.mass_kg * arm
    return np.block([[turning, coupled], [coupled.T, body.mass_kg * np.eye(3)]])
