"""All checks of one scanner: for its build folder, and for `scanwright check`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from cad.assembly import Assembly, make_parts
from cad.build import PartsResult, link_bodies, write_files
from cad.checks.beams import beam_checks
from cad.checks.check import Check, checks_text
from cad.checks.clearance import clearance_checks
from cad.checks.mechanics import mechanics_checks
from cad.checks.printing import printing_checks
from cad.mesh import Mesh, mesh_of
from cad.remarks import shaft_is_turned, unverified
from cad.shadow import shadow_of, triangles_of
from design.scanner import Scanner
from design.shadow import Shadow, own_body_bytes

Say = Callable[[str], None]


def check_parts(scanner: Scanner, made: PartsResult, folder: Path, progress: Say) -> list[Check]:
    """Check the parts of a build and write `checks.json` and `own_body.npz` into its folder.

    Args:
        scanner: angles and products.
        made: its parts, of `build.build_parts`.
        folder: the build folder.
        progress: called with a line of text before each step.
    """
    checks, shadow = _run(scanner, made.assembly, made.meshes, progress)
    own_body = own_body_bytes(shadow, scanner.lidar.bearings_rad())
    write_files(folder, {"checks.json": checks_text(checks).encode("utf-8"), "own_body.npz": own_body})
    return checks


def check_scanner(scanner: Scanner, progress: Say) -> list[Check]:
    """Make the parts of a scanner in memory and check them.

    Raises:
        BuildError: a part cannot be made.
    """
    progress("making the parts")
    return _run(scanner, make_parts(scanner), {}, progress)[0]


def _run(scanner: Scanner, assembly: Assembly, known: Mapping[str, Mesh], progress: Say) -> tuple[list[Check], Shadow]:
    """Checks and shadow; `known` are meshes of parts that need not be made again."""
    progress("casting the beams")
    solids = assembly.made | assembly.bought
    meshes = {name: known[name] if name in known else mesh_of(solid) for name, solid in solids.items()}
    triangles = triangles_of(meshes)
    shadow = shadow_of(scanner, triangles)
    progress("checking clearance, loads and walls")
    turned = {"servo_shaft"} if shaft_is_turned(assembly.stack) else set()
    printed = {name: solid for name, solid in assembly.made.items() if name not in turned}
    products = (scanner.lidar, scanner.servo, scanner.slip_ring, assembly.stack.bearing, scanner.printer)
    doubts = [
        Check("unverified", "note", None, None, "", product.name, finding.message)
        for product in products
        if product is not None
        for finding in unverified(product)
    ]
    checks = [
        *clearance_checks(meshes),
        *beam_checks(scanner, shadow, triangles),
        *mechanics_checks(scanner, assembly.stack, link_bodies(scanner, assembly)),
        *printing_checks(scanner.printer, printed, meshes),
        *doubts,
    ]
    return checks, shadow
