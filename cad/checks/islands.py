"""Islands: layers of a print that start in the air, which a slicer must support. Millimetres.

The part is sliced in its print pose. An outline of a layer that touches no outline of the layer below is an island;
one on the bed is none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scanwright.cad.checks.limits import spot, tidy
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.geometry.print_pose import PrintPose, on_bed
from scanwright.design.findings import Finding

LAYER_MM = 0.4  # two layers of the printer: what is lower than that is a burr
SMALL_MM2 = 0.2  # smaller outlines are less than a line of a 0.4 mm nozzle


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
    message = (
        f"{name}: {len(islands)} layers start in the air, the lowest {lowest.height:.1f} mm above the bed, "
        f"{spot(at[:3])}, the largest {largest:.0f} mm2"
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
