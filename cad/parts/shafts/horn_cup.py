"""Horn cup: the printed shaft of a scanner without ring and bearing, from the servo's horn to the linkage's hub.

Frame: rotation frame at gamma = 0 (`cad/layout/direct/stack.py`), mm. A floor as wide as the hub, with the horn's holes
and a pocket for its boss; on it a wall around the heads of the horn's screws, whose rim carries the hub and whose flat
at +y keys it. Two nuts are in slots of the wall, open above, for the screws that cross from the hub.
"""

import math
from functools import partial

import cadquery as cq

from scanwright.cad import outlines, solids
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.joints import horn_centres, screws
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, HORN_CUP, SERVO_HORN
from scanwright.cad.layout.placement import Placement
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage
from scanwright.cad.parts.part_spec import HORN, PartSpec, Step, spigot_in_hub, to_centre
from scanwright.cad.parts.shafts.servo_shaft import on_horn
from scanwright.cad.screws import SCREWS, Trap, passing_hole
from scanwright.cad.solids import building
from scanwright.design.catalogue.products import Printer
from scanwright.design.catalogue.servo import Servo

AROUND_BOSS = 0.2  # of the horn
SEATED_ON_RIM = "the hub is on the rim of the cup without a gap, and does not rock when the lidar is pushed sideways"
LINKAGE_WORDS = (
    "Lower the hub over the cup onto its rim; the flat of the cup fits in one position only, with the index groove of "
    f"the hub above that of the cup. {screws(HORN_CUP)}"
)


def cup_spec(place: Placement) -> PartSpec | None:
    """Return the cup of one scanner; None if its shaft is turned."""
    p, stack, scanner = place.linkage, place.drive.of(DirectStack), place.scanner
    if stack is None or stack.cup_bore == 0:
        return None
    words = (
        f"{to_centre(place.scanner.servo)} Put the cup on the horn so that its flat and "
        f"its index groove face the servo's +Y face, the end of the case nearest to the horn. {screws(SERVO_HORN)}"
    )
    return PartSpec(
        name=HORN_CUP,
        turns=True,
        make=partial(horn_cup, p, stack, scanner.servo, scanner.printer),
        step=Step("Cup on the horn", words, "the index groove is over the middle of the +Y face"),
        fits=(spigot_in_hub(stack.shaft_diameter, p.fit),),
        shaped_by=HORN,
        joints=(on_horn(scanner.servo, stack, HORN_CUP),),
        steps={ALIGNMENT_LINKAGE: Step("Linkage on the cup", LINKAGE_WORDS, SEATED_ON_RIM)},
    )


def horn_cup(p: AlignmentLinkage, stack: DirectStack, servo: Servo, printer: Printer) -> cq.Solid:
    """Make the cup."""
    horn, floor, top = stack.horn, stack.horn + stack.flange_thickness, stack.spigot_top
    radius, bore, seat = stack.shaft_diameter / 2, stack.cup_bore / 2, horn + stack.horn_grip
    with building(HORN_CUP, "floor and wall", "horn_circle_mm", servo.horn_circle_mm) as checked:
        if stack.foot_radius > 0:
            foot, low = stack.foot_radius, horn + stack.foot_height
            outline = [(0.0, horn), (foot, horn), (foot, low), (radius, low + radius - foot), (radius, top), (0.0, top)]
            body: cq.Shape = solids.lathe(outline)
        else:
            body = solids.upright(stack.flange_radius, horn, floor).fuse(solids.upright(radius, horn, top))
        body = checked(body.cut(solids.upright(bore, seat, top + 1.0)))
    with building(HORN_CUP, "holes, flat and marks", "horn_circle_mm", servo.horn_circle_mm) as checked:
        hole, boss = passing_hole(SCREWS[servo.horn_screw], printer) / 2, servo.horn_boss_diameter_mm / 2
        cuts = [solids.box((-2 * radius, stack.flat, floor), (2 * radius, 2 * radius, top + 1.0))]
        cuts += [solids.upright(hole, horn - 1.0, seat + 1.0, x, y) for x, y in horn_centres(servo).tolist()]
        cuts.append(solids.prism(outlines.diamond(0.6, stack.flange_radius), horn - 1.0, floor + 1.0))  # index groove
        if boss > 0:
            cuts.append(solids.upright(boss + AROUND_BOSS, horn - 1.0, horn + servo.horn_boss_height_mm + 0.5))
        for azimuth in p.cross_azimuths:
            cuts += _cross_holes(p, azimuth)
        return checked(body.cut(*cuts).clean())


def _cross_holes(p: AlignmentLinkage, azimuth: float) -> list[cq.Solid]:
    """Return the hole of one cross screw through the wall, or to the slot of its nut."""
    stack, thread = p.stack, p.cross_thread
    assert thread is not None  # as in every cup
    bore, outer, trap = stack.cup_bore / 2, stack.shaft_diameter / 2, thread.trap
    start = bore - 1.0 if trap is None else outer - stack.cross_screw.before_nut - 0.1
    hole = solids.radial(thread.hole / 2, azimuth, stack.cross, start, outer + 1.0 - start)
    return [hole] if trap is None else [hole, *_slots(p, trap, azimuth)]


def _slots(p: AlignmentLinkage, trap: Trap, azimuth: float) -> list[cq.Solid]:
    """Return the slot of a nut, inserted before the hub, and a narrower one behind it for the screw's end."""
    stack, top = p.stack, p.stack.spigot_top + 1.0
    outer = stack.shaft_diameter / 2 - stack.cross_screw.before_nut
    nut, end = trap.across / 2, p.cross_hole / 2
    cuts = [
        solids.box((outer - trap.depth, -nut, stack.cross - trap.corner), (outer, nut, top)),
        solids.box((stack.cup_bore / 2 - 1.0, -end, stack.cross - end), (outer, end, top)),
    ]
    return [cut.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(azimuth)) for cut in cuts]
