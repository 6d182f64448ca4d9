"""Lean of the mount under its load: an error of the scanner's pose that no cloud shows.

It is the same in every position of the servo (to 0.0001 deg, `benchmarks.cad.elements`).
"""

import math
from collections.abc import Mapping

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.masses import rotor_of
from scanwright.cad.checks.limits import tidy
from scanwright.cad.checks.table import LEAN_DEG
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.layout.names import BASE_MOUNT, TRIPOD_FOOT
from scanwright.cad.parts.mounts.base_mount import FOOT_RADIUS
from scanwright.cad.screws import passing_hole
from scanwright.cad.statics.mount_sag import Carried, mount_sag
from scanwright.cad.statics.spring import Spring
from scanwright.design.findings import Finding, Severity
from scanwright.design.scanner import Scanner

WASHER_MM = 4.0  # a deck screw's washer extends so far beyond its hole
LEAST_ERROR = 0.25  # share of the lean: CalculiX differs by less (`benchmarks.cad.elements`)


def mount_checks(
    scanner: Scanner, assembly: Assembly, bodies: Mapping[str, Inertial], meshes: Mapping[str, TriMesh]
) -> tuple[list[Finding], Spring | None]:
    """Check the lean of a scanner on its mount, and return the mount as a spring, if it has one.

    Arguments as for `deflection_checks`.
    """
    if BASE_MOUNT not in assembly.made:
        return [], None
    printer, layout = scanner.printer, assembly.layout
    try:
        turned, more, spring = mount_sag(
            meshes[BASE_MOUNT],
            layout.deck,
            layout.drive.mounted,
            carried(scanner, assembly, bodies),
            1000 * printer.modulus_gpa,
            printer.density_g_cm3,
        )
    except RuntimeError as error:
        message = f"{BASE_MOUNT}: nothing supports its load: no equilibrium by finite elements ({error})"
        return [Finding("mount_lean", "error", BASE_MOUNT, message, None, LEAN_DEG, "deg")], None
    lean = np.degrees(scanner.angles.T_world_rot(0.0)[:3, :3] @ (turned + more))
    value = round(float(np.linalg.norm(lean)), 6)
    error_deg = max(math.degrees(float(np.linalg.norm(more))), LEAST_ERROR * value)
    severity: Severity = "note" if value + error_deg <= LEAN_DEG else "warning"
    x, y, z = (f"{round(float(part), 3) + 0.0:g}" for part in lean)
    message = (
        f"{BASE_MOUNT}: leans under its load by {value:.2g} ± {error_deg:.1g} deg if only its screws hold it, less if "
        f"the deck supports its foot: in every position it turns the scanner by ({x}, {y}, {z}) deg about the world's "
        "x, y and z"
    )
    hint = "add this rotation to the scanner's pose on the robot"
    return [Finding("mount_lean", severity, BASE_MOUNT, message, tidy(value), LEAN_DEG, "deg", hint)], spring


def carried(scanner: Scanner, assembly: Assembly, bodies: Mapping[str, Inertial]) -> Carried:
    """Return all above the mount, its rotor spread about the axis; bodies of `masses.link_bodies`."""
    rotor, fixed = rotor_of(scanner, bodies), bodies["servo"]
    below = [assembly.inertial(name) for name in (BASE_MOUNT, TRIPOD_FOOT) if name in assembly.made]
    shares = [
        (fixed.mass_kg, fixed.centre_m),
        (rotor.mass_kg, rotor.centre_m * [0.0, 0.0, 1.0]),
        *((-body.mass_kg, body.centre_m) for body in below),
    ]
    mass = sum(share for share, _ in shares)
    centre = sum((share * at for share, at in shares), np.zeros(3)) / mass
    return Carried(
        mass_kg=mass,
        centre_m=centre,
        down=-scanner.angles.T_world_rot(0.0)[2, :3],
        seat_mm=FOOT_RADIUS,
        washer_mm=passing_hole(assembly.layout.deck.screw, scanner.printer) / 2 + WASHER_MM,
    )
