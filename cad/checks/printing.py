"""Bed, support, islands, walls and holes of each printed part in its print pose. Millimetres.

An island is an outline of a layer that touches no outline of the layer below: a slicer must support it. Walls are
measured from points on the surface along the normal, if the other side is parallel: a wedge prints. A thin spot is a
note; thin walls on more than THIN_SHARE of the surface are an error.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import cadquery as cq
import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.checks.table import SMALLEST_HOLE_MM, THIN_SHARE, at_least, at_most, figures, note, spot, tidy
from scanwright.cad.geometry.holes import Round, rounds_of
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.geometry.print_pose import PrintPose, on_bed
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Printer
from scanwright.design.findings import Finding
from scanwright.design.scene import ray_caster

POINTS = 6000  # per part: one for 2 to 8 mm2 of the parts of the shipped tasks
PARALLEL_COS = math.cos(math.radians(15.0))  # a wedge below 15 deg prints as a wall
SAME_MM = 0.02  # between two thicknesses: a twentieth of a nozzle
LAYER_MM = 0.4  # two layers of the printer: lower islands are burrs
SMALL_MM2 = 0.2  # smaller outlines are less than a line of a 0.4 mm nozzle
NEAR_HOLE_MM = 2.0  # from a thin spot to a hole that is named with it


def printing_checks(assembly: Assembly) -> Iterator[Finding]:
    """Check every printed part in its print pose."""
    for name, solid in assembly.made.items():
        if not assembly.parts[name].metal:
            pose, printer = assembly.print_pose(name), assembly.layout.scanner.printer
            yield from part_checks(name, solid, assembly.mesh(name), pose, printer)


def part_checks(name: str, solid: cq.Solid, mesh: TriMesh, pose: PrintPose, printer: Printer) -> Iterator[Finding]:
    """Check a printed part in its print pose."""
    yield _bed(name, pose, printer)
    yield note("support", pose.support_mm3, "mm3", name, "support under overhangs of more than 45 deg")
    yield islands_check(name, mesh, pose)
    holes = [feature for feature in rounds_of(solid) if feature.hole]
    yield _walls(name, mesh, printer, holes)
    if holes:
        smallest = min(hole.diameter for hole in holes)
        yield at_least("smallest_hole", smallest, SMALLEST_HOLE_MM, "mm", name, "smallest hole")


@dataclass(frozen=True, slots=True)
class ThinWalls:
    """Parallel walls thinner than a least thickness."""

    area_mm2: float  # of both of their sides
    surface_mm2: float  # of the entire part
    thinnest_mm: float  # least thickness; inf if no wall is thin
    at: Array  # middle of the wall there, shape (3,); NaN if no wall is thin


def thin_walls(mesh: TriMesh, least_mm: float) -> ThinWalls:
    """Measure the walls of a part; of places of equal thickness, return the one nearest to their middle."""
    points, normals, area = _surface(mesh)
    solid = ray_caster.build_scene(mesh.vertices[mesh.faces] / 1000)
    inside = 1e-6  # m, below the surface
    hits = ray_caster.cast(solid, points / 1000 - inside * normals, -normals)
    parallel = (hits.triangle >= 0) & (np.einsum("ij,ij->i", solid.normals[hits.triangle], normals) < -PARALLEL_COS)
    thickness = 1000 * (hits.range_m + inside)
    thin = parallel & (thickness < least_mm)
    if not thin.any():
        return ThinWalls(0.0, area, math.inf, np.full(3, np.nan))
    thinnest = float(thickness[thin].min())
    alike = thin & (thickness < thinnest + SAME_MM)
    middles = points[alike] - normals[alike] * thickness[alike, None] / 2
    away = np.round(np.linalg.norm(middles - middles.mean(axis=0), axis=1), 3)
    return ThinWalls(area * int(thin.sum()) / POINTS, area, thinnest, middles[int(np.argmin(away))])


def _walls(name: str, mesh: TriMesh, printer: Printer, holes: list[Round]) -> Finding:
    walls = thin_walls(mesh, printer.min_wall_mm)
    what = f"walls thinner than {printer.min_wall_mm:g} mm"
    check = at_most("wall", walls.area_mm2, THIN_SHARE * walls.surface_mm2, "mm2", name, what)
    if walls.area_mm2 == 0:
        return check
    hole = min(holes, key=lambda hole: _distance(hole, walls.at), default=None)
    near = f", near a hole of {hole.diameter:.4g} mm" if hole and _distance(hole, walls.at) < NEAR_HOLE_MM else ""
    message = f"{check.message}; the thinnest, {walls.thinnest_mm:.2f} mm, {spot(walls.at)}{near}"
    return replace(check, severity="note" if check.severity == "ok" else check.severity, message=message)


def _distance(hole: Round, point: Array) -> float:
    """Return the distance of a point from the wall of a hole."""
    low, along = np.array(hole.low), np.array(hole.direction)
    height = float((point - low) @ along)
    aside = float(np.linalg.norm(point - low - height * along)) - hole.diameter / 2
    return math.hypot(aside, max(0.0, -height, height - hole.length))


def _bed(name: str, pose: PrintPose, printer: Printer) -> Finding:
    worst = max(range(3), key=lambda i: pose.size_mm[i] / printer.bed_mm[i])
    size = " x ".join(f"{edge:.0f}" for edge in pose.size_mm)
    return at_most("bed", tidy(pose.size_mm[worst]), printer.bed_mm[worst], "mm", name, f"{size} mm on {printer.name}")


def _surface(mesh: TriMesh) -> tuple[Array, Array, float]:
    """Return points spread over the surface by area, their normals, and the area: the same points in every run."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    normals, areas = mesh.across()
    upto = np.cumsum(areas)
    where = (np.arange(POINTS) + 0.5) / POINTS * upto[-1]
    face = np.searchsorted(upto, where)
    # a low-discrepancy pair inside each triangle
    u = np.sqrt((0.5 + np.arange(POINTS) * 0.7548776662466927) % 1.0)
    v = (0.5 + np.arange(POINTS) * 0.5698402909980532) % 1.0
    points = (1 - u)[:, None] * a[face] + (u * (1 - v))[:, None] * b[face] + (u * v)[:, None] * c[face]
    return points, normals[face], float(upto[-1])


