"""Whether each printed part can be printed as it lies on the bed. Millimetres.

A wall is measured from points all over the surface straight through to the other side, and counts where the other side
is parallel: a wedge thins to nothing at its edge on every sharp corner, and prints. A thin spot is a flaw; where they
make up more than THIN_SHARE of the surface, the part is not what was meant. The message tells the thinnest spot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import cadquery as cq
import numpy as np

from scanwright.cad.checks.check import Check, at_least, at_most, note, spot, tidy
from scanwright.cad.checks.islands import islands_check
from scanwright.cad.geometry.holes import Round, rounds_of
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.geometry.print_pose import PrintPose
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Printer
from scanwright.design.scene import ray_caster

POINTS = 6000  # per part
THIN_SHARE = 0.01
PARALLEL = math.cos(math.radians(15.0))
SAME_MM = 0.02  # between two thicknesses
BESIDE = 2.0  # from a thin spot to a hole that is named with it
SMALLEST_HOLE = 1.5  # diameter; smaller ones close


def printing_checks(
    printer: Printer, printed: Mapping[str, cq.Solid], meshes: Mapping[str, TriMesh], poses: Mapping[str, PrintPose]
) -> list[Check]:
    """Bed, support, walls and holes of every printed part, as it lies on the bed in its pose."""
    checks = []
    for name, solid in printed.items():
        pose = poses[name]
        checks.append(_bed(name, pose, printer))
        checks.append(note("support", pose.support_mm3, "mm3", name, "support under overhangs of more than 45 deg"))
        checks.append(islands_check(name, meshes[name], pose))
        holes = [feature for feature in rounds_of(solid) if feature.hole]
        checks.append(_walls(name, meshes[name], printer, holes))
        if holes:
            smallest = min(hole.diameter for hole in holes)
            checks.append(at_least("smallest_hole", smallest, SMALLEST_HOLE, "mm", name, "smallest hole"))
    return checks


@dataclass(frozen=True, slots=True)
class ThinWalls:
    """Parallel walls thinner than a least thickness.

    Attributes:
        area_mm2: of both of their sides.
        surface_mm2: of the whole part.
        thinnest_mm: least thickness; inf where no wall is thin.
        at: middle of the wall there, shape (3,); NaN where no wall is thin.
    """

    area_mm2: float
    surface_mm2: float
    thinnest_mm: float
    at: Array


def thin_walls(mesh: TriMesh, least_mm: float) -> ThinWalls:
    """Measure the walls of a part; of places of one thickness, the one nearest to their middle is told."""
    points, normals, area = _surface(mesh)
    solid = ray_caster.build_scene(mesh.vertices[mesh.faces] / 1000)
    inside = 1e-6  # m, below the surface
    hits = ray_caster.cast(solid, points / 1000 - inside * normals, -normals)
    parallel = (hits.triangle >= 0) & (np.einsum("ij,ij->i", solid.normals[hits.triangle], normals) < -PARALLEL)
    thickness = 1000 * (hits.range_m + inside)
    thin = parallel & (thickness < least_mm)
    if not thin.any():
        return ThinWalls(0.0, area, math.inf, np.full(3, np.nan))
    thinnest = float(thickness[thin].min())
    alike = thin & (thickness < thinnest + SAME_MM)
    middles = points[alike] - normals[alike] * thickness[alike, None] / 2
    away = np.round(np.linalg.norm(middles - middles.mean(axis=0), axis=1), 3)
    return ThinWalls(area * int(thin.sum()) / POINTS, area, thinnest, middles[int(np.argmin(away))])


def _walls(name: str, mesh: TriMesh, printer: Printer, holes: list[Round]) -> Check:
    walls = thin_walls(mesh, printer.min_wall_mm)
    what = f"walls thinner than {printer.min_wall_mm:g} mm"
    check = at_most("wall", walls.area_mm2, THIN_SHARE * walls.surface_mm2, "mm2", name, what)
    if walls.area_mm2 == 0:
        return check
    hole = min(holes, key=lambda hole: _distance(hole, walls.at), default=None)
    beside = f", beside a hole of {hole.diameter:.4g} mm" if hole and _distance(hole, walls.at) < BESIDE else ""
    message = f"{check.message}; the thinnest, {walls.thinnest_mm:.2f} mm, {spot(walls.at)}{beside}"
    return replace(check, severity="warning" if check.severity == "pass" else check.severity, message=message)


def _distance(hole: Round, point: Array) -> float:
    """From a point to the wall of a hole."""
    low, along = np.array(hole.low), np.array(hole.direction)
    height = float((point - low) @ along)
    aside = float(np.linalg.norm(point - low - height * along)) - hole.diameter / 2
    return math.hypot(aside, max(0.0, -height, height - hole.length))


def _bed(name: str, pose: PrintPose, printer: Printer) -> Check:
    worst = max(range(3), key=lambda i: pose.size_mm[i] / printer.bed_mm[i])
    size = " x ".join(f"{edge:.0f}" for edge in pose.size_mm)
    return at_most("bed", tidy(pose.size_mm[worst]), printer.bed_mm[worst], "mm", name, f"{size} mm on {printer.name}")


def _surface(mesh: TriMesh) -> tuple[Array, Array, float]:
    """Points spread over the surface by area, their normals, and the whole area: the same ones every time."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    doubled = np.linalg.norm(cross, axis=1)
    upto = np.cumsum(doubled)
    where = (np.arange(POINTS) + 0.5) / POINTS * upto[-1]
    face = np.searchsorted(upto, where)
    # a low-discrepancy pair inside each triangle
    u = np.sqrt((0.5 + np.arange(POINTS) * 0.7548776662466927) % 1.0)
    v = (0.5 + np.arange(POINTS) * 0.5698402909980532) % 1.0
    points = (1 - u)[:, None] * a[face] + (u * (1 - v))[:, None] * b[face] + (u * v)[:, None] * c[face]
    return points, cross[face] / doubled[face, None], float(upto[-1] / 2)
