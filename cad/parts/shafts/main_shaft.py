"""Main shaft of the belt layout: a tube in two bearings, with the spigot of the linkage. One turned part.

Frame: rotation frame at gamma = 0 (`cad/layout/belt/stack.py`), mm. The spigot is that of `servo_shaft`, its flat at
+y. A collar rests on the upper bearing and carries the pulley. The capsule's leads come up the bore and leave through
two windows below the web under the spigot.
"""

import math
from functools import partial

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.layout.belt.stack import RING_SCREW, RING_SCREWS_DEG, BeltStack
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, MAIN_SHAFT
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import SEATED, TURNED_FROM, PartSpec, Step, ToleratedDiameter, spigot_in_hub
from scanwright.cad.parts.shafts.servo_shaft import cross_holes, cross_words
from scanwright.cad.solids import building

UNDER_HUB = 0.3  # gap: the end of the spigot carries the hub, not the shoulder
WEB = 4.0  # between the bore and the spigot
WINDOW = 8.0  # diameter
LINKAGE_WORDS = (
    "Lower the hub onto the upper end of the shaft; the flat of the shaft fits in one position only. "
    f"{screws(MAIN_SHAFT)} Now set the belt: turn the servo to its centre again, then the linkage, and the shaft in "
    "its loose pulley, until the index groove of the hub is over that in the edge of the tower's top, and tighten the "
    "pulley's two grub screws. Both pulleys have the same number of teeth and turn in the same direction, so the "
    "servo's angle is that of the axis."
)


def main_shaft_spec(place: Placement) -> PartSpec | None:
    """Return the shaft of one scanner; None without a belt."""
    scanner, stack = place.scanner, place.drive.of(BeltStack)
    if stack is None:
        return None
    seat = ToleratedDiameter(stack.seat_diameter, False, "+0.02/0", "f7 in the bearings, which slide on by hand")
    words = "Lower the shaft through both bearings until its collar lies on the upper one."
    return PartSpec(
        name=MAIN_SHAFT,
        turns=True,
        make=partial(main_shaft, stack),
        step=Step("Shaft into the tower", words, "the shaft turns with one finger and does not tilt"),
        process="turned",
        material=TURNED_FROM,
        why_metal=f"two bearings of {stack.carrier.bore_mm:g} mm need its seats to f7 (-0.02 to -0.041)",
        fits=(seat, spigot_in_hub(stack.shaft_diameter, scanner.printer.fit_clearance_mm)),
        notes=(
            *cross_words(stack),
            f"2 x {RING_SCREW.name} into the bore near the lower end, square to each other: deburred inside, leads "
            "pass.",
        ),
        shaped_by=("bearing.bore_mm", "slip_ring.rotor"),
        steps={ALIGNMENT_LINKAGE: Step("Linkage on the shaft, and the belt set", LINKAGE_WORDS, SEATED)},
    )


def main_shaft(stack: BeltStack) -> cq.Solid:
    """Make the shaft."""
    radius, top = stack.shaft_diameter / 2, stack.shoulder - UNDER_HUB
    with building(MAIN_SHAFT, "body", "shaft diameter", f"{stack.tube_diameter:g} mm") as checked:
        body: cq.Shape = solids.upright(stack.seat_diameter / 2, stack.shaft_bottom, top)
        collar = solids.upright(stack.collar_radius, stack.tower_top, stack.teeth_low)
        body = checked(body.fuse(collar, solids.upright(radius, top - 0.5, stack.spigot_top)))
    with building(MAIN_SHAFT, "bore, windows and flat", "bore", f"{stack.shaft_bore:g} mm") as checked:
        end = top - WEB
        cuts = [
            solids.upright(stack.shaft_bore / 2, stack.shaft_bottom - 1.0, end),
            solids.cylinder(WINDOW / 2, (-stack.tube_diameter, 0.0, end - WINDOW / 2), (1.0, 0.0, 0.0), 99.0),
            solids.box((-2 * radius, stack.flat, stack.shoulder), (2 * radius, 2 * radius, stack.spigot_top + 1.0)),
            *cross_holes(stack),
        ]
        for azimuth in RING_SCREWS_DEG:
            cuts.append(solids.radial(RING_SCREW.core / 2, math.radians(azimuth), stack.ring_screws))
        return checked(body.cut(*cuts).clean())
