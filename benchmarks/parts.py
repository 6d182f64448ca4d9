"""How many random angle pairs build, how fast, and what the linkage hides of the fan.

    python benchmarks/parts.py [PAIRS] [SENSOR] [SERVO]

Angle pairs are `default_rng(1).uniform(-90, 90, (300, 2))`, those of the prototype study. For each: one valid, closed
solid; no volume shared with the lidar; the degrees of the fan that the linkage hides beyond the ring's cone (rays of
1 deg from the optical centre against the mesh); the share of its surface on walls thinner than the printer's least.
"""

from __future__ import annotations

import sys
import time

import manifold3d
import numpy as np

from cad import bought, solids
from cad.checks.printing import thin_walls
from cad.mesh import Mesh, checked_mesh, mesh_of
from cad.parts.alignment_linkage import AlignmentLinkage, alignment_linkage, linkage_of
from cad.sizing import stack_of
from design.angles import Angles, AngleSet
from design.catalogue import load_catalogue
from design.errors import BuildError
from design.frames import Array
from design.scanner import scanner_of


def main(pairs: int = 300, sensor: str = "UTM-30LX", servo: str = "MX-64R") -> None:
    """Build the linkages and print the table."""
    catalogue = load_catalogue()
    rows, refused = [], []
    for alpha, beta in np.random.default_rng(1).uniform(-90, 90, (300, 2))[:pairs]:
        angles = AngleSet(
            task="benchmark",
            angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=alpha, beta_laser=beta),
            sensor=sensor,
            servo=servo,
            slip_ring="UH1256-02-0610-06S",
        )
        scanner = scanner_of(angles, "fdm-0.4", catalogue)
        stack = stack_of(scanner)
        linkage = linkage_of(scanner, stack)
        start = time.perf_counter()
        try:
            solid = alignment_linkage(linkage)
        except BuildError as error:
            refused.append(f"({alpha:.4f}, {beta:.4f}): {error}")
            continue
        seconds = time.perf_counter() - start
        mesh = checked_mesh(solid, "alignment_linkage")
        base = solids.location(stack.R(), -scanner.lidar.optical_height_mm * stack.R()[:, 2])
        lidar = [mesh_of(part.moved(base)) for part in bought.lidar_solids(scanner.lidar).values()]
        shared = max(float((_manifold(mesh) ^ _manifold(other)).volume()) for other in lidar)
        grams = solid.Volume() * scanner.printer.density_g_cm3 / 1000
        thin, surface = thin_walls(mesh, scanner.printer.min_wall_mm)
        hidden = hidden_deg(mesh, linkage)
        rows.append((seconds, stack.h, grams, hidden, shared, 100 * thin / surface, stack.sub_plate is not None))
    table = np.array(rows)
    print(f"{sensor} on {servo}: {len(rows)} of {pairs} built")
    for line in refused:
        print("  refused", line)
    for name, column in zip(("seconds", "h_mm", "mass_g", "hidden_deg", "shared_mm3", "thin_%"), table.T, strict=False):
        low, middle, high, top = np.quantile(column, [0, 0.5, 0.95, 1])
        print(f"  {name:<11} min {low:8.3f}  median {middle:8.3f}  p95 {high:8.3f}  max {top:8.3f}")
    print(f"  with a sub-plate, where the hub would cover a screw: {int(table[:, 6].sum())}")


def hidden_deg(mesh: Mesh, linkage: AlignmentLinkage) -> float:
    """Degrees of the fan, outside the ring's cone, whose centre ray meets the mesh."""
    bearings = np.concatenate([np.arange(start, end, np.radians(1.0)) for start, end in linkage.fan])
    local = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)], axis=1)
    return float(sum(_meets(mesh, ray) for ray in local @ linkage.stack.R().T))


def _meets(mesh: Mesh, ray: Array) -> bool:
    """Whether a ray from the origin meets the mesh (Moeller and Trumbore)."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    p = np.cross(ray, c - a)
    det = np.einsum("ij,ij->i", b - a, p)
    keep = np.abs(det) > 1e-12
    a, b, c, p, det = a[keep], b[keep], c[keep], p[keep], det[keep]
    u = -np.einsum("ij,ij->i", a, p) / det
    q = np.cross(-a, b - a)
    v = q @ ray / det
    distance = np.einsum("ij,ij->i", c - a, q) / det
    return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)).any())


def _manifold(mesh: Mesh) -> manifold3d.Manifold:
    return manifold3d.Manifold(manifold3d.Mesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32)))


if __name__ == "__main__":
    main(*(int(argument) if argument.isdigit() else argument for argument in sys.argv[1:]))  # type: ignore[arg-type]
