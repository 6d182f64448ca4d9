"""Assembly steps of a scanner in order: those of its parts and of bought products."""

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.cable_instructions import cables_text, leads_text
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.names import DECK, FIXED_CABLES, ROTOR_LEADS, SERVO, SERVO_CASE, SERVO_FRAME
from scanwright.cad.parts.part_spec import Step

OTHER_HOLES = "For a mount with other holes, write them as [deck] in the task and build again."
ON_DECK = Step(
    "Servo on the deck",
    "The axis is upright, so no mount is needed: drill the pattern of the servo's rear holes into the deck. "
    f"{screws(SERVO_CASE, DECK)} Leave space for the plugs. {OTHER_HOLES}",
    "the horn turns freely, and the case is flat on the deck",
    (SERVO,),
)
FRAME_ON_DECK = Step(
    "Frame on the deck",
    "The axis is upright, so no mount is needed: drill the pattern of the frame's feet into the deck. "
    f"{screws(SERVO_FRAME, DECK)} Lead the servo's cable out of a window of the frame. {OTHER_HOLES}",
    "the horn turns freely, and the frame does not rock on its four feet",
)
LEADS_TITLE = "Leads between lidar and ring"
LEADS_CHECK = "turned by hand through its entire range, no lead touches a fixed part, and none pulls at its ends"
CABLES_TITLE = "Cables that do not turn"
CABLES_CHECK = "turned by hand, nothing comes near a cable; a pull on a cable does not reach its plug"


def steps_of(assembly: Assembly) -> list[tuple[str, Step]]:
    """Return each step with the part or product that it adds."""
    layout = assembly.layout
    specs = [assembly.parts[name] for name in assembly.made]
    steps = {spec.name: spec.step for spec in specs if spec.step is not None}
    for spec in assembly.parts.values():
        steps |= {
            name: step for name, step in spec.steps.items() if name in assembly.made or name not in assembly.parts
        }
    if any(lead.path is not None for lead in layout.leads):
        steps[ROTOR_LEADS] = Step(LEADS_TITLE, leads_text(layout), LEADS_CHECK)
    if any(cable.path is not None for cable in layout.cables):
        steps[FIXED_CABLES] = Step(CABLES_TITLE, cables_text(layout), CABLES_CHECK)
    if layout.deck.flat:
        steps[DECK] = ON_DECK if layout.drive.mounted.onto == SERVO_CASE else FRAME_ON_DECK
    order = list(layout.drive.built)
    for spec in assembly.parts.values():
        if spec.after:
            order.insert(order.index(spec.after) + 1, spec.name)
    return sorted(steps.items(), key=lambda item: order.index(item[0]))
