"""Servo shaft: from the servo's horn through the slip ring to the linkage's hub. One turned part.

Frame: rotation frame at gamma = 0 (`cad/layout/direct/stack.py`), mm. Horn flange with the horn's holes and a pocket
for its boss, a collar around the pocket, the shaft; the upper end is a spigot with a flat at +y, since a flange could
not pass the ring. If a bearing holds the shaft, it has a waist above the collar: horn and bearing are never quite in
line, and a stiff shaft would turn the error into a moment on the horn. One shaft fits every linkage.
"""

from functools import partial

import cadquery as cq

from scanwright.cad import outlines, solids
from scanwright.cad.layout.direct.loads import ALUMINIUM, STEEL
from scanwright.cad.layout.direct.misalignment import TRUED_MM
from scanwright.cad.layout.direct.stack import GROOVE_DEPTH, GROOVE_WIDTH, DirectStack
from scanwright.cad.layout.hub import Hub
from scanwright.cad.layout.joints import Joint, horn_centres, horn_joint, screws
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, SERVO_HORN, SERVO_SHAFT
from scanwright.cad.layout.placement import Placement
from scanwright.cad.layout.rotor.linkage import CROSS_AT
from scanwright.cad.parts.part_spec import (
    HORN,
    SEATED,
    TURNED_FROM,
    PartSpec,
    Row,
    Step,
    ToleratedDiameter,
    spigot_in_hub,
    to_centre,
)
from scanwright.cad.screws import SCREWS, passing_hole
from scanwright.cad.solids import building
from scanwright.design.catalogue.products import Printer
from scanwright.design.catalogue.servo import Servo

OF_RING = tuple(
    f"slip_ring.{field}" for field in ("bore_mm", "length_mm", "rotor", "lead_diameter_mm", "lead_bend_radius_mm")
)
INDEX = 0.6  # depth of the index groove
INDEX_NOTE = f"Index groove in the edge of the flange, on the side of the flat: V of 90\u00b0, {INDEX:g} deep."
LINKAGE_ON_SHAFT = (
    "Lower the hub onto the upper end of the shaft; the flat of the shaft fits in one position only, with the index "
    f"groove of the hub above that of the flange. {screws(SERVO_SHAFT)}"
)


def servo_shaft_spec(place: Placement) -> PartSpec | None:
    """Return the shaft of one scanner; None if it has another one."""
    scanner, stack = place.scanner, place.drive.of(DirectStack)
    if stack is None or stack.cup_bore > 0:
        return None
    fits = (spigot_in_hub(stack.shaft_diameter, scanner.printer.fit_clearance_mm),)
    if stack.bearing is not None:
        fits = (ToleratedDiameter(stack.shaft_diameter, False, "0/-0.011", "h6, the bearing's sleeve slides on it"),)
    words = (
        f"{to_centre(scanner.servo)} Put the flange of the shaft on the horn so "
        "that its index groove points to the servo's +Y face, the end of the case nearest to the horn. "
        f"{screws(SERVO_HORN)}"
    )
    check = "the index groove is over the middle of the +Y face"
    rows: tuple[Row, ...] = ()
    if stack.bearing is not None:
        words += (
            " Loosen them by a quarter turn, put an indicator on the upper end of the shaft and turn the shaft once "
            "by hand: "
            f"tap the flange until the shaft runs true within {TRUED_MM:g} mm over the turn, then tighten them."
        )
        check = f"{check}, and the indicator stays within {TRUED_MM:g} mm"
        rows = (Row("tool", "dial indicator", "dial indicator on a stand", "assembly.md", "reads 0.01 mm"),)
    return PartSpec(
        name=SERVO_SHAFT,
        turns=True,
        make=partial(servo_shaft, stack, scanner.servo, scanner.printer),
        step=Step("Shaft on the horn", words, check),
        rows=rows,
        process="turned",
        material=TURNED_FROM if stack.bearing is None else ALUMINIUM.name,
        why_metal="its threads hold the hub, and a printed one bends (0.9 deg at 12 mm with the axis horizontal)",
        fits=fits,
        notes=(INDEX_NOTE, *cross_words(stack), *_waist_words(stack)),
        shaped_by=(*HORN, "servo.horn_diameter_mm", *OF_RING),
        joints=(on_horn(scanner.servo, stack, SERVO_SHAFT),),
        steps={ALIGNMENT_LINKAGE: Step("Linkage on the shaft", LINKAGE_ON_SHAFT, SEATED)},
    )


