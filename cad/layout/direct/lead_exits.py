"""Where the leads of a through-bore ring leave it: on the rotor under the hub, on the stator towards the deck.

Rotation frame at gamma = 0, mm.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scanwright.cad.layout.direct.loads import JOURNAL_WALL
from scanwright.cad.layout.direct.stack import STATOR_EXIT, DirectStack
from scanwright.cad.layout.drive import BUNDLE_GAP, Bundle, LeadExit, StatorExit, towards
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.design.arrays import Array
from scanwright.design.scanner import Scanner

ABOVE_CAGE = 1.9  # height of a lead over the lower face of the hub if it leaves through the hub's channel
BELOW_HUB = 0.85  # between the lower face of the hub's tongue and a lead that leaves under it
AROUND_DEG = 15.0  # between two azimuths that a ring's lead may leave at


def lead_exits(stack: DirectStack, bundle: Bundle, tie: TieSeat | None, free_azimuth: float) -> Iterator[LeadExit]:
    """By the channel of a bearing's sleeve; without a bearing under the tongue of the hub, else all around."""
    half, low = bundle.half, stack.ring_top
    aside = (2 * half + BUNDLE_GAP) * (bundle.number - (bundle.count - 1) / 2)
    if stack.bearing is not None:
        inner = stack.shaft_diameter / 2 + JOURNAL_WALL + half + BUNDLE_GAP
        yield LeadExit(tie, (_upwards(inner, aside, low, stack.shoulder + ABOVE_CAGE, free_azimuth),))
        return
    inner = stack.ring_bore / 2 + half + BUNDLE_GAP  # on the rotor of the ring
    if tie is not None:
        high = max(low + bundle.radius, tie.low - BELOW_HUB - half)
        yield LeadExit(tie, (_upwards(inner, aside, low, high, tie.azimuth),))
    around = np.radians(np.arange(0.0, 360.0, AROUND_DEG)).tolist()
    yield LeadExit(None, tuple(_upwards(inner, 0.0, low, low + bundle.radius, azimuth) for azimuth in around))


def _upwards(inner: float, aside: float, low: float, high: float, azimuth: float) -> tuple[Array, Array]:
    """Along the axis between two heights, then outwards at an azimuth [rad]."""
    return towards(np.array([[inner, aside, low], [inner, aside, high]]), azimuth)


def stator_exit(scanner: Scanner, stack: DirectStack, rear: float) -> StatorExit | None:
    """By the end of the stator to the face at a height behind the servo, or by its side.

    The side is a window of the cage, or between the arms of the adapter.
    """
    ring = scanner.slip_ring
    if ring is None or ring.stator_exit is None:
        return None
    if ring.stator_exit == "end":
        end = (np.array([0.0, 0.0, stack.ring_bottom]), np.array([0.0, 0.0, -1.0]))
        return StatorExit((end,), stack.ring_bottom - rear, stiff=False)
    z, start = stack.ring_bottom + STATOR_EXIT, stack.ring_radius + 0.2
    out_of = max(stack.ring_radius, 0.0 if stack.bearing is None else stack.cage_outer)
    places = tuple((np.array([0.0, side * start, z]), np.array([0.0, side, 0.0])) for side in (-1.0, 1.0))
    return StatorExit(places, out_of - start, stiff=True)
