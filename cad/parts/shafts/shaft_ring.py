"""Ring under the lower bearing of the belt layout: with the collar above it fixes the shaft along its axis.

Frame: rotation frame at gamma = 0 (`cad/layout/belt/stack.py`), mm. A step that touches only the inner ring, and two
screws into threads of the shaft, 90 deg apart; a driver reaches them through the window of the tower.
"""

import math
from functools import partial

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.layout.belt.stack import BOSS, RING_SCREW, RING_SCREWS_DEG, BeltStack
from scanwright.cad.layout.hub import BEARING_STEP
from scanwright.cad.layout.joints import Joint, inward_axes, screws
from scanwright.cad.layout.names import MAIN_SHAFT, SHAFT_RING
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.screws import passing_hole
from scanwright.cad.solids import building
from scanwright.design.catalogue.products import Printer


def shaft_ring_spec(place: Placement) -> PartSpec | None:
    """Return the ring of one scanner; None without a belt."""
    stack, printer = place.drive.of(BeltStack), place.scanner.printer
    if stack is None:
        return None
    bore, hole = _bore(stack, printer), passing_hole(RING_SCREW, printer) / 2
    azimuths = (math.radians(azimuth) for azimuth in RING_SCREWS_DEG)
    words = (
        "From below push the shaft ring up the shaft, its step against the lower bearing and its holes over the "
        "threads, so that the shaft has no clearance along the axis and still turns freely. "
        f"{screws(MAIN_SHAFT)} Screws and driver pass the round window in the tower: turn the shaft until each hole is "
        "visible there."
    )
    return PartSpec(
        name=SHAFT_RING,
        turns=True,
        make=partial(shaft_ring, stack, printer),
        step=Step("Shaft ring under the bearings", words, "pushed and pulled along its axis the shaft does not click"),
        joints=(
            Joint(
                SHAFT_RING,
                MAIN_SHAFT,
                "thread",
                RING_SCREW,
                inward_axes(azimuths, stack.ring_seat, stack.ring_screws),
                grip_mm=stack.ring_seat - math.sqrt(bore**2 - hole**2),
                thread_mm=(stack.tube_diameter - stack.shaft_bore) / 2,
            ),
        ),
    )


def _bore(stack: BeltStack, printer: Printer) -> float:
    return (stack.tube_diameter + printer.fit_clearance_mm) / 2


def shaft_ring(stack: BeltStack, printer: Printer) -> cq.Solid:
    """Make the ring."""
    hole, head = passing_hole(RING_SCREW, printer) / 2, RING_SCREW.driver_radius
    with building(SHAFT_RING, "ring", "shaft diameter", f"{stack.tube_diameter:g} mm") as checked:
        low, high = stack.collar_low, stack.collar_low + BOSS
        body = solids.upright(stack.boss_radius, low, high).fuse(
            solids.upright(stack.collar_radius, low, high + BEARING_STEP)
        )
        bore = solids.upright(_bore(stack, printer), low - 1.0, high + 2.0)
        cuts = [bore]
        for azimuth in (math.radians(azimuth) for azimuth in RING_SCREWS_DEG):
            cuts.append(solids.radial(hole, azimuth, stack.ring_screws))
            cuts.append(solids.radial(head, azimuth, stack.ring_screws, stack.ring_seat))
        return checked(body.cut(*cuts).clean())
