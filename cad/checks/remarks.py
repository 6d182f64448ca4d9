"""What a person should know before the parts are made: findings, and what was left out. No kernel needed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from cad.drives.drive import Drive
from cad.findings import Finding
from cad.layout.deck import Deck
from cad.layout.direct_stack import Stack
from cad.layout.head import Head
from cad.layout.loads import RATED_AT_MM, Weight, rated_moment_nm, supported, weight_of
from cad.screws import SCREWS
from design.catalogue.products import Product
from design.left_out import LeftOut
from design.scanner import Scanner

if TYPE_CHECKING:
    from cad.assembly.assembly import Assembly
    from cad.geometry.inertia import Inertial

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


BALANCE = {"lidar": {"mass_g": "counterweight"}, "servo": {"backlash_deg": "whether there is a counterweight"}}


def findings_of(scanner: Scanner, assembly: Assembly, bodies: dict[str, Inertial]) -> tuple[Finding, ...]:
    """Everything worth a line, in the order of the parts."""
    drive = assembly.drive
    found = drive.findings(bodies)
    if assembly.deck.flat:
        found.append(_held_by_screws(scanner, assembly.deck))
    for product in products_of(scanner, drive):
        found += unverified(product, assembly)
    return tuple(found)


def products_of(scanner: Scanner, drive: Drive) -> list[Product]:
    """Every product that shapes parts, each once."""
    found: list[Product | None] = [scanner.lidar, scanner.servo, scanner.slip_ring, *drive.products(), scanner.printer]
    return list({product.name: product for product in found if product is not None}.values())


def left_out_of(assembly: Assembly) -> tuple[LeftOut, ...]:
    """Parts that this scanner does not need."""
    out = assembly.drive.left_out()
    if isinstance(assembly.counterweight, LeftOut):
        out.append(assembly.counterweight)
    if assembly.deck.flat:
        out.append(LeftOut("base_mount", "the axis stands upright: the servo is screwed flat to the deck", 1, "parts"))
    return tuple(out)


def turn_from_metal(part: str, why: str) -> Finding:
    """That a shaft is for the lathe, and why."""
    return Finding(
        "turn_from_metal",
        "note",
        part,
        f"{part}: {why}: have it turned from aluminium or steel after its STEP file",
    )


def tilt_moment(scanner: Scanner, stack: Stack, bodies: dict[str, Inertial]) -> list[Finding]:
    """What the weight of all that turns puts on a horn that carries it, against its rating."""
    from cad.parts.bearing_cage import cage_of, stiffness_n_per_m

    rated, servo = rated_moment_nm(scanner), scanner.servo
    if rated is None:
        return []
    weight = rotor_weight(scanner, stack, bodies)
    cage = cage_of(scanner, stack)
    if cage is None:
        moment, help_ = weight.moment_nm, "support the shaft with a bearing near the hub; none of the catalogue fits it"
    else:
        moment = supported(weight, stack, stiffness_n_per_m(cage)).horn_moment_nm
        help_ = "lighten what turns, or raise the axis"
    if moment <= rated:
        return []
    return [
        Finding(
            "tilt_moment",
            "warning",
            "servo_shaft",
            f"servo_shaft: the tilted axis puts {moment:.2f} N m on the horn of {servo.name}, rated {rated:.2f} N m "
            f"({servo.radial_load_n:g} N at {RATED_AT_MM:g} mm): {help_}",
        )
    ]


def rotor_weight(scanner: Scanner, stack: Head, bodies: dict[str, Inertial]) -> Weight:
    """Weight of all that turns, from the bodies of `link_bodies`."""
    from cad.geometry.inertia import together

    rotor = together([bodies["rot"], bodies["laser"].moved(scanner.angles.T_rot_laser())])
    x, y, z = rotor.centre_m
    return weight_of(scanner, rotor.mass_kg, float(z) - stack.horn / 1000, math.hypot(x, y))


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


def unverified(product: Product, assembly: Assembly) -> list[Finding]:
    """Values of a product that nobody has verified and that shape a part."""
    provenance, shaping = product.provenance(), {**SHAPING, **assembly.drive.shaping()}
    if not isinstance(assembly.counterweight, LeftOut):
        shaping |= BALANCE.get(product.kind, {})
    return [
        Finding(
            "unverified",
            "warning",
            product.name,
            f"{product.name}: {field} = {_shown(getattr(product, field))} is not verified "
            f"({provenance[field].source}): measure yours, it shapes {shaping[field]}",
        )
        for field in product.unverified()
        if field in shaping
    ]


def _shown(value: object) -> str:
    text = str(list(value)) if isinstance(value, tuple) else str(value)
    return text if len(text) < 60 else text[:57] + "..."
