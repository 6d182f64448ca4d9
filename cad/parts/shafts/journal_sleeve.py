"""Sleeve of the shaft in the bearing of a tilted axis: turned, since a bearing needs a round journal.

Frame: rotation frame at gamma = 0 (`cad/layout/direct/stack.py`), mm. It slides over the spigot after the ring, down to
a retaining ring, is bonded there, and the hub above keeps it down. The wires of the ring's rotor pass in a channel
along it, inside the bearing, below the channel of the hub.
"""

import math
from functools import partial

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.hub import BEARING_STEP, JOURNAL_WALL
from scanwright.cad.layout.names import JOURNAL_SLEEVE
from scanwright.cad.layout.placement import Placement
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage
from scanwright.cad.parts.part_spec import TURNED_FROM, PartSpec, Row, Step, ToleratedDiameter
from scanwright.cad.solids import building

SLIDES = 0.02  # in the inner ring: the lower end of g6
BOND = 0.03  # on the shaft, on the diameter: filled by retaining compound
UNDER_HUB = 0.3  # gap: the end of the shaft carries the hub
LEAST_HALF_WIDTH, BESIDE_LEADS = 5.0, 0.4  # of the channel, and on either side of the leads in it
COMPOUND = "retaining compound for metal, medium strength"
RETAINING = "groove of the shaft, under the bearing's sleeve"


def sleeve_spec(place: Placement) -> PartSpec | None:
    """Return the sleeve of one scanner; None if no bearing of a cage carries its axis."""
    stack = place.drive.of(DirectStack)
    if stack is None or stack.bearing is None:
        return None
    leads = (
        ", its channel on the side of the linkage's channel for the leads; lay the leads of the slip ring's rotor "
        "into it"
        if place.scanner.slip_ring
        else ""
    )
    words = (
        f"Snap a retaining ring DIN 471 - {stack.retaining_ring} into the groove of the shaft. Put retaining compound "
        f"on the shaft above it and slide the sleeve down onto that ring{leads}. Let the compound set."
    )
    seat = ToleratedDiameter(stack.bearing.bore_mm - SLIDES, False, "+0.013/0", f"g6, slides in {stack.bearing.name}")
    bore = ToleratedDiameter(stack.shaft_diameter + BOND, True, "±0.01", "bonded to the shaft")
    return PartSpec(
        name=JOURNAL_SLEEVE,
        turns=True,
        make=partial(journal_sleeve, place.linkage, stack),
        step=Step("Sleeve of the bearing", words, "the sleeve does not move by hand"),
        process="turned",
        material=TURNED_FROM,
        why_metal=f"{stack.bearing.name} needs a round seat to g6",
        fits=(seat, bore),
        notes=("Bore and outside in one setting: runout 0.01.",),
        shaped_by=("bearing.bore_mm", "bearing.width_mm", "slip_ring.bore_mm"),
        rows=(
            Row("consumable", "retaining ring", f"retaining ring DIN 471 - {stack.retaining_ring}", RETAINING),
            Row("tool", "circlip pliers", "pliers for external retaining rings", "assembly.md", "for DIN 471"),
            Row("consumable", "retaining compound", COMPOUND, "sleeve on the shaft"),
        ),
    )


def journal_sleeve(p: AlignmentLinkage, stack: DirectStack) -> cq.Solid:
    """Make the sleeve."""
    assert stack.bearing is not None
    low, high = stack.hub_bottom, stack.shoulder - UNDER_HUB
    assert high > stack.bearing_top > stack.shoulder - BEARING_STEP - 1e-9
    bore = (stack.shaft_diameter + BOND) / 2
    with building(JOURNAL_SLEEVE, "sleeve", "bore_mm", f"{stack.bearing.bore_mm:g}") as checked:
        body: cq.Shape = solids.upright((stack.bearing.bore_mm - SLIDES) / 2, low, high)
        cuts: list[cq.Shape] = [solids.upright(bore, low - 1.0, high + 1.0)]
        if stack.ring_length > 0:
            half = max(LEAST_HALF_WIDTH, stack.leads_half_width + BESIDE_LEADS)
            corner = (stack.shaft_diameter / 2 + JOURNAL_WALL, -half, low - 1.0)
            channel = solids.box(corner, (stack.bearing.bore_mm, half, high + 1.0))
            turn = math.degrees(sum(p.cross_azimuths) / 2)
            cuts.append(channel.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), turn))
        return checked(body.cut(*cuts).clean())