@dataclass(frozen=True, slots=True)
class Island:
    """Middle, height above the bed and area of the first layer of an island."""

    middle: tuple[float, float]
    height: float
    area_mm2: float


def islands_check(name: str, mesh: TriMesh, pose: PrintPose) -> Finding:
    """Return a warning if a part has islands."""
    islands = islands_of(on_bed(mesh, pose))
    if not islands:
        return Finding("islands", "ok", name, f"{name}: no layer starts in the air", 0.0, 0.0)
    lowest, largest = islands[0], max(island.area_mm2 for island in islands)
    at = np.linalg.inv(pose.T_bed_part) @ [*lowest.middle, lowest.height, 1.0]
    start = "1 layer starts" if len(islands) == 1 else f"{len(islands)} layers start"
    message = (
        f"{name}: {start} in the air, the lowest {lowest.height:.1f} mm above the bed, "
        f"{spot(at[:3])}, the largest {figures(largest)} mm2"
    )
    return Finding("islands", "warning", name, message, tidy(len(islands)), 0.0, hint="let the slicer support them")


def islands_of(mesh: TriMesh) -> list[Island]:
    """Return the islands of a closed mesh that lies on the plane z = 0, the lowest first."""
    body, islands = mesh.manifold(), []
    below = body.slice(LAYER_MM / 2)
    for height in np.arange(1.5 * LAYER_MM, float(mesh.vertices[:, 2].max()), LAYER_MM):
        layer = body.slice(float(height))
        for outline in layer.decompose():
            if outline.area() >= SMALL_MM2 and (outline ^ below).is_empty():
                x0, y0, x1, y1 = outline.bounds()
                islands.append(Island(((x0 + x1) / 2, (y0 + y1) / 2), float(height) - LAYER_MM / 2, outline.area()))
        below = layer
    return islands
