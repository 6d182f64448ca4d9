"""Layers that start in the air: what a slicer must put support under, or the print has nothing to stand on.

The part is sliced as it lies on the bed. An outline of a layer that no outline of the layer below touches is an island;
one on the bed is none. Millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scanwright.cad.checks.check import Check, spot, tidy
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.geometry.print_pose import PrintPose, on_bed

LAYER = 0.4  # what starts in the air and is gone after one layer of this is a burr
SMALL_MM2 = 0.2  # outlines below it are less than a line of a nozzle


@dataclass(frozen=True, slots=True)
class Island:
    """Where a layer starts in the air: middle of its first layer on the bed, height above the bed, and area of it."""

    middle: tuple[float, float]
    height: float
    area_mm2: float


def islands_check(name: str, mesh: TriMesh, pose: PrintPose) -> Check:
    """How many islands a part has; more than none asks for a look at the slicer's support."""
    found = islands_of(on_bed(mesh, pose))
    if not found:
        return Check("islands", "pass", 0.0, 0.0, "", name, f"{name}: no layer starts in the air")
    lowest, largest = found[0], max(island.area_mm2 for island in found)
    at = np.linalg.inv(pose.T_bed_part) @ [*lowest.middle, lowest.height, 1.0]
    message = (
        f"{name}: {len(found)} layers start in the air, the lowest {lowest.height:.1f} mm above the bed, "
        f"{spot(at[:3])}, the largest {largest:.0f} mm2: the slicer must support them"
    )
    return Check("islands", "warning", tidy(len(found)), 0.0, "", name, message)


def islands_of(mesh: TriMesh) -> list[Island]:
    """Islands of a closed mesh that lies on the plane z = 0, from below."""
    body, found = mesh.manifold(), []
    below = body.slice(LAYER / 2)
    for height in np.arange(1.5 * LAYER, float(mesh.vertices[:, 2].max()), LAYER):
        layer = body.slice(float(height))
        for outline in layer.decompose():
            if outline.area() >= SMALL_MM2 and (outline ^ below).is_empty():
                x0, y0, x1, y1 = outline.bounds()
                found.append(Island(((x0 + x1) / 2, (y0 + y1) / 2), float(height) - LAYER / 2, outline.area()))
        below = layer
    return found
