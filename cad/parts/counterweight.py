"""Counterweight: a piece of steel bar on the ear of the linkage's hub, with two threads (`cad/balance/`).

Frame: rotation frame at gamma = 0, mm. It lies along a radius; its screws come from below, through slots of the ear.
"""

from __future__ import annotations

import cadquery as cq

from cad import solids
from cad.layout.balance import PART, SCREW, Counterweight
from cad.solids import building, checked


def counterweight(p: Counterweight) -> cq.Solid:
    """Make the bar.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    half, low, high = p.section[0] / 2, p.ear.high, p.ear.high + p.section[1]
    with building(PART, "bar and threads", "length", f"{p.length:g} mm"):
        bar: cq.Shape = solids.box((p.start, -half, low), (p.end, half, high))
        threads = [solids.upright(SCREW.core / 2, low - 1.0, high + 1.0, at, 0.0) for at in p.screws]
        bar = checked(bar.cut(*threads), PART, "bar and threads", "length", f"{p.length:g} mm")
    return bar.moved(solids.about_axis(p.ear.azimuth))
