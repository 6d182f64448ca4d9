"""Screws that cross through the hub into its shaft, and how firmly they hold the angle of the linkage. No kernel.

They press the hub's bore onto the shaft with the preload that creep leaves; friction under their heads is neglected.
"""

import math

from scanwright.cad.layout.hub import Hub
from scanwright.cad.layout.joints import LENGTHS, THREAD_FREE, Joint, fixing_in, inward_axes, round_wall_mm
from scanwright.cad.layout.loads import friction_nm
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage
from scanwright.cad.layout.tightening import ALUMINIUM, FRICTION, HELD_G, PRINTED, hold_of
from scanwright.cad.screws import Thread
from scanwright.design.frames import STANDARD_GRAVITY_M_S2
from scanwright.design.scanner import Scanner

SQUARE = math.sqrt(2.0)  # force of two screws, square to each other, over that of one
LEAST_ENGAGED = 0.5  # diameters of thread in a shaft, which then carries the preload by the washer
CROSSING = 0.2  # mm between the end of one cross screw and the thread of the other
LIDAR_CENTRE_ERROR_MM = 2.0
"""Error of a lidar's centre of mass from the middle of its box, in any direction: assumed, undocumented.

Motor, mirror and most boards are around its axis; plugs and windows, a tenth of it, are 20 mm off.
"""


def cross_joint(p: AlignmentLinkage, shaft: str) -> Joint:
    """Return the cap screws through the hub's wall into threads or nuts of a shaft."""
    cross, heads = p.stack.cross_screw, cross_seat_mm(p.stack)
    floor = min(_floor_mm(p, azimuth) for azimuth in p.cross_azimuths)
    return Joint(
        ALIGNMENT_LINKAGE,
        shaft,
        "thread" if p.cross_thread is None else fixing_in(p.cross_thread),
        cross.screw,
        inward_axes(p.cross_azimuths, heads, p.stack.cross),
        grip_mm=heads - floor,
        thread_mm=_thread_mm(p.stack, p.cross_thread, floor),
        thread=p.cross_thread,
        washer_mm=cross.washer,
    )


def held_nm(stack: Hub, joint: Joint) -> float:
    """Return the torque about the axis that the friction of a hub on its shaft holds."""
    hold = hold_of(joint, PRINTED, PRINTED if stack.cup_bore > 0 else ALUMINIUM)
    assert hold is not None
    return FRICTION * SQUARE * hold.preload_n * stack.shaft_diameter / 2000


def turning_nm(scanner: Scanner, imbalance_kg_m: float) -> float:
    """Return the torque about the axis by HELD_G on a rotor, whose lidar's centre is uncertain, and by its ring."""
    imbalance = imbalance_kg_m + scanner.lidar.mass_g * LIDAR_CENTRE_ERROR_MM * 1e-6
    return HELD_G * STANDARD_GRAVITY_M_S2 * imbalance + friction_nm(scanner)[1]


def slip_deg(p: AlignmentLinkage, joint: Joint) -> float:
    """Return the backlash of the hub on its shaft [deg], limited by the flat or by the shanks of the screws.

    The flat's edges meet the wall of the bore, or the shanks that of their holes.
    """
    radius, flat = p.stack.shaft_diameter / 2, p.stack.flat
    by_flat = math.acos(flat / radius) - math.acos(min(1.0, (flat + p.fit / 2) / radius))
    by_screws = (p.cross_hole - joint.screw.nominal) / 2 / cross_seat_mm(p.stack)
    return 2 * math.degrees(min(by_flat, by_screws))


def cross_seat_mm(stack: Hub) -> float:
    """Return the distance of the cross screws' washers from the axis.

    They are sunk further into the hub of a turned shaft if a screw of a standard length would engage too little.
    """
    screw, seat = stack.cross_screw.screw, stack.hub_radius - stack.cross_screw.sunk
    tip = screw.nominal / 2 + CROSSING + THREAD_FREE
    length = max((n for n in LENGTHS[screw.name] if n + tip <= seat), default=0)
    engaged = length - (seat - stack.shaft_diameter / 2)
    return seat if stack.cup_bore > 0 or engaged >= LEAST_ENGAGED * screw.nominal else length + tip


def _floor_mm(p: AlignmentLinkage, azimuth: float) -> float:
    """Return the distance from the axis at which a cross screw leaves the hub: at the bore, or its flat."""
    bore, half = (p.stack.shaft_diameter + p.fit) / 2, p.cross_hole / 2
    flat, out = p.stack.flat + p.fit / 2, math.sin(azimuth)
    on_flat = (flat - half * abs(math.cos(azimuth))) / out if out > 0 else bore
    return min(math.sqrt(bore**2 - half**2), on_flat)


def _thread_mm(stack: Hub, thread: Thread | None, floor: float) -> float:
    """Return the thread length of a cross screw in a turned shaft up to the other one, or in a cup up to its nut."""
    if thread is None:
        return floor - stack.cross_screw.screw.nominal / 2 - CROSSING
    if thread.trap is not None:
        return stack.cross_screw.before_nut
    return round_wall_mm(stack.cup_bore / 2, stack.shaft_diameter / 2, thread.hole)
