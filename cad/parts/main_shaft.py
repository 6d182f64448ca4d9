"""Main shaft of the belt layout: a tube in two bearings, with the spigot that the linkage sits on. One turned part.

Frame: rotation frame at gamma = 0 (`cad/layout/belt_stack.py`), mm. The spigot is the one of `servo_shaft`, its flat
at +y. A collar lies on the upper bearing and carries the pulley. The capsule's leads come up the bore and leave
through two windows below the web under the spigot.
"""

from __future__ import annotations

from dataclasses import dataclass

import cadquery as cq

from cad import solids
from cad.layout.belt_stack import BeltStack
from cad.solids import building, checked

PART = "main_shaft"
UNDER_HUB = 0.3  # gap: the end of the spigot carries the hub, not the shoulder
WEB = 4.0  # between the bore and the spigot
WINDOW = 8.0  # diameter


@dataclass(frozen=True, slots=True, kw_only=True)
class MainShaft:
    """Lengths in mm."""

    stack: BeltStack


def main_shaft(p: MainShaft) -> cq.Solid:
    """Make the shaft.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    size, top = f"{stack.tube_diameter:g} mm", stack.hub_bottom - UNDER_HUB
    with building(PART, "body", "shaft diameter", size):
        radius = stack.shaft_diameter / 2
        body: cq.Shape = solids.upright(stack.seat_diameter / 2, stack.shaft_bottom, top)
        body = body.fuse(
            solids.upright(stack.collar_radius, stack.tower_top, stack.teeth_low),
            solids.upright(radius, top - 0.5, stack.spigot_top),
        )
        body = checked(body, PART, "body", "shaft diameter", size)
    with building(PART, "bore, windows and flat", "bore", f"{stack.shaft_bore:g} mm"):
        end = top - WEB
        flat = (-2 * radius, stack.flat, stack.hub_bottom)
        cuts = [
            solids.upright(stack.shaft_bore / 2, stack.shaft_bottom - 1.0, end),
            solids.cylinder(WINDOW / 2, (-stack.tube_diameter, 0.0, end - WINDOW / 2), (1.0, 0.0, 0.0), 99.0),
            solids.box(flat, (2 * radius, 2 * radius, stack.spigot_top + 1.0)),
        ]
        return checked(body.cut(*cuts).clean(), PART, "bore, windows and flat", "bore", stack.shaft_bore)
