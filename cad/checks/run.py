"""All checks of one scanner: for its build folder, and for `scanwright check`.

They look at the parts without their labels: a groove between two strokes is no thin wall.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.assembly.masses import link_bodies
from scanwright.cad.assembly.shadow import shadow_of, triangles_of
from scanwright.cad.checks.beams import beam_checks
from scanwright.cad.checks.check import Check, checks_text
from scanwright.cad.checks.clearance import clearance_checks
from scanwright.cad.checks.deflection import deflection_checks
from scanwright.cad.checks.mechanics import mechanics_checks
from scanwright.cad.checks.mount import mount_checks
from scanwright.cad.checks.printing import printing_checks
from scanwright.cad.checks.remarks import left_out_of, products_of, unverified
from scanwright.cad.checks.retention import retention_checks
from scanwright.cad.checks.rotor_leads import lead_checks, standing_checks
from scanwright.cad.layout.names import RING
from scanwright.design.catalogue.products import Product
from scanwright.design.electrics.cautions import data_fault
from scanwright.design.electrics.rules import check_network
from scanwright.design.electrics.wiring import network_of
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner
from scanwright.design.self_occlusion import SelfOcclusion, self_occlusion_bytes

Say = Callable[[str], None]


def check_files(scanner: Scanner, assembly: Assembly, progress: Say) -> dict[str, bytes]:
    """`checks.json` and `own_body.npz` of a build.

    Args:
        scanner: angles and products.
        assembly: its parts.
        progress: called with a line of text before each step.
    """
    checks, shadow = run_checks(scanner, assembly, progress)
    own_body = self_occlusion_bytes(shadow, scanner.lidar.bearings_rad())
    return {"checks.json": checks_text(checks).encode("utf-8"), "own_body.npz": own_body}


def check_scanner(scanner: Scanner, progress: Say) -> list[Check]:
    """Make the parts of a scanner in memory and check them.

    Raises:
        BuildError: a part cannot be made.
    """
    progress("making the parts")
    return run_checks(scanner, make_parts(scanner), progress)[0]


def run_checks(scanner: Scanner, assembly: Assembly, progress: Say) -> tuple[list[Check], SelfOcclusion]:
    """Checks and shadow."""
    progress("casting the beams")
    layout, meshes = assembly.layout, assembly.meshes()
    triangles = triangles_of(assembly)
    shadow = shadow_of(scanner, triangles, assembly.turning())
    progress("checking clearance, loads and walls")
    printed = {name: solid for name, solid in assembly.made.items() if not assembly.parts[name].metal}
    products = products_of(scanner, layout.drive)
    doubts = [
        Check("unverified", "warning", None, None, "", product.name, finding.message)
        for product in products
        for finding in unverified(product, assembly)
    ]
    bodies = link_bodies(scanner, assembly)
    checks = [
        *known_errors(products),
        *clearance_checks(assembly),
        *beam_checks(scanner, shadow, triangles, assembly.carriers()),
        *mechanics_checks(scanner, layout.stack, bodies),
        *retention_checks(scanner, assembly),
        *electric_checks(scanner),
        *lead_checks(assembly),
        *standing_checks(assembly),
        *deflection_checks(scanner, assembly, bodies, meshes),
        *mount_checks(scanner, assembly, bodies, meshes),
        *printing_checks(scanner.printer, printed, meshes, {name: assembly.print_pose(name) for name in printed}),
        *module_checks(scanner, left_out_of(assembly)),
        *doubts,
    ]
    return checks, shadow


def known_errors(products: Iterable[Product]) -> list[Check]:
    """A warning for each wrong value by which the printed parts do not fit the device, a note for every other one."""
    fit = {True: "the printed parts still fit", False: "the printed parts will not fit"}
    return [
        Check(
            "known_error",
            "note" if error.fits else "warning",
            None,
            None,
            "",
            product.name,
            f"{product.name}: {error.words(product)}; {fit[error.fits]}",
        )
        for product in products
        for error in product.known_wrong
    ]


def module_checks(scanner: Scanner, left_out: Iterable[LeftOut]) -> list[Check]:
    """Return an error for each module that the task requires and that has no place in this scanner.

    A module and the part that it adds have the same name.
    """
    return [
        Check(
            "module",
            "error",
            None,
            None,
            "",
            part.what,
            f"{part.what}: the task requires it (modules.{part.what} = true), but it has no place: {part.why}",
        )
        for part in left_out
        if getattr(scanner.modules, part.what, False)
    ]


def electric_checks(scanner: Scanner) -> list[Check]:
    """Every broken rule of the wiring, or one word that it keeps them; and what the catalogue does not know of it."""
    network = network_of(scanner)
    faults = [
        Check("wiring", "error", None, None, "", fault.subject, f"{fault.subject}: {fault.message}")
        for fault in check_network(network)
    ]
    kept = (
        f"wiring: all {len(network.wires)} wires end in pins, every pin is used or spare, no circuit, wire, fuse or "
        "supply carries more than it may, and every device gets its voltage"
    )
    doubts = [
        Check("wiring", "warning", None, None, "", fact.split(":")[0], f"{fact} is not in the catalogue: ask its maker")
        for fact in network.unknown
    ]
    slow = "" if scanner.slip_ring is None else data_fault(scanner.slip_ring, scanner.lidar)
    if slow:
        message = f"{slow}: data can be lost while it turns; test the link through the ring before you build"
        doubts.append(Check("ring_data", "warning", None, None, "", RING, message))
    return [
        *(faults or [Check("wiring", "pass", None, None, "", f"{scanner.lidar.name} and {scanner.servo.name}", kept)]),
        *doubts,
    ]
