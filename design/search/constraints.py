"""Constraints on scan planes, and on pairs of a scan plane and an axis, evaluated for the entire grid.

Line gaps and blind cones depend on the scan plane only, so planes that break their limits are removed from the grid. A
pair has no blind spot if the polar angles of its field of view, widened by a ball radius, contain those of the region
about the axis. A lowest density, a blind share of the weight, and blind spots of a sweep are sums over nodes: one
matrix product each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.angles import angles_words
from scanwright.design.arrays import Array, Ints, Mask, Setting
from scanwright.design.concurrency.blocked_product import product
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.density.beams import beam_directions_rot, line_spacing, polar_of_planes
from scanwright.design.errors import TaskError
from scanwright.design.frames import R_rot_laser
from scanwright.design.objective.problem import Problem
from scanwright.design.search.grid_classes import Folded
from scanwright.design.task.task import Limits

TOUCHING_RAD = 1e-6  # rounding error of the polar angles of field of view and region
PIECE = 512  # fewest planes of one thread


class Constraint(Protocol):
    """A constraint on pairs of planes and axes."""

    def broken(self, planes: slice, axes: slice) -> tuple[Mask, Mask]:
        """Return whether pairs of planes and axes break it, with the planes not flipped, and flipped."""
        ...

    def of(self, planes: slice | Ints, axes: slice) -> Constraint:
        """Return the constraint for some of the planes and axes."""
        ...


@dataclass(frozen=True, slots=True)
class NoHole:
    """The field of view, widened by a ball radius, contains the lowest and highest polar angle of the region."""

    fan_rad: Float[ndarray, "planes 2"]
    region_rad: Float[ndarray, "axes 2"]

    def broken(self, planes: slice, axes: slice) -> tuple[Mask, Mask]:
        """See `Constraint`."""
        low, high = self.fan_rad[planes, 0, None], self.fan_rad[planes, 1, None]
        first, last = self.region_rad[axes, 0] + TOUCHING_RAD, self.region_rad[axes, 1] - TOUCHING_RAD
        return (low > first) | (high < last), (np.pi - high > first) | (np.pi - low < last)

    def of(self, planes: slice | Ints, axes: slice) -> NoHole:
        """See `Constraint`."""
        return NoHole(self.fan_rad[planes], self.region_rad[axes])


@dataclass(frozen=True, slots=True)
class AtMost:
    """The sum of `of_planes` (planes, nodes) times `of_axes` (axes, nodes) over the nodes is at most `most`.

    If `turns`, a flipped plane has its nodes in the opposite order; else flipped planes are the same.
    """

    of_planes: Array
    of_axes: Array
    most: float
    turns: bool

    def broken(self, planes: slice, axes: slice) -> tuple[Mask, Mask]:
        """See `Constraint`."""
        rows = self.of_planes[planes].astype(np.float32)
        columns = self.of_axes[axes].T
        straight = product(rows, columns) > self.most
        return straight, product(np.ascontiguousarray(rows[:, ::-1]), columns) > self.most if self.turns else straight

    def of(self, planes: slice | Ints, axes: slice) -> AtMost:
        """See `Constraint`."""
        return AtMost(self.of_planes[planes], self.of_axes[axes], self.most, self.turns)


def fan_reach(problem: Problem, planes_rad: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """Return the lowest and highest polar angle of the field of view of scan planes, widened by a ball radius."""
    reach = in_chunks(lambda chunk: _extremes(problem.bearings_rad, planes_rad[chunk]), len(planes_rad), PIECE)
    return np.concatenate(reach) + np.array([-problem.ball_rad, problem.ball_rad])


def _extremes(bearings_rad: Float[ndarray, " beams"], planes_rad: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """Return the lowest and highest polar angle of the beams; finding them by cosines is ten times as fast."""
    R = R_rot_laser(*planes_rad.T)[:, :, :2]
    along = product(R[:, 2], np.stack([np.cos(bearings_rad), np.sin(bearings_rad)]))
    ends = bearings_rad[np.stack([along.argmax(axis=1), along.argmin(axis=1)])]
    x, y, z = np.einsum("nij,jkn->ikn", R, np.stack([np.cos(ends), np.sin(ends)]))
    return np.asarray(np.arctan2(np.hypot(x, y), z).T)


def allowed_planes(problem: Problem, planes: Folded, limits: Limits) -> Folded:
    """Return the scan planes of the grid that meet the limits on gaps and blind cones.

    Raises:
        TaskError: there are none.
    """
    if limits.max_line_gap_deg is None and limits.max_blind_cone_deg is None:
        return planes
    shown = np.radians(planes.settings_deg[planes.first])
    gap, cone = line_gaps_deg(problem, shown), blind_cones_deg(problem, shown)
    for name, values, limit in (
        ("max_line_gap_deg", gap, limits.max_line_gap_deg),
        ("max_blind_cone_deg", cone, limits.max_blind_cone_deg),
    ):
        if limit is not None and values.min() > limit * (1 + 1e-9) + 1e-9:
            hint = "; a longer period narrows it" if name == "max_line_gap_deg" else ""
            raise TaskError(f"limits.{name} = {limit:g}: the scan planes of this task reach {values.min():.3g}{hint}")
    keep = planes_keep(problem, shown, limits)
    if not keep.any():
        raise TaskError("limits: no scan plane keeps max_line_gap_deg and max_blind_cone_deg at once")
    return _only(planes, keep)


def blinding_words(problem: Problem, limits: Limits, angles_deg: Setting) -> str:
    """Return the message for scan-plane limits that blind all mounts; without them `angles_deg` would be best."""
    planes_rad = np.radians(angles_deg[None, 2:])
    gap_deg, cone_deg = float(line_gaps_deg(problem, planes_rad)[0]), float(blind_cones_deg(problem, planes_rad)[0])
    if limits.max_line_gap_deg is not None and gap_deg > limits.max_line_gap_deg:
        limit = f"max_line_gap_deg = {limits.max_line_gap_deg:g}"
        lines = np.ceil(2 * np.pi / problem.lines.step_rad * gap_deg / limits.max_line_gap_deg - 1e-9)
        period = f"{lines:.0f} lines in a turn, a period_s of {lines / problem.scan_rate_hz:.6g}"
        cure = f"lines {gap_deg:.3g} deg apart: the limit requires {period}"
    else:
        limit = f"max_blind_cone_deg = {limits.max_blind_cone_deg:g}"
        cure = f"a blind cone of {cone_deg:.3g} deg that the region does not reach"
    return (
        f"limits.{limit}: every scan plane that keeps it leaves a part of the region blind; "
        f'{angles_words(angles_deg)} sees all of it and has {cure}; change the limit, or set angles.holes = "allow"'
    )


def planes_keep(problem: Problem, planes_rad: Float[ndarray, "n 2"], limits: Limits) -> Bool[ndarray, " n"]:
    """Return whether scan planes meet the limits on gaps and blind cones, shape (n,)."""
    keep = np.ones(len(planes_rad), dtype=bool)
    if limits.max_line_gap_deg is not None:
        keep &= line_gaps_deg(problem, planes_rad) <= limits.max_line_gap_deg * (1 + 1e-9)
    if limits.max_blind_cone_deg is not None:
        keep &= blind_cones_deg(problem, planes_rad) <= limits.max_blind_cone_deg + 1e-9
    return keep


def blind_cones_deg(problem: Problem, planes_rad: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
    """Return the half angle of the wider blind cone about the axis of each scan plane, shape (n,)."""
    polar = polar_of_planes(problem.bearings_rad, planes_rad)
    return np.degrees(np.maximum(polar.min(axis=1), np.pi - polar.max(axis=1)))


def line_gaps_deg(problem: Problem, planes_rad: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
    """Return the widest distance between neighbouring scan lines of each scan plane, shape (n,)."""
    spacings = [line_spacing(beam_directions_rot(problem.bearings_rad, *plane), plane) for plane in planes_rad]
    return np.degrees(problem.lines.step_rad * np.array(spacings))


def _only(planes: Folded, keep: Bool[ndarray, " classes"]) -> Folded:
    """Return the selected classes with their settings."""
    numbers = np.cumsum(keep) - 1
    feasible = keep[planes.classes]
    places = np.cumsum(feasible) - 1
    return replace(
        planes,
        settings_deg=planes.settings_deg[feasible],
        points=planes.points[feasible],
        classes=numbers[planes.classes[feasible]],
        flip=planes.flip[feasible],
        first=places[planes.first[keep]],
        has=planes.has[:, keep],
        own=planes.own[keep],
    )
