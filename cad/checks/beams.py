"""Beams that the parts hide."""

import math

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.shadow import bundles, triangles_of
from scanwright.cad.checks.table import LINKAGE_HIDES_SHARE, at_most, note
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.design.arrays import Array, Mask
from scanwright.design.findings import Finding
from scanwright.design.scanner import Scanner
from scanwright.design.scene import ray_caster
from scanwright.design.self_occlusion import SelfOcclusion


def beam_checks(assembly: Assembly, shadow: SelfOcclusion) -> list[Finding]:
    """Return the width of the hidden beams, and of those that the linkage alone hides."""
    scanner, carriers, triangles_m = assembly.layout.scanner, assembly.carriers(), triangles_of(assembly)
    bearings = scanner.lidar.bearings_rad()
    step = math.degrees(float(bearings[1] - bearings[0]))
    hidden = shadow.hidden()
    always = hidden >= 1.0
    checks = [
        note(
            "beams_hidden", step * float(always.sum()), "deg", _ranges(always, bearings), "hidden at every axis angle"
        ),
        note("beams_partly_hidden", step * float(hidden.sum()), "deg", "fan", "hidden on average over a turn"),
    ]
    linkage = [triangles for name, triangles in triangles_m.items() if name in carriers]
    own = _middle_hidden(scanner, np.concatenate(linkage))
    others = [triangles for name, triangles in triangles_m.items() if name not in carriers]
    beyond = own & ~_middle_hidden(scanner, np.concatenate(others))
    width, what = step * float(beyond.sum()), "beams hidden by the linkage alone"
    limit = LINKAGE_HIDES_SHARE * step * len(bearings)
    return [*checks, at_most("beams_linkage", width, limit, "deg", ALIGNMENT_LINKAGE, what)]


def _middle_hidden(scanner: Scanner, triangles_m: Array) -> Mask:
    """Return the beams whose middle ray meets these parts at gamma = 0."""
    origins, directions = bundles(scanner)
    hits = ray_caster.cast(ray_caster.build_scene(triangles_m), origins[:, 0], directions[:, 0])
    return np.asarray(np.isfinite(hits.range_m))


def _ranges(mask: Mask, bearings_rad: Array) -> str:
    """Return the bearings of the hidden beams as ranges in degrees."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    degrees = np.degrees(bearings_rad)
    parts = [f"{degrees[a]:.2f} to {degrees[b - 1]:.2f}" for a, b in edges.reshape(-1, 2)]
    return f"beams at {', '.join(parts)} deg" if parts else "fan"
