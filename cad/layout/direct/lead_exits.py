"""Exits of the leads of a through-bore ring: rotor under the hub, stator at the servo. Rotation frame at gamma = 0, mm.

Rotation frame at gamma = 0, mm.
"""

from collections.abc import Iterator

import numpy as np

from scanwright.cad.layout.direct.cage import BearingCage, stator_leads_y
from scanwright.cad.layout.direct.stack import BELOW_HUB, DirectStack
from scanwright.cad.layout.drive import Bundle, LeadExit, StatorExit, towards
from scanwright.cad.layout.hub import BUNDLE_GAP
from scanwright.cad.layout.tie_seat import TieSeat
from scanwright.design.arrays import Array
from scanwright.design.scanner import Scanner

AROUND_DEG = 15.0  # between two azimuths that a ring's lead may leave at


def lead_exits(stack: DirectStack, bundle: Bundle, tie: TieSeat | None, free_azimuth: float) -> Iterator[LeadExit]:
    """Yield paths by the channel of a bearing's sleeve; without a bearing below the hub's tab, else all around."""
    half, low = bundle.half, stack.leads_low
    aside = (2 * half + BUNDLE_GAP) * (bundle.number - (bundle.count - 1) / 2)
    if stack.bearing is not None:
        yield tie, (_upwards(stack.leads_radius, aside, low, stack.leads_corner, free_azimuth),)
        return
    inner = stack.ring_bore / 2 + half + BUNDLE_GAP  # on the rotor of the ring
    if tie is not None:
        high = max(low + bundle.radius, tie.low - BELOW_HUB - half)
        yield tie, (_upwards(inner, aside, low, high, tie.azimuth),)
    around = np.radians(np.arange(0.0, 360.0, AROUND_DEG)).tolist()
    yield None, tuple(_upwards(inner, 0.0, low, low + bundle.radius, azimuth) for azimuth in around)


def _upwards(inner: float, aside: float, low: float, high: float, azimuth: float) -> tuple[Array, Array]:
    """Return a path along the axis between two heights, then outwards at an azimuth [rad]."""
    return towards(np.array([[inner, aside, low], [inner, aside, high]]), azimuth)


def stator_exit(scanner: Scanner, stack: DirectStack, cage: BearingCage | None) -> StatorExit:
    """Return the exit at the index side, next to flange and case, and through the base of a cage."""
    start = np.array([0.0, stator_leads_y(scanner, stack), stack.ring_bottom])
    return StatorExit(start, 0.0 if cage is None else stack.ring_bottom - cage.low, stiff=cage is not None)
