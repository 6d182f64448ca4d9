"""All checks of one scanner, for its build folder and for the command `check`.

They use the parts without labels: the wall between two engraved strokes is no thin wall.
"""

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.assembly.masses import link_bodies
from scanwright.cad.assembly.shadow import shadow_of, triangles_of
from scanwright.cad.checks.access import access_checks
from scanwright.cad.checks.beams import beam_checks
from scanwright.cad.checks.cables import fixed_cable_checks, rotor_cable_checks
from scanwright.cad.checks.checks_json import checks_text
from scanwright.cad.checks.clearance import clearance_checks
from scanwright.cad.checks.loads.angle import angle_checks
from scanwright.cad.checks.loads.deflection import deflection_checks
from scanwright.cad.checks.loads.mechanics import mechanics_checks
from scanwright.cad.checks.loads.mount import mount_checks
from scanwright.cad.checks.loads.retention import retention_checks
from scanwright.cad.checks.loads.vibration import vibration_checks
from scanwright.cad.checks.printing import printing_checks
from scanwright.cad.checks.products import module_checks, unverified
from scanwright.cad.checks.table import with_change
from scanwright.cad.checks.wiring import wiring_checks
from scanwright.cad.layout.drive import products_of
from scanwright.design.findings import Finding
from scanwright.design.progress import Progress
from scanwright.design.scanner import Scanner
from scanwright.design.self_occlusion import SelfOcclusion, self_occlusion_bytes


def check_files(scanner: Scanner, assembly: Assembly, progress: Progress) -> dict[str, bytes]:
    """Return `checks.json` and `own_body.npz` of a build."""
    checks, shadow = run_checks(scanner, assembly, progress)
    own_body = self_occlusion_bytes(shadow, scanner.lidar.bearings_rad())
    return {"checks.json": checks_text(checks).encode("utf-8"), "own_body.npz": own_body}


def check_scanner(scanner: Scanner, progress: Progress) -> list[Finding]:
    """Make the parts of a scanner in memory and check them.

    Raises:
        BuildError: a part cannot be made.
    """
    progress("making the parts")
    return run_checks(scanner, make_parts(scanner), progress)[0]


def run_checks(scanner: Scanner, assembly: Assembly, progress: Progress) -> tuple[list[Finding], SelfOcclusion]:
    """Return all checks, in the order of the report, and the beams that the parts hide."""
    progress("casting the beams")
    layout, meshes = assembly.layout, assembly.meshes()
    triangles = triangles_of(assembly)
    shadow = shadow_of(scanner, triangles, assembly.turning())
    progress("checking clearance, loads and walls")
    printed = {name: solid for name, solid in assembly.made.items() if not assembly.parts[name].metal}
    products, bodies = products_of(scanner, layout.drive), link_bodies(scanner, assembly)
    bent, linkage = deflection_checks(scanner, assembly, bodies, meshes)
    leans, mount = mount_checks(scanner, assembly, bodies, meshes)
    checks = [
        *clearance_checks(assembly),
        *access_checks(assembly),
        *beam_checks(scanner, shadow, triangles, assembly.carriers()),
        *mechanics_checks(layout, bodies),
        *retention_checks(scanner, assembly),
        *angle_checks(scanner, assembly),
        *wiring_checks(scanner),
        *rotor_cable_checks(assembly),
        *fixed_cable_checks(assembly),
        *bent,
        *leans,
        *([] if linkage is None else vibration_checks(scanner, assembly, bodies, linkage, mount)),
        *printing_checks(scanner.printer, printed, meshes, {name: assembly.print_pose(name) for name in printed}),
        *module_checks(scanner, layout.left_out),
        *(warning for product in products for warning in unverified(product, assembly)),
    ]
    return [with_change(check) for check in checks], shadow
