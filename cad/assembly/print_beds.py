"""Whether every printed part fits the bed of its printer: one that does not is an error before anything is written."""

from __future__ import annotations

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.layout.names import BASE_MOUNT, TRIPOD_FOOT
from scanwright.design.errors import BuildError

SLACK_MM = 0.01  # the noise of meshes


def require_room_on_bed(assembly: Assembly) -> None:
    """Require a bed for every made part that is printed.

    Raises:
        BuildError: one lies on no bed of this printer, however it is turned; the message names its size and what helps.
    """
    printer = assembly.layout.scanner.printer
    for name in assembly.made:
        if assembly.parts[name].metal or _across(assembly, name) <= min(printer.bed_mm):
            continue
        pose = assembly.print_pose(name)
        if pose.fits:
            continue
        size, bed = (" x ".join(f"{edge:.0f}" for edge in edges) for edges in (pose.size_mm, printer.bed_mm))
        least = [float(np.ceil(edge - SLACK_MM)) for edge in pose.size_mm]
        smaller = ", or a smaller pattern of holes in [deck]" if name in (BASE_MOUNT, TRIPOD_FOOT) else ""
        raise BuildError(
            f"{name}: {size} mm as it is printed: the bed of {printer.name} is {bed} mm (bed_mm); a printer with "
            f"bed_mm = {least} would hold it{smaller}, or other angles"
        )


def _across(assembly: Assembly, name: str) -> float:
    """Diameter of a ball around a part: a bed as wide holds it in any pose."""
    vertices = assembly.mesh(name).vertices
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    return 2 * float(np.linalg.norm(vertices - middle, axis=1).max())
