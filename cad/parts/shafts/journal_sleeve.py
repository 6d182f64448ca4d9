"""Sleeve of the shaft in the bearing of a tilted axis: turned, since a bearing needs a round journal.

Frame: rotation frame at gamma = 0 (`cad/layout/direct/stack.py`), mm. It slides over the spigot after the ring, down to
a groove of the shaft, where two grub screws below the bearing hold it. The wires of the ring's rotor pass in a channel
along it, inside the bearing, below the channel of the hub; the grub screws press the wall behind it against the shaft.
"""

import math
from functools import partial

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.layout.direct.stack import GROOVE_DEPTH, DirectStack
from scanwright.cad.layout.hub import BEARING_STEP, JOURNAL_WALL
from scanwright.cad.layout.joints import Joint, inward_axes, round_wall_mm, screws
from scanwright.cad.layout.names import JOURNAL_SLEEVE, SERVO_SHAFT
from scanwright.cad.layout.placement import Placement
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage
from scanwright.cad.parts.part_spec import TURNED_FROM, PartSpec, Step, ToleratedDiameter
from scanwright.cad.screws import SCREWS
from scanwright.cad.solids import building

SLIDES = 0.02  # in the inner ring: the lower end of g6
LOOSE = 0.01  # on the shaft, on the diameter: about the middle of H7, as drawn
GRUB = SCREWS["M3"]
GRUBS = (math.radians(135.0), math.radians(-135.0))  # from the channel: both push its wall against the shaft
UNDER_HUB = 0.3  # gap: the end of the shaft carries the hub
FROM_FLAT = (  # which is at +y; quarters of a turn, anticlockwise from above
    "on the side of the flat of the shaft",
    "a quarter turn anticlockwise from the flat of the shaft, seen from above",
    "opposite the flat of the shaft",
    "a quarter turn clockwise from the flat of the shaft, seen from above",
)
LEAST_HALF_WIDTH, BESIDE_LEADS = 5.0, 0.4  # of the channel, and on either side of the leads in it


def sleeve_spec(place: Placement) -> PartSpec | None:
    """Return the sleeve of one scanner; None if no bearing of a cage carries its axis."""
    stack = place.drive.of(DirectStack)
    if stack is None or stack.bearing is None:
        return None
    channel = place.linkage.free_azimuth  # as that of the hub above it
    leads = (
        f", its channel {FROM_FLAT[round(math.degrees(channel) / 90.0 - 1.0) % 4]}; lay the leads of the slip ring's "
        "rotor into it"
        if place.scanner.slip_ring
        else ""
    )
    words = (
        f"Slide the sleeve onto the shaft, its threads downwards{leads}. With its upper end just below the "
        f"flat, its grub screws are over the groove of the shaft. {screws(SERVO_SHAFT)}"
    )
    seat = ToleratedDiameter(stack.bearing.bore_mm - SLIDES, False, "+0.013/0", f"g6, slides in {stack.bearing.name}")
    bore = ToleratedDiameter(stack.shaft_diameter + LOOSE, True, "+0.008/-0.01", "H7 on the shaft")
    return PartSpec(
        name=JOURNAL_SLEEVE,
        turns=True,
        make=partial(journal_sleeve, place.linkage, stack),
        step=Step(
            "Sleeve of the bearing", words, "the sleeve does not move by hand, and no grub screw stands out of it"
        ),
        process="turned",
        material=TURNED_FROM,
        why_metal=f"{stack.bearing.name} needs a round seat to g6",
        fits=(seat, bore),
        notes=("Bore and outside in one setting: runout 0.01.",),
        joints=(
            Joint(
                JOURNAL_SLEEVE,
                SERVO_SHAFT,
                "grub",
                GRUB,
                inward_axes((channel + azimuth for azimuth in GRUBS), stack.bearing.bore_mm / 2, stack.sleeve_grubs),
                grip_mm=round_wall_mm((stack.shaft_diameter + LOOSE) / 2, stack.bearing.bore_mm / 2, GRUB.core),
                thread_mm=GROOVE_DEPTH,
            ),
        ),
        shaped_by=("bearing.bore_mm", "bearing.width_mm", "slip_ring.bore_mm"),
    )


def journal_sleeve(p: AlignmentLinkage, stack: DirectStack) -> cq.Solid:
    """Make the sleeve."""
    assert stack.bearing is not None
    low, high = stack.sleeve_low, stack.shoulder - UNDER_HUB
    assert high > stack.bearing_top > stack.shoulder - BEARING_STEP - 1e-9
    radius = stack.bearing.bore_mm / 2
    with building(JOURNAL_SLEEVE, "sleeve", "bore_mm", f"{stack.bearing.bore_mm:g}") as checked:
        body: cq.Shape = solids.upright(radius - SLIDES / 2, low, high)
        cuts: list[cq.Shape] = [solids.upright((stack.shaft_diameter + LOOSE) / 2, low - 1.0, high + 1.0)]
        channel = p.free_azimuth
        cuts += [solids.radial(GRUB.core / 2, channel + turn, stack.sleeve_grubs, 0.0, radius + 1.0) for turn in GRUBS]
        if stack.ring_length > 0:
            half = max(LEAST_HALF_WIDTH, stack.leads_half_width + BESIDE_LEADS)
            corner = (stack.shaft_diameter / 2 + JOURNAL_WALL, -half, low - 1.0)
            slot = solids.box(corner, (2 * radius, half, high + 1.0))
            cuts.append(slot.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(channel)))
        return checked(body.cut(*cuts).clean())
