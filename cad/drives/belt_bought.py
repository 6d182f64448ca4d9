"""Bought parts of the belt layout, true to size as far as the catalogue knows them. Rotation frame, mm."""

from __future__ import annotations

import cadquery as cq

from cad import solids
from cad.assembly import bought
from cad.layout.belt_stack import BeltStack
from cad.parts.capsule_holder import flange_centres
from cad.solids import building, checked

BELT_GAP = 0.05  # between the tips of the teeth and the belt between its teeth
STUB = 0.4  # between the stub of the rotor and the capsule's body


def belt_bought(stack: BeltStack) -> dict[str, cq.Solid]:
    """Servo, bearings, capsule and belt; the teeth of the belt are left out: they fill the grooves."""
    servo = solids.location(stack.turn(), stack.beside() * [1.0, 1.0, 0.0])
    bodies = {
        "servo_case": bought.servo_case(stack.servo, stack.horn).moved(servo),
        "servo_output": bought.servo_horn(stack.servo, stack.horn).moved(servo),
    }
    for place, top in (("upper", stack.tower_top), ("lower", stack.lower_bottom + stack.carrier.width_mm)):
        rings = bought.bearing_solids(stack.carrier, top)
        bodies |= {f"{name}_{place}": solid for name, solid in rings.items()}
    return bodies | {"ring_stator": _capsule(stack), "ring_rotor": _rotor(stack), "belt": _belt(stack)}


def _capsule(stack: BeltStack) -> cq.Solid:
    """Body and flange, hollow where the rotor's stub comes out."""
    flange = stack.flange
    with building("ring_stator", "flange", "flange.diameter_mm", flange.diameter_mm):
        body = solids.upright(stack.ring_radius, stack.ring_bottom, stack.ring_top).fuse(
            solids.upright(flange.diameter_mm / 2, stack.disc_top, stack.flange_top)
        )
        low, high = stack.disc_top - 1.0, stack.flange_top + 1.0
        holes = [solids.upright(flange.hole_mm / 2, low, high, x, y) for x, y in flange_centres(stack)]
        capsule = checked(body.cut(*holes), "ring_stator", "flange", "flange.diameter_mm", flange.diameter_mm)
    return capsule.moved(solids.location(stack.turn()))


def _rotor(stack: BeltStack) -> cq.Solid:
    return solids.upright(stack.rotor.diameter_mm / 2, stack.ring_top + STUB, stack.ring_top + stack.rotor.length_mm)


def _belt(stack: BeltStack) -> cq.Solid:
    """Its back, around both pulleys."""
    half = stack.belt.width_mm / 2
    low, high = stack.belt_middle - half, stack.belt_middle + half
    inner, outer = stack.tip_radius + BELT_GAP, stack.belt_radius + BELT_GAP
    with building("belt", "loop", "centre distance", stack.centre):
        loops = []
        for radius, beyond in ((outer, 0.0), (inner, 1.0)):
            ends = [solids.upright(radius, low - beyond, high + beyond, x) for x in (0.0, stack.centre)]
            middle = solids.box((0.0, -radius, low - beyond), (stack.centre, radius, high + beyond))
            loops.append(middle.fuse(*ends).clean())
        belt = checked(loops[0].cut(loops[1]), "belt", "loop", "centre distance", stack.centre)
    return belt.moved(solids.location(stack.turn()))