def on_horn(servo: Servo, stack: DirectStack, part: str) -> Joint:
    """Return the joint of a part on the servo's horn, on the axis."""
    return horn_joint(servo, part, SERVO_HORN, stack.horn + stack.horn_grip, stack.horn_grip)


def servo_shaft(stack: DirectStack, servo: Servo, printer: Printer) -> cq.Solid:
    """Make the shaft."""
    horn, flange, radius = stack.horn, stack.horn + stack.flange_thickness, stack.shaft_diameter / 2
    with building(SERVO_SHAFT, "body", "shaft diameter", f"{stack.shaft_diameter:g} mm") as checked:
        body: cq.Shape = solids.upright(stack.flange_radius, horn, flange)
        if stack.collar_radius > radius:
            body = body.fuse(solids.upright(stack.collar_radius, horn, horn + stack.collar_height))
        body = checked(body.fuse(solids.upright(radius, horn, stack.spigot_top)))
    with building(SERVO_SHAFT, "holes, flat and marks", "horn_circle_mm", servo.horn_circle_mm) as checked:
        hole, boss = passing_hole(SCREWS[servo.horn_screw], printer) / 2, servo.horn_boss_diameter_mm / 2
        cuts = [solids.box((-2 * radius, stack.flat, stack.shoulder), (2 * radius, 2 * radius, stack.spigot_top + 1.0))]
        cuts += [solids.upright(hole, horn - 1.0, flange + 1.0, x, y) for x, y in horn_centres(servo).tolist()]
        cuts.append(solids.prism(outlines.diamond(INDEX, stack.flange_radius), horn - 1.0, flange + 1.0))
        cuts += cross_holes(stack)
        if boss > 0:
            cuts.append(solids.upright(boss + 0.2, horn - 1.0, horn + servo.horn_boss_height_mm + 0.5))
        if stack.bearing is not None:
            cuts += [_waist(stack), _groove(stack)]
        return checked(body.cut(*cuts).clean())


def cross_holes(stack: Hub) -> list[cq.Solid]:
    """Return tapped holes through the spigot at all azimuths that a linkage may need."""
    core, reach = stack.cross_screw.screw.core / 2, stack.shaft_diameter
    return [solids.radial(core, azimuth, stack.cross, -reach, 2 * reach) for azimuth in CROSS_AT[:2]]


def cross_words(stack: Hub) -> tuple[str, ...]:
    """Return the note of a shaft's sheet on its cross holes."""
    down = stack.spigot_top - stack.cross
    return (
        f"2 x {stack.cross_screw.screw.name} through the spigot, square to each other at 45 deg to the flat, "
        f"{down:g} below its end: tapped from all four sides.",
    )


def _waist(stack: DirectStack) -> cq.Solid:
    """Return the cut of the waist; its ends slope at 45 deg, since an edge would crack."""
    radius, waist = stack.shaft_diameter / 2, stack.waist_diameter / 2
    slope = radius - waist
    low = stack.horn + stack.collar_height
    thin = low + stack.waist_length
    outer = radius + 1.0
    return solids.lathe([[outer, low], [waist, low], [waist, thin], [outer, thin + slope + 1.0]])


def _groove(stack: DirectStack) -> cq.Solid:
    """Return the groove for the points of the sleeve's grub screws: it places the sleeve, and hides their marks."""
    low, high = stack.sleeve_grubs - GROOVE_WIDTH / 2, stack.sleeve_grubs + GROOVE_WIDTH / 2
    bottom, outer = stack.shaft_diameter / 2 - GROOVE_DEPTH, stack.shaft_diameter
    return solids.lathe([[outer, low], [bottom, low], [bottom, high], [outer, high]])


def _waist_words(stack: DirectStack) -> tuple[str, ...]:
    """Return the notes of the sheet on waist and groove."""
    if stack.bearing is None:
        return ()
    in_steel = f"{STEEL.name} \u00d8{STEEL.waist * stack.waist_diameter:.2f}"
    return (
        f"Waist {stack.waist_length:g} long: as drawn in {ALUMINIUM.name}; in {in_steel}. No other metal is flexible "
        "and strong enough. R 0.5 at its lower end.",
        f"Groove {GROOVE_WIDTH:g} wide and {GROOVE_DEPTH:g} deep, its middle {stack.spigot_top - stack.sleeve_grubs:g} "
        "below the end of the spigot, for the points of grub screws.",
        "Flange face square to the spigot and spigot true to it, one setting: 0.02.",
    )
