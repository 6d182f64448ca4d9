"""Classes of mounts of the grid with equal J.

J depends on two things only (docs/definitions.md, Motion): the polar angles of the beams, determined by the third row q
of `R_rot_laser`, and the direction u of the axis. J is equal for

    (q0, q1) about u and (-q0, -q1) about -u      for any field of view
    (q0, q1) about u and (q0, -q1) about u        for a symmetric field of view
    (q0, q1) about u and (-q0, -q1) about u       for a full circle
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int64
from numpy import ndarray

from scanwright.design.frames import R_world_rot
from scanwright.design.task.angle_ranges import AngleRanges


@dataclass(frozen=True, slots=True)
class Folded:
    """Classes of the axes, or of the scan planes, of the grid."""

    settings_deg: Float[ndarray, "n 2"]  # the two angles of each of the n axes or planes
    points: Float[ndarray, "n k"]  # unit vectors of the axes (n, 3), or (q0, q1) of the scan planes (n, 2)
    classes: Int64[ndarray, " n"]  # class of each
    flip: Bool[ndarray, " n"]  # whether each is the opposite of the first one of its class
    first: Int64[ndarray, " classes"]  # index of the first one of each class
    has: Bool[ndarray, "2 classes"]  # whether a class has a member that is not flipped, and one that is
    own: Bool[ndarray, " classes"]  # whether a class equals its opposite

    @property
    def representatives(self) -> Float[ndarray, "classes k"]:
        """`points` of the first setting of each class."""
        return self.points[self.first]


def mirrors_of(bearings_rad: Float[ndarray, " beams"]) -> Float[ndarray, "mirrors 2 2"]:
    """Return the mirrors of (q0, q1) that a field of view allows, shape (1, 2 or 4, 2, 2); the identity is first."""
    mirrors = np.array([np.eye(2)])
    if _same_circle(bearings_rad, -bearings_rad):
        mirrors = np.concatenate([mirrors, mirrors @ np.diag([1.0, -1.0])])
    if _same_circle(bearings_rad, bearings_rad + np.pi):
        mirrors = np.concatenate([mirrors, -mirrors])
    return mirrors


def _same_circle(one_rad: Float[ndarray, " beams"], other_rad: Float[ndarray, " beams"]) -> bool:
    """Return whether two sets of bearings are the same directions."""
    ends = np.array([np.sort(np.round(fan % (2 * np.pi), 9) % np.round(2 * np.pi, 9)) for fan in (one_rad, other_rad)])
    return bool(np.allclose(ends[0], ends[1], atol=1e-8))


def fold_axes(ranges: AngleRanges) -> Folded:
    """Return the axes of the grid, with opposite axes in one class."""
    settings = _grid(ranges, "alpha_rot", "beta_rot")
    return _fold(settings, R_world_rot(*np.radians(settings.T))[:, :, 2], np.eye(3)[None])


def fold_planes(ranges: AngleRanges, mirrors: Float[ndarray, "mirrors 2 2"]) -> Folded:
    """Return the scan planes of the grid, with their mirror images and opposites in one class."""
    settings = _grid(ranges, "alpha_laser", "beta_laser")
    return _fold(settings, plane_key(np.radians(settings)), mirrors)


def unfolded(ranges: AngleRanges) -> tuple[Folded, Folded]:
    """Return axes and scan planes of the grid, one in each class, for a sweep, which has no symmetries."""
    axes = _grid(ranges, "alpha_rot", "beta_rot")
    planes = _grid(ranges, "alpha_laser", "beta_laser")
    return _apart(axes, R_world_rot(*np.radians(axes.T))[:, :, 2]), _apart(planes, plane_key(np.radians(planes)))


def plane_key(plane_rad: Float[ndarray, "*k 2"]) -> Float[ndarray, "*k 2"]:
    """Return (q0, q1) of scan planes (alpha_laser, beta_laser): polar angles are acos(q0 cos b + q1 sin b)."""
    alpha, beta = plane_rad.T
    return np.stack([-np.sin(beta), np.cos(beta) * np.sin(alpha)], axis=1)


def _grid(ranges: AngleRanges, first: str, second: str) -> Float[ndarray, "n 2"]:
    a, b = np.meshgrid(ranges.grid_deg(first), ranges.grid_deg(second), indexing="ij")
    return np.stack([a.ravel(), b.ravel()], axis=1)


def _apart(settings: Float[ndarray, "n 2"], points: Float[ndarray, "n k"]) -> Folded:
    each = np.arange(len(settings))
    no = np.zeros(len(settings), dtype=bool)
    return Folded(settings, points, each, no, each, np.stack([~no, no]), no)


def _fold(
    settings: Float[ndarray, "n 2"], points: Float[ndarray, "n k"], mirrors: Float[ndarray, "mirrors k k"]
) -> Folded:
    """Return classes of points that are equal up to the mirrors (not flipped) or up to mirrors and sign (flipped)."""
    images = np.concatenate([points @ m for m in mirrors] + [-points @ m for m in mirrors])
    keys = np.round(images, 9) + 0.0  # -0.0 is 0.0
    _, numbers = np.unique(keys, axis=0, return_inverse=True)
    numbers = numbers.reshape(2, len(mirrors), len(points))
    straight, turned = numbers[0].min(axis=0), numbers[1].min(axis=0)
    _, first, classes = np.unique(np.minimum(straight, turned), return_index=True, return_inverse=True)
    flip = (turned < straight) != (turned < straight)[first][classes]
    has = np.zeros((2, len(first)), dtype=bool)
    has[flip.astype(int), classes] = True
    return Folded(settings, points, classes, flip, first, has, (straight == turned)[first])
