"""What the parts hide of the fan."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np

from scanwright.cad.assembly.shadow import bundles
from scanwright.cad.checks.check import Check, at_most, note
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.design.arrays import Array, Mask
from scanwright.design.scanner import Scanner
from scanwright.design.scene import ray_caster
from scanwright.design.self_occlusion import SelfOcclusion

OWN_LIMIT_DEG = 2.0  # of the fan that the linkage may hide beyond servo, ring and shaft


def beam_checks(
    scanner: Scanner, shadow: SelfOcclusion, triangles_m: Mapping[str, Array], carriers: Collection[str]
) -> list[Check]:
    """Which beams are hidden, and by whom.

    Args:
        scanner: angles and lidar.
        shadow: of all parts.
        triangles_m: of `shadow.triangles_of`.
        carriers: names of linkage and sub-plate.
    """
    bearings = scanner.lidar.bearings_rad()
    step = math.degrees(float(bearings[1] - bearings[0]))
    hidden = shadow.hidden()
    where = _ranges(hidden >= 1.0, bearings)
    checks = [
        note(
            "beams_hidden", step * float((hidden >= 1.0).sum()), "deg", where, "of the fan hidden at every axis angle"
        ),
        note("beams_partly_hidden", step * float(hidden.sum()), "deg", "fan", "hidden on average over a turn"),
    ]
    linkage = [triangles for name, triangles in triangles_m.items() if name in carriers]
    own = _middle_hidden(scanner, np.concatenate(linkage))
    others = [triangles for name, triangles in triangles_m.items() if name not in carriers]
    beyond = own & ~_middle_hidden(scanner, np.concatenate(others))
    width, what = step * float(beyond.sum()), "of the fan hidden by the linkage alone"
    return [*checks, at_most("beams_linkage", width, OWN_LIMIT_DEG, "deg", ALIGNMENT_LINKAGE, what)]


def _middle_hidden(scanner: Scanner, triangles_m: Array) -> Mask:
    """Beams whose middle ray meets these parts at gamma = 0."""
    origins, directions = bundles(scanner)
    hits = ray_caster.cast(ray_caster.build_scene(triangles_m), origins[:, 0], directions[:, 0])
    return np.asarray(np.isfinite(hits.range_m))


def _ranges(mask: Mask, bearings_rad: Array) -> str:
    """Bearings of the hidden beams, as ranges in degrees."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    degrees = np.degrees(bearings_rad)
    parts = [f"{degrees[a]:.2f} to {degrees[b - 1]:.2f}" for a, b in edges.reshape(-1, 2)]
    return f"beams at {', '.join(parts)} deg" if parts else "fan"
