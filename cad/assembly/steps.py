"""The steps of putting a scanner together, in the order that always works: those of its parts and of what is bought."""

from __future__ import annotations

from collections.abc import Sequence

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.cables.leads import RotorLead
from scanwright.cad.layout.cables.words import leads_words, standing_words
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.names import (
    BEARING_TOWER,
    DECK,
    LIDAR,
    LIDAR_BODY,
    RING,
    ROTOR_LEADS,
    SERVO,
    SERVO_CASE,
    SERVO_FRAME,
    SLIP_RING_ADAPTER,
    STANDING_LEADS,
)
from scanwright.cad.parts.part_spec import Step

ON_DECK = Step(
    "Servo on the deck",
    "The axis stands upright, so no mount is needed: drill the pattern of the servo's rear holes into the deck. "
    f"{screws(SERVO_CASE, DECK)} Leave room for the plugs.",
    "the horn turns freely, and the case lies flat on the deck",
    (SERVO,),
)
FRAME_ON_DECK = Step(
    "Frame on the deck",
    "The axis stands upright, so no mount is needed: drill the pattern of the frame's feet into the deck. "
    f"{screws(SERVO_FRAME, DECK)} Lead the servo's cable out of a window of the frame.",
    "the horn turns freely, and the frame does not rock on its four feet",
)
LIDAR_STEP = Step(
    "Lidar on its seat",
    "On the bench: put the lidar on its seat, its front to the V in the edge (FRONT), its cables to the other side. "
    f"{screws(LIDAR_BODY)}",
    "no light shows under the lidar: a gap of 0.1 mm tilts its plane by about a tenth of a degree",
)
RING_STEP = Step(
    "Slip ring",
    "Lower the ring over the shaft, the rotor's leads upwards, and clamp its rotor to the shaft with its own set "
    "screws. A cable tie in the grooves of the adapter holds the stator: it may move a little, it may not turn.",
    "turned by hand, the shaft takes the rotor along and the stator stays; no lead is pulled",
)
LEADS_TITLE = "Leads between lidar and ring"
LEADS_CHECK = "turned by hand through its whole range, no lead touches what stands still, and none pulls at its ends"
STANDING_TITLE = "Cables that stand still"
STANDING_CHECK = "turned by hand, nothing that turns comes near a cable; a pull on one is not felt at its plug"


def steps_of(assembly: Assembly) -> list[tuple[str, Step]]:
    """Part or product that a step puts in, and the step."""
    steps = {name: assembly.parts[name].step for name in assembly.made} | _of_bought(assembly)
    return sorted(steps.items(), key=lambda item: assembly.layout.drive.built.index(item[0]))


def _of_bought(assembly: Assembly) -> dict[str, Step]:
    layout, leads, steps = assembly.layout, assembly.leads, {LIDAR: LIDAR_STEP}
    if layout.scanner.slip_ring is not None:
        steps[RING] = _capsule_step(leads) if isinstance(layout.stack, BeltStack) else RING_STEP
    if any(lead.path is not None for lead in leads):
        steps[ROTOR_LEADS] = Step(LEADS_TITLE, leads_words(layout, leads), LEADS_CHECK)
    if any(lead.path is not None for lead in assembly.standing):
        steps[STANDING_LEADS] = Step(STANDING_TITLE, standing_words(layout, assembly.standing), STANDING_CHECK)
    if layout.deck.flat:
        steps[DECK] = ON_DECK if layout.drive.mounted.onto == SERVO_CASE else FRAME_ON_DECK
    return steps


def _capsule_step(leads: Sequence[RotorLead]) -> Step:
    """Every cable of the lidar gets its leads by a window that the step of the leads tells, where a way was found."""
    windows = "its windows"
    if any(lead.path is not None for lead in leads):
        windows += f', those of each cable by the one that the step "{LEADS_TITLE}" tells'
    return Step(
        "Capsule into the tower",
        f"Lead the rotor's leads up the shaft and out by {windows}, and slide the disc into the tower from below "
        f"until the soft tube sits in the shaft. {screws(SLIP_RING_ADAPTER, BEARING_TOWER)}",
        "turned by hand, the shaft takes the rotor along without slipping",
    )
