"""All checks of one scanner, for its build folder and for the command `check`.

They use the parts without labels: the wall between two engraved strokes is no thin wall.
"""

from collections.abc import Callable, Iterable
from functools import partial

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.assembly.shadow import shadow_of, triangles_of
from scanwright.cad.checks.access import access_checks
from scanwright.cad.checks.beams import beam_checks
from scanwright.cad.checks.cables import fixed_cable_checks, rotor_cable_checks
from scanwright.cad.checks.checks_json import checks_text
from scanwright.cad.checks.clearance import clearance_checks
from scanwright.cad.checks.loads.angle import angle_checks
from scanwright.cad.checks.loads.deflection import bending_checks
from scanwright.cad.checks.loads.mechanics import mechanics_checks
from scanwright.cad.checks.loads.retention import retention_checks
from scanwright.cad.checks.printing import printing_checks
from scanwright.cad.checks.products import module_checks, unverified_checks, wiring_checks
from scanwright.cad.checks.seats import seat_checks
from scanwright.cad.checks.table import with_change
from scanwright.design.findings import Finding
from scanwright.design.progress import Progress
from scanwright.design.scanner import Scanner
from scanwright.design.self_occlusion import SelfOcclusion, self_occlusion_bytes


def check_files(assembly: Assembly, progress: Progress) -> dict[str, bytes]:
    """Return `checks.json` and `own_body.npz` of a build."""
    checks, shadow = run_checks(assembly, progress)
    own_body = self_occlusion_bytes(shadow, assembly.layout.scanner.lidar.bearings_rad())
    return {"checks.json": checks_text(checks).encode("utf-8"), "own_body.npz": own_body}


def check_scanner(scanner: Scanner, progress: Progress) -> list[Finding]:
    """Make the parts of a scanner in memory and check them; BuildError if a part cannot be made."""
    progress("making the parts")
    return run_checks(make_parts(scanner), progress)[0]


def run_checks(assembly: Assembly, progress: Progress) -> tuple[list[Finding], SelfOcclusion]:
    """Return all checks, in the order of the report, and the beams that the parts hide."""
    progress("casting the beams")
    shadow = shadow_of(assembly.layout.scanner, triangles_of(assembly), assembly.turning())
    progress("checking clearance, loads and walls")
    checks: tuple[Callable[[Assembly], Iterable[Finding]], ...] = (
        clearance_checks,
        access_checks,
        seat_checks,
        partial(beam_checks, shadow=shadow),
        mechanics_checks,
        retention_checks,
        angle_checks,
        lambda assembly: wiring_checks(assembly.layout.scanner),
        rotor_cable_checks,
        fixed_cable_checks,
        bending_checks,
        printing_checks,
        module_checks,
        unverified_checks,
    )
    return [with_change(finding) for check in checks for finding in check(assembly)], shadow
