"""Ring cover: a tube around a slip ring, on the arms of its adapter or on the cage of a bearing; it keeps dust off.

Frame: rotation frame at gamma = 0, mm; its numbers are those of `cad/layout/modules/ring_cover.py`. It stands on its
lower rim when it is printed. Notches at +-y let the stator's leads out.
"""

from __future__ import annotations

from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.layout.joints import screws
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.modules.ring_cover import BESIDE, NOTCH_HALF, PAD_HALF, SCREW, RingCover, cover_of
from scanwright.cad.layout.names import RING_COVER
from scanwright.cad.parts.part_spec import PartSpec, Step
from scanwright.cad.solids import building
from scanwright.design.left_out import LeftOut

OUT_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # an outline's axes: along x, along z


def ring_cover_spec(layout: Layout) -> PartSpec | None:
    """The cover of one scanner; None without one."""
    p = cover_of(layout.scanner, layout.stack)
    if isinstance(p, LeftOut):
        return None
    words = (
        "Turn the head of the cable tie to the side of a notch. Lower the cover over the ring, its notches over the "
        f"stator's leads. {screws(p.onto)} The rotor's leads leave above its rim."
    )
    return PartSpec(
        name=RING_COVER,
        turns=False,
        make=partial(ring_cover, p),
        step=Step("Cover around the ring", words, "no lead is pinched under the rim, and the ring still turns freely"),
        shaped_by=("slip_ring.outer_diameter_mm", "slip_ring.length_mm"),
    )


def ring_cover(p: RingCover) -> cq.Solid:
    """Make the tube.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    with building(RING_COVER, "tube and pads", "radius", f"{p.inner:g} mm") as checked:
        tube = solids.upright(p.outer, p.low, p.high).cut(solids.upright(p.inner, p.low - 1.0, p.high + 1.0))
        body: cq.Shape = checked(tube)
        if p.flat:
            near, far = p.face + BESIDE, p.inner + 1.0
            pad = solids.box((near, -PAD_HALF, p.low), (far, PAD_HALF, p.screws + PAD_HALF))
            body = checked(body.fuse(*(pad.moved(solids.about_axis(azimuth)) for azimuth in p.azimuths)))
    with building(RING_COVER, "screw holes and notches", "radius", f"{p.inner:g} mm") as checked:
        cuts = []
        for azimuth in p.azimuths:
            cuts.append(solids.radial(p.hole / 2, azimuth, p.screws))
            cuts.append(solids.radial(SCREW.head_room, azimuth, p.screws, p.seat))
        notch = outlines.gable(NOTCH_HALF, p.low - 1.0, p.ridge)
        cuts.append(solids.prism(notch, -2 * p.outer, 2 * p.outer).moved(solids.location(OUT_Y)))
        return checked(body.cut(*cuts).clean())


def cover_threads(p: RingCover | LeftOut, part: str) -> list[cq.Solid]:
    """What the screws of a cover take from a part: their threads, if they end in it."""
    if isinstance(p, LeftOut) or p.onto != part:
        return []
    start = p.face - p.depth - 1.0
    return [solids.radial(SCREW.core / 2, azimuth, p.screws, start, p.depth + 2.0) for azimuth in p.azimuths]
