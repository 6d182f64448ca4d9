"""Points of one full scan on the planes of a task: their density, gaps, and the smallest object that is hit twice.

The beams of a simulated scan are intersected with the plane of each region, within the practical range of the lidar.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from pydantic import WithJsonSchema

from scanwright.design.arrays import Array, Ints, Setting, Vector
from scanwright.design.density.beams import line_spacing, polar_and_azimuth, scan_at
from scanwright.design.findings import Finding
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import Problem
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.sphere.rectangle import edge_normals
from scanwright.design.sphere.regions import Field
from scanwright.design.task.shapes import LITTLE, PlaneRegion, beyond_words
from scanwright.design.task.task import LoadedTask

AT_M = 3.0  # distance from the optical centre at which gaps are stated
RING = 0.05  # relative tolerance of the distance of the centre of a gap
CELLS = 64  # initial cells along each side of a region
MOST_CELLS = 200_000
NO_SPOTS = np.empty((0, 4))
Nearest = Callable[[Array, list[int]], tuple[Array, Ints]]
"""Maps points (n, 3) and a list of k to the distances to the k-th nearest points of a scan, and their indices."""

Infinite = Annotated[float, WithJsonSchema({"type": ["number", "null"]})]
"""Infinite if there are no points, null in JSON."""

QUARTERS = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
SPOT = 0.8  # gaps off the axis are stated separately if they are narrower than this share of the widest gap
EMPTY = 0.01  # share of the area without points that is reported
SLACK = 0.02  # relative error of a stated diameter, which is never too small


@dataclass(frozen=True, slots=True)
class PlaneFigures:
    """Points of one full scan on the rectangle of a region."""

    region: str  # description of the region
    range_m: float  # practical range of the lidar
    beyond_range: float  # share of the area beyond that range; the other figures refer to the rest
    points: int  # number of points
    points_per_m2: float  # mean over the unmasked area
    # share of the unmasked area outside the surface that the beams sweep: no point lies within their spacing
    empty_share: float
    at_m: float  # distance of `gap_cm` from the optical centre: `AT_M`, or the nearest distance within the region
    # diameter of the largest disc without a point, centred at that distance; null if there are no points
    gap_cm: Infinite
    gap_off_axis_cm: Infinite  # the same outside the blind cones around the axis
    twice_cm: Infinite  # diameter of the smallest disc that has two points at any place

    def words(self) -> str:
        """Return the figures as a line of text."""
        if self.beyond_range == 1:
            return f"{self.region}: 0 points, as all of it lies beyond the lidar's range of {self.range_m:g} m"
        part = ""
        if self.beyond_range > LITTLE:
            share = beyond_words(self.beyond_range)
            part = f"{share} of it lies beyond the lidar's range of {self.range_m:g} m; of the rest "
        if not self.points:
            return f"{self.region}: {part}no beam of a full scan ends there"
        at = f"cm at {rounded(self.at_m)} m"
        gaps = f"gaps of {rounded(self.gap_cm)} {at}"
        if self.gap_off_axis_cm < SPOT * self.gap_cm:
            gaps = f"gaps of {rounded(self.gap_off_axis_cm)} {at}, {rounded(self.gap_cm)} around the axis"
        twice = f"an object {rounded(self.twice_cm)} cm wide is hit twice even at the worst place"
        empty = f", {100 * self.empty_share:.0f}% gets none" if self.empty_share > EMPTY else ""
        return f"{self.region}: {part}{rounded(self.points_per_m2)} points per m2{empty}, {gaps}; {twice}"

    def empty(self, ball_rad: float) -> Finding | None:
        """Return a warning if a part of the area gets no points; directions within the ball radius count as seen."""
        if self.empty_share <= EMPTY or self.beyond_range == 1:
            return None
        ball_deg = float(np.degrees(ball_rad))
        message = f"{100 * self.empty_share:.0f}% of the area of {self.region} gets no points"
        hint = (
            f"J counts what lies within {ball_deg:.2g} deg of a beam as seen: set density.ball_radius_deg = "
            f"{ball_deg / 2:.2g}, or enlarge the region"
        )
        return Finding("empty_area", "warning", self.region, message, self.empty_share, EMPTY, "1", hint)


def planes_of(loaded: LoadedTask) -> list[PlaneRegion]:
    """Return the plane regions of a task with a weight above 0."""
    return [region for region in loaded.task.weight if isinstance(region, PlaneRegion) and region.value > 0]


def on_planes(
    loaded: LoadedTask, problem: Problem, angles_rad: Setting, shadow: SelfOcclusion | None = None
) -> tuple[PlaneFigures, ...]:
    """Return the points of a full scan of (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad] on each `planes_of`.

    Masked directions do not belong to a region, and beams that `shadow` blocks do not reach it.
    """
    regions = planes_of(loaded)
    if not regions:
        return ()
    beams = free_beams(problem, angles_rad, shadow)
    spots = _spots(problem if shadow is None else problem.behind(shadow), angles_rad)
    spacing_rad, reach_m = spacing(problem, angles_rad), loaded.lidar.practical_range_m
    return tuple(on_plane(region, beams, problem, spots, spacing_rad, reach_m) for region in regions)


def spacing(problem: Problem, angles_rad: Setting) -> float:
    """Return the largest angle [rad] between neighbouring scan lines, or between beams of a line if that is larger."""
    beam_step = float(np.median(np.diff(np.sort(problem.bearings_rad))))
    fan = problem.beams_rot(angles_rad[2:])
    return max(beam_step, float(problem.lines.step_rad * line_spacing(fan, angles_rad[2:])))


def free_beams(problem: Problem, angles_rad: Setting, shadow: SelfOcclusion | None) -> Float[ndarray, "n 3"]:
    """Return the beams of one full scan that no mask and no part blocks, as unit vectors in the world, shape (n, 3)."""
    joint_rad = problem.joint_rad()
    beams = scan_at(problem.bearings_rad, joint_rad, angles_rad, problem.lever)
    free = np.ones(len(beams), bool) if shadow is None else shadow.free(joint_rad).ravel()
    return beams[free & ~problem.field.masked_at(beams)]


def _spots(problem: Problem, angles_rad: Setting) -> Float[ndarray, "n 4"]:
    """Return the blind cones about both ends of the axis, as direction and cosine; none for a sweep."""
    if problem.sweep is not None:
        return NO_SPOTS
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    polar, _ = polar_and_azimuth(problem.beams_rot(angles_rad[2:]))
    return np.array([[*axis, np.cos(polar.min())], [*-axis, np.cos(np.pi - polar.max())]])


def on_plane(
    region: PlaneRegion,
    beams: Float[ndarray, "n 3"],
    problem: Problem,
    spots: Float[ndarray, "spots 4"],
    spacing_rad: float,
    reach_m: float,
) -> PlaneFigures:
    """Return the points of beams (unit vectors in the world) on one region.

    `spots` are cones without beams, `spacing_rad` is that of lines and beams.
    """
    corners = np.array(region.corners_m())
    sides = corners[1] - corners[0], corners[3] - corners[0]
    normal = np.cross(*sides)
    normal /= np.linalg.norm(normal)
    away_m = normal @ corners[0]
    facing = beams @ normal * np.sign(away_m) > 1e-6
    ends = beams[facing] * (away_m / (beams[facing] @ normal))[:, None]
    inside = (beams[facing] @ edge_normals(corners).T >= 0).all(axis=1) & (np.linalg.norm(ends, axis=1) <= reach_m)

    beyond = region.share_beyond(reach_m)
    plane = _Plane(corners[0], sides[0], sides[1], problem.field, NO_SPOTS, reach_m).near()
    places = plane.points(_grid(CELLS))
    away = np.linalg.norm(places, axis=1)
    seen = ~plane.hidden(_grid(CELLS))
    if not inside.any() or not seen.any():
        return PlaneFigures(region.words(), reach_m, beyond, 0, 0.0, 1.0, AT_M, np.inf, np.inf, np.inf)
    area_m2 = float(np.linalg.norm(np.cross(plane.along, plane.across)) * seen.mean())
    at_m = float(np.clip(AT_M, away[seen].min(), away[seen].max()))
    from scipy.spatial import cKDTree  # a heavy import that few tasks need

    nearest = cKDTree(ends).query  # also of points just outside the region, which limit gaps too
    chord = 2 * np.sin(spacing_rad / 2)
    beam_off = cKDTree(beams[facing]).query((places / away[:, None])[seen], distance_upper_bound=chord)[0]
    there = at_m * (1 - RING), at_m * (1 + RING)
    return PlaneFigures(
        region.words(),
        reach_m,
        beyond,
        int(inside.sum()) * problem.lines.repeats,
        float(inside.sum() * problem.lines.repeats / area_m2),
        float(np.isinf(beam_off).mean()),
        at_m,
        200 * plane.widest(nearest, 1, there),
        200 * replace(plane, spots=spots).widest(nearest, 1, there),
        200 * plane.widest(nearest, 2, (0.0, np.inf)),
    )


@dataclass(frozen=True, slots=True)
class _Plane:
    """A rectangle: one corner and the sides from it, and its excluded parts: masked, in a cone, or out of reach."""

    corner: Vector
    along: Vector
    across: Vector
    field: Field
    spots: Float[ndarray, "spots 4"]
    reach_m: float

    def near(self) -> _Plane:
        """Return the part of it within the bounding square of its points in reach; empty if there are none."""
        sides = np.stack([self.along, self.across])
        lengths_m = np.linalg.norm(sides, axis=1)
        foot_m = -(sides @ self.corner) / lengths_m
        radius_m = np.sqrt(max(0.0, self.reach_m**2 - self.corner @ self.corner + foot_m @ foot_m))
        low, high = (np.clip((foot_m + side * radius_m) / lengths_m, 0.0, 1.0) for side in (-1, 1))
        along, across = (high - low)[:, None] * sides
        return replace(self, corner=self.corner + low @ sides, along=along, across=across)

    def points(self, shares: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Return the points of the rectangle [m] at shares of its sides, 0 .. 1."""
        return self.corner + shares[:, :1] * self.along + shares[:, 1:] * self.across

    def widest(self, nearest: Nearest, k: int, away_m: tuple[float, float]) -> float:
        """Return the radius [m] of the widest disc with fewer than k points, centred at a distance within `away_m`.

        Branch and bound: the distance to the k-th nearest point changes by at most the distance moved, so cells that
        cannot contain the centre of a wider disc are dropped, and the others are divided into four.
        """
        shares, half = _grid(CELLS), 0.5 / CELLS
        best = bound = 0.0
        while True:
            middles = self.points(shares)
            reach = half * float(np.linalg.norm(np.abs(self.along) + np.abs(self.across)))
            result = nearest(middles, [k])[0][:, 0]
            away = np.linalg.norm(middles, axis=1)
            masked = self.hidden(shares)
            there = (away_m[0] <= away) & (away <= away_m[1]) & ~masked
            best = max(best, float(result[there].max(initial=0.0)))
            near = (away_m[0] - reach <= away) & (away <= away_m[1] + reach) & (result + reach > best * (1 + SLACK))
            if masked.any():  # drop cells that are entirely excluded
                near &= ~np.all([masked, *(self.hidden(shares + half * step) for step in QUARTERS)], axis=0)
            if not near.any():
                return best * (1 + SLACK)
            bound = float((result[near] + reach).max())
            if bound <= best * (1 + SLACK) or 4 * near.sum() > MOST_CELLS or reach < 1e-4:
                return max(best, bound)
            half /= 2
            shares = (shares[near][:, None] + half * QUARTERS).reshape(-1, 2)

    def hidden(self, shares: Float[ndarray, "n 2"]) -> Bool[ndarray, " n"]:
        """Return whether points, given as shares of the sides, are masked, in a blind cone, or out of reach."""
        points = self.points(shares)
        away_m = np.linalg.norm(points, axis=1)
        directions = points / away_m[:, None]
        in_spot = (directions @ self.spots[:, :3].T >= self.spots[:, 3]).any(axis=1)
        return self.field.masked_at(directions) | in_spot | (away_m > self.reach_m)


def _grid(cells: int) -> Float[ndarray, "n 2"]:
    """Return the centres of the cells of a unit square, shape (cells^2, 2)."""
    each = (np.arange(cells) + 0.5) / cells
    return np.stack(np.meshgrid(each, each, indexing="ij"), axis=-1).reshape(-1, 2)


def rounded(value: float) -> str:
    """Return a number with two digits, without an exponent if it is large."""
    return f"{value:.2g}" if value < 100 else f"{float(f'{value:.2g}'):,.0f}"
