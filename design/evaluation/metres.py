"""What one full scan comes to on the planes of a task, in metres: points, gaps, and the smallest thing hit twice.

Every beam of a simulated scan is followed to the plane of a region; what is said is read off the points where they end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from design.arrays import Setting
from design.density.beams import scan_at
from design.objective.problem import Problem
from design.sphere.rectangle import edge_normals
from design.task.shapes import PlaneRegion
from design.task.task import LoadedTask

AT_M = 3.0  # from the optical centre, where a gap is told
LOOKS = 120  # along each side of a region, for the emptiest place
RING = 400  # places at `AT_M`


@dataclass(frozen=True, slots=True)
class OnPlane:
    """What one full scan leaves on the rectangle of a region.

    Attributes:
        region: in words.
        points: beams that end on it.
        points_per_m2: in the mean over the part of it that no mask hides.
        at_m: distance from the optical centre of what `gap_cm` is said of: `AT_M`, or the nearest to it in the region.
        gap_cm: diameter of the widest disc on the plane, its middle there, that no beam hits.
        twice_cm: diameter of the smallest disc on the plane that is hit at least twice wherever it lies in the region.
    """

    region: str
    points: int
    points_per_m2: float
    at_m: float
    gap_cm: float
    twice_cm: float

    def words(self) -> str:
        """The same in a line."""
        if not self.points:
            return f"{self.region}: no beam of a full scan ends there"
        return (
            f"{self.region}: {_round(self.points_per_m2)} points per m2, gaps of {_round(self.gap_cm)} cm at "
            f"{self.at_m:.2g} m; what is {_round(self.twice_cm)} cm wide is hit twice wherever it lies"
        )


def on_planes(loaded: LoadedTask, problem: Problem, angles_rad: Setting) -> tuple[OnPlane, ...]:
    """What a full scan of the setting (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad] leaves on each plane.

    A region counts where it has a weight above 0. Masked directions are no part of it.
    """
    regions = [r for r in loaded.task.weight if isinstance(r, PlaneRegion) and r.value > 0]
    if not regions:
        return ()
    joint_rad = problem.lines.angles_rad if problem.sweep is None else problem.sweep.angles_rad(0.5)
    beams = scan_at(problem.bearings_rad, joint_rad, angles_rad, problem.lever)
    beams = beams[~problem.field.masked_at(beams)]
    return tuple(on_plane(region, beams, problem) for region in regions)


def on_plane(region: PlaneRegion, beams: Float[ndarray, "n 3"], problem: Problem) -> OnPlane:
    """What beams, unit vectors (n, 3) of the world, leave on one region."""
    corners = np.array(region.corners_m())
    sides = corners[1] - corners[0], corners[3] - corners[0]
    normal = np.cross(*sides)
    normal /= np.linalg.norm(normal)
    away_m = normal @ corners[0]
    facing = beams @ normal * np.sign(away_m) > 1e-6
    ends = beams[facing] * (away_m / (beams[facing] @ normal))[:, None]
    inside = (beams[facing] @ edge_normals(corners).T >= 0).all(axis=1)

    s, t = np.meshgrid(*2 * [(np.arange(LOOKS) + 0.5) / LOOKS], indexing="ij")
    places = corners[0] + s.ravel()[:, None] * sides[0] + t.ravel()[:, None] * sides[1]
    away = np.linalg.norm(places, axis=1)
    open_ = ~problem.field.masked_at(places / away[:, None])
    places, away = places[open_], away[open_]
    if not inside.any() or not len(places):
        return OnPlane(region.words(), 0, 0.0, AT_M, np.inf, np.inf)
    area_m2 = float(np.linalg.norm(np.cross(*sides)) * open_.mean())
    at_m = float(np.clip(AT_M, away.min(), away.max()))
    there = places[np.argsort(np.abs(away - at_m))[:RING]]
    tree = cKDTree(ends)  # what lies just beyond an edge ends a gap too
    return OnPlane(
        region.words(),
        int(inside.sum()) * problem.lines.repeats,
        float(inside.sum() * problem.lines.repeats / area_m2),
        at_m,
        200 * float(tree.query(there)[0].max()),
        200 * float(tree.query(places, 2)[0][:, 1].max()),
    )


def _round(value: float) -> str:
    return f"{value:.2g}" if value < 100 else f"{float(f'{value:.2g}'):,.0f}"
