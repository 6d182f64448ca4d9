"""What a person should know before the parts are made: findings, and what was left out. No kernel needed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from cad.deck import Deck
from cad.findings import Finding
from cad.screws import SCREWS
from cad.sizing import Stack
from design.catalogue import Product
from design.left_out import LeftOut
from design.scanner import Scanner

if TYPE_CHECKING:
    from cad.assembly import Assembly
    from cad.mass import Inertial

STANDARD_GRAVITY = 9.80665
SHAFT_PRINTABLE = 20.0  # mm: below it a printed shaft bends by about 1 deg (measured study)
RATED_AT_MM = 10.0  # the servo's radial load is rated at this distance from the horn

# Which values of a product shape which parts.
SHAPING = {
    "body_mm": "alignment_linkage",
    "optical_height_mm": "alignment_linkage",
    "window_z_mm": "alignment_linkage",
    "mount_screw": "alignment_linkage",
    "mount_holes_mm": "alignment_linkage",
    "mount_thread_depth_mm": "the length of the screws in the lidar",
    "cable_y_mm": "alignment_linkage",
    "cable_z_mm": "alignment_linkage",
    "cable_diameter_mm": "alignment_linkage",
    "cable_straight_mm": "alignment_linkage",
    "case_min_mm": "base_mount",
    "case_max_mm": "slip_ring_adapter and base_mount",
    "horn_diameter_mm": "servo_shaft and slip_ring_adapter",
    "horn_thickness_mm": "slip_ring_adapter",
    "horn_boss_diameter_mm": "servo_shaft",
    "horn_boss_height_mm": "servo_shaft",
    "horn_circle_mm": "servo_shaft",
    "horn_holes": "servo_shaft",
    "horn_first_hole_deg": "servo_shaft",
    "horn_screw": "servo_shaft",
    "case_screw": "slip_ring_adapter and base_mount",
    "case_holes_mm": "slip_ring_adapter",
    "case_holes_z_mm": "slip_ring_adapter",
    "case_rear_holes_mm": "base_mount",
    "case_rear_holes_z_mm": "base_mount",
    "bore_mm": "servo_shaft",
    "outer_diameter_mm": "slip_ring_adapter",
    "length_mm": "servo_shaft and slip_ring_adapter",
    "screw_clearance_mm": "every screw hole",
    "fit_clearance_mm": "the bore of alignment_linkage",
}


def shaft_is_turned(stack: Stack) -> bool:
    """Whether the shaft is too thin to be printed."""
    return stack.shaft_diameter < SHAFT_PRINTABLE


def findings_of(scanner: Scanner, assembly: Assembly, bodies: dict[str, Inertial]) -> tuple[Finding, ...]:
    """Everything worth a line, in the order of the parts."""
    found = []
    stack = assembly.stack
    if shaft_is_turned(stack):
        found.append(
            Finding(
                "turn_from_metal",
                "note",
                "servo_shaft",
                f"servo_shaft: {stack.shaft_diameter:g} mm is too thin to print (0.9 deg of bending with the axis "
                "horizontal): have it turned from aluminium or steel after its STEP file",
            )
        )
    found += _covered(assembly)
    found += _tilt_moment(scanner, assembly, bodies)
    if assembly.deck.flat:
        found.append(_held_by_screws(scanner, assembly.deck))
    products = (scanner.lidar, scanner.servo, scanner.slip_ring, scanner.printer)
    for product in products:
        if product is not None:
            found += _unverified(product)
    return tuple(found)


def left_out_of(scanner: Scanner, deck: Deck) -> tuple[LeftOut, ...]:
    """Parts that this scanner does not need."""
    out = []
    if scanner.slip_ring is None:
        out.append(LeftOut("slip_ring_adapter", "this scanner has no slip ring", 1, "parts"))
    if deck.flat:
        out.append(LeftOut("base_mount", "the axis stands upright: the servo is screwed flat to the deck", 1, "parts"))
    return tuple(out)


def _covered(assembly: Assembly) -> list[Finding]:
    from cad.parts.alignment_linkage import covered_screws

    covered = [assembly.linkage.holes[i] for i in covered_screws(assembly.linkage)]
    if not covered:
        return []
    named = ", ".join(f"({x:g}, {y:g})" for x, y in covered)
    return [
        Finding(
            "screw_under_hub",
            "warning",
            "alignment_linkage",
            f"alignment_linkage: the hub covers the lidar's screw at {named} mm of its base: use the other "
            f"{len(assembly.linkage.holes) - len(covered)}",
        )
    ]


def _tilt_moment(scanner: Scanner, assembly: Assembly, bodies: dict[str, Inertial]) -> list[Finding]:
    """Weight of all that turns, times its lever over the horn, against the horn's rating."""
    from cad.mass import together

    rated = scanner.servo.radial_load_n
    if rated is None:
        return []
    rotor = together([bodies["rot"], bodies["laser"].moved(scanner.angles.T_rot_laser())])
    lever = rotor.centre_m - np.array([0.0, 0.0, assembly.stack.horn / 1000])
    down = -np.array(scanner.angles.T_world_rot(0.0)[2, :3])
    # the worst turn: the offset from the axis adds to the lever along it
    sideways = math.hypot(down[0], down[1])
    moment = (
        rotor.mass_kg
        * STANDARD_GRAVITY
        * (abs(lever[2]) * sideways + math.hypot(lever[0], lever[1]) * abs(float(down[2])))
    )
    limit = rated * RATED_AT_MM / 1000
    if moment <= limit:
        return []
    return [
        Finding(
            "tilt_moment",
            "warning",
            "servo_shaft",
            f"servo_shaft: the tilted axis puts {moment:.2f} N m on the horn of {scanner.servo.name}, rated "
            f"{limit:.2f} N m ({rated:g} N at {RATED_AT_MM:g} mm): support the shaft with a bearing near the hub",
        )
    ]


def _held_by_screws(scanner: Scanner, deck: Deck) -> Finding:
    screw = SCREWS[scanner.servo.case_screw]
    named = ", ".join(f"({x:g}, {y:g})" for x, y in deck.rear_holes)
    return Finding(
        "servo_on_deck",
        "note",
        "base_mount",
        f"base_mount: left out, the axis stands upright: hold {scanner.servo.name} by its rear holes with 4 x "
        f"{screw.name} from below through the deck, {screw.nominal + scanner.printer.screw_clearance_mm:g} mm holes at "
        f"{named} mm from the axis; leave room for the plugs",
    )


def _unverified(product: Product) -> list[Finding]:
    provenance = product.provenance()
    return [
        Finding(
            "unverified",
            "warning",
            product.name,
            f"{product.name}: {field} = {_shown(getattr(product, field))} is not verified "
            f"({provenance[field].source}): measure yours, it shapes {SHAPING[field]}",
        )
        for field in product.unverified()
        if field in SHAPING
    ]


def _shown(value: object) -> str:
    text = str(list(value)) if isinstance(value, tuple) else str(value)
    return text if len(text) < 60 else text[:57] + "..."
