"""Servo frame: holds a servo by the threads in its front, if its rear has no usable ones.

Frame: rotation frame at gamma = 0 (`cad/layout/direct/frame.py`), mm. A plate with an opening around the horn, sides
along the case with a window for the servo's plug, and four feet with holes for the screws of deck or mount, and slots
for their nuts.
"""

import math
from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.layout.cables.obstacles import shape_of
from scanwright.cad.layout.direct.frame import (
    EAR_DEPTH,
    EAR_NUT,
    EAR_SCREW,
    FOOT,
    FOOT_REACH,
    FOOT_SCREW,
    GRIP,
    HEADER,
    LEAST_BRIDGE,
    NUT_PLAY,
    ServoFrame,
)
from scanwright.cad.layout.drive import Ears
from scanwright.cad.layout.envelope import box_corners
from scanwright.cad.layout.joints import front_joint, screws, upright_axes
from scanwright.cad.layout.names import SERVO, SERVO_CASE, SERVO_FRAME
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import ON_CASE, PartSpec, Step
from scanwright.cad.solids import building


def frame_spec(place: Placement) -> PartSpec | None:
    """Return the frame of one scanner; None if the servo's rear holds it."""
    frame, servo = place.drive.of(ServoFrame), place.scanner.servo
    if frame is None:
        return None
    heel = frame.heel_mm if len(frame.holes) == 2 else None
    nuts = ""
    if frame.ears is not None and frame.ears.thread is not None and frame.ears.thread.trap is not None:
        nuts = f"Push a nut {EAR_SCREW.name} into each of the four slots in the outer faces of the frame. "
    words = (
        f"{nuts}Push the servo into the frame from below, its horn through the opening. "
        f"{screws(SERVO_CASE)} Do not loosen the screws that close its case."
    )
    return PartSpec(
        name=SERVO_FRAME,
        turns=False,
        make=partial(servo_frame, frame),
        step=Step("Servo into its frame", words, "the horn turns freely in the opening", (SERVO,)),
        shaped_by=("servo.case_min_mm", "servo.cable_exit_mm", *ON_CASE),
        joints=(front_joint(servo, SERVO_FRAME, SERVO_CASE, upright_axes(frame.holes, frame.high, -1.0), GRIP, heel),),
        avoid=tuple(shape_of(box_corners(leg)) for leg in frame.legs()),
    )


def servo_frame(p: ServoFrame) -> cq.Solid:
    """Make the frame."""
    (y0, y1), (w0, w1), outer = p.ends_y, p.window_y, p.half_x + p.leg
    with building(SERVO_FRAME, "plate, sides and feet", "holes", p.holes) as checked:
        body: cq.Shape = solids.slab((-outer, y0, p.low), (outer, y1, p.high), outlines.NOTCH)
        feet = [solids.hull(p.feet_corners(*span)) for span in ((y0, w0), (w1, y1))]
        inside = solids.box((-p.half_x, y0 - 1.0, p.low - 1.0), (p.half_x, y1 + 1.0, p.plate))
        window = _window(p)
        body = checked(body.fuse(*feet).cut(inside, window).clean())
    with building(SERVO_FRAME, "opening and holes", "holes", p.holes) as checked:
        cuts: list[cq.Shape] = [solids.upright(p.opening, p.plate - 1.0, p.high + 1.0)]
        if y1 - p.opening < LEAST_BRIDGE:  # a plate that ends so close to the horn is open there
            cuts.append(solids.box((-p.opening, 0.0, p.plate - 1.0), (p.opening, y1 + 1.0, p.high + 1.0)))
        cuts += [solids.upright(p.hole / 2, p.plate - 1.0, p.high + 1.0, x, y) for x, y in p.holes]
        cuts += [solids.upright(p.foot_hole / 2, p.low - 1.0, p.low + FOOT + 1.0, x, y) for x, y in p.feet]
        half, inner = (FOOT_SCREW.nut_across + NUT_PLAY) / 2, FOOT_SCREW.nut_across / math.sqrt(3) + NUT_PLAY
        for x, y in p.feet:  # slots of the nuts
            ends = sorted((x - math.copysign(inner, x), math.copysign(p.reach_x + 1.0, x)))
            cuts.append(solids.box((ends[0], y - half, p.low + FOOT), (ends[1], y + half, p.low + FOOT + FOOT_REACH)))
        if p.ears is not None:
            cuts += _ear_holes(p, p.ears)
        return checked(body.cut(*cuts).clean())


def _window(p: ServoFrame) -> cq.Shape:
    """Return the window through both sides, open below."""
    (y0, y1), low, high, end = p.window_y, p.low - 1.0, p.plate - HEADER, p.reach_x + 1.0
    outline = [(y0, low), (y1, low), (y1, high), (y0, high)]
    along_x = solids.location(np.roll(np.eye(3), -1, axis=1))
    return solids.prism(outline, -end, end, (0.0, 0.0, outlines.NOTCH, outlines.NOTCH)).moved(along_x)


def _ear_holes(p: ServoFrame, ears: Ears) -> list[cq.Solid]:
    """Return the holes in the upper ends of the sides, with slots for nuts, inserted from outside."""
    assert ears.thread is not None  # printed
    hole, trap = ears.thread.hole / 2, ears.thread.trap
    cuts = [solids.upright(hole, p.high - EAR_DEPTH, p.high + 1.0, x, y) for x, y in ears.holes]
    if trap is not None:
        low, high = p.high - EAR_NUT - trap.depth, p.high - EAR_NUT
        for x, y in ears.holes:
            ends = sorted((math.copysign(abs(x) - trap.corner, x), math.copysign(p.half_x + p.leg + 1.0, x)))
            half = trap.across / 2
            cuts.append(solids.box((ends[0], y - half, low), (ends[1], y + half, high)))
    return cuts
