"""Grid settings of the four angles, folded to the few that differ.

The four angles act through two things only (docs/definitions.md, Motion): which polar angles the beams sweep, decided
by the third row q of `R_rot_laser`, and where the axis u points. And with the same J for it,

    (q0, q1) about u is (-q0, -q1) about -u       for any fan
    (q0, q1) about u is (q0, -q1) about u         for a symmetric fan
    (q0, q1) about u is (-q0, -q1) about u        for a fan that looks as far behind as ahead: a full circle
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
    """Settings of one pair of angles, shape (n, 2): setting i belongs to classes[i], turned round where flip[i].

    Attributes:
        settings_deg: the grid settings, shape (n, 2).
        points: what decides J: unit axes (n, 3), or (q0, q1) of the scan planes (n, 2).
        classes: class of each setting, shape (n,).
        flip: whether a setting is its class turned round, shape (n,).
        first: the first setting of each class; it is never flipped.
        has: whether a class has a setting that is not flipped, and one that is, shape (2, classes).
        own: whether a class is its own turned image: its J is the same both ways round, shape (classes,).
    """

    settings_deg: Float[ndarray, "n 2"]
    points: Float[ndarray, "n k"]
    classes: Int64[ndarray, " n"]
    flip: Bool[ndarray, " n"]
    first: Int64[ndarray, " classes"]
    has: Bool[ndarray, "2 classes"]
    own: Bool[ndarray, " classes"]

    @property
    def representatives(self) -> Float[ndarray, "classes k"]:
        """`points` of the first setting of each class."""
        return self.points[self.first]


def mirrors_of(bearings_rad: Float[ndarray, " beams"]) -> Float[ndarray, "mirrors 2 2"]:
    """Mirrors of (q0, q1) that a fan allows, shape (1, 2 or 4, 2, 2); the identity is the first."""
    mirrors = np.array([np.eye(2)])
    if _same_circle(bearings_rad, -bearings_rad):
        mirrors = np.concatenate([mirrors, mirrors @ np.diag([1.0, -1.0])])
    if _same_circle(bearings_rad, bearings_rad + np.pi):
        mirrors = np.concatenate([mirrors, -mirrors])
    return mirrors


def _same_circle(one_rad: Float[ndarray, " beams"], other_rad: Float[ndarray, " beams"]) -> bool:
    """Whether two fans are the same directions, in whatever order and whole turns apart."""
    ends = np.array([np.sort(np.round(fan % (2 * np.pi), 9) % np.round(2 * np.pi, 9)) for fan in (one_rad, other_rad)])
    return bool(np.allclose(ends[0], ends[1], atol=1e-8))


def fold_axes(ranges: AngleRanges) -> Folded:
    """Axes of the grid up to their sign."""
    settings = _grid(ranges, "alpha_rot", "beta_rot")
    return _fold(settings, R_world_rot(*np.radians(settings.T))[:, :, 2], np.eye(3)[None])


def fold_planes(ranges: AngleRanges, mirrors: Float[ndarray, "mirrors 2 2"]) -> Folded:
    """Scan planes of the grid up to the mirrors and the sign."""
    settings = _grid(ranges, "alpha_laser", "beta_laser")
    return _fold(settings, plane_key(np.radians(settings)), mirrors)


def unfolded(ranges: AngleRanges) -> tuple[Folded, Folded]:
    """Axes and scan planes of the grid, each setting a class of its own: for a sweep, where nothing is equivalent."""
    axes = _grid(ranges, "alpha_rot", "beta_rot")
    planes = _grid(ranges, "alpha_laser", "beta_laser")
    return _apart(axes, R_world_rot(*np.radians(axes.T))[:, :, 2]), _apart(planes, plane_key(np.radians(planes)))


def plane_key(plane_rad: Float[ndarray, "*k 2"]) -> Float[ndarray, "*k 2"]:
    """(q0, q1) of scan planes (alpha_laser, beta_laser) (n, 2): beam polar angles are acos(q0 cos b + q1 sin b)."""
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
    """Group points that are equal up to the mirrors (no flip), or up to the mirrors and the sign (flip)."""
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
