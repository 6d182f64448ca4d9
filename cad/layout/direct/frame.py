"""Numbers of the frame that holds a servo by the threads in its front. No kernel.

For servos whose rear has only case screws, such as the X series: the servo hangs from a plate on four legs, whose feet
are screwed to the deck or to the base mount. If the front has no holes for the base of a bearing's cage or for the
fork of a ring's adapter, they are screwed to the frame's thicker sides instead, so that the servo's own screws carry
the servo and its torque only; the sides hold the case against that torque as well.
"""

import math
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.drive import Ears
from scanwright.cad.layout.envelope import Box
from scanwright.cad.layout.joints import fixing_in
from scanwright.cad.layout.names import SERVO_FRAME
from scanwright.cad.screws import SCREWS, passing_hole, thread_in_part
from scanwright.design.arrays import Array
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

GRIP = 2.5  # of the plate, under the heads of the servo's screws
HORN_GAP = 0.5  # around the turning parts in the plate's opening
OVER_HEADS = 0.5  # between the heads and the parts that turn above them
GAP = 0.3  # around the case
LEG = 3.6  # stiff for all that a horn carries without a bearing: four hold it sideways with 0.5 N/um
EAR_LEG = 10.0  # with screws in its upper end: a nut M3 in a slot, and walls
EAR_SCREW = SCREWS["M3"]
EAR_DEPTH = 8.0  # of their holes
EAR_EDGE = 4.5  # from their middle to the end of a side: the nut's slot and a wall
EAR_NUT = 3.0  # of a side above the nut
WINDOW = 8.0  # half width of the opening between two legs, about the servo's plug
LEAST_LEG = 8.0
LEAST_BRIDGE = 3.0  # of the plate beyond its opening
HEADER = 8.0  # of a side above its window
FOOT = 4.0
FOOT_REACH = 9.0
NUT_PLAY = 0.4  # across the flats of a nut in its slot, which keeps it from turning
FOOT_SCREW = SCREWS["M3"]
SEAT_GAP = 0.3  # the feet carry, not the case


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoFrame:
    """Lengths in mm; x and y are those of the servo, z of the rotation frame."""

    low: float  # lower face of the feet
    plate: float  # lower face of the plate, on the front of the case
    opening: float  # radius around the axis
    leg: float  # thickness of the sides
    half_x: float  # of the space for the case
    ends_y: tuple[float, float]  # of legs and plate
    window_y: tuple[float, float]  # between the legs of a side
    hole: float  # diameter, of the servo's screws
    holes: tuple[tuple[float, float], ...]  # places of these screws
    feet: tuple[tuple[float, float], ...]  # places of the screws in the feet
    foot_hole: float  # diameter
    ears: Ears | None  # in the upper ends of the sides; None if nothing is screwed to them

    @property
    def high(self) -> float:
        """Upper face of the plate, which the heads bear on."""
        return self.plate + GRIP

    @property
    def reach_x(self) -> float:
        """Half width over the feet."""
        return self.half_x + self.leg + FOOT_REACH

    @property
    def heel_mm(self) -> float:
        """Distance of the servo's screws from the edge over which the servo tips off the plate."""
        y = sum(y for _, y in self.holes) / len(self.holes)
        return min(abs(end - y) for end in self.ends_y)

    def sides(self) -> Box:
        """Return the box around its sides with the plate."""
        side = self.half_x + self.leg
        return (-side, self.ends_y[0], self.low), (side, self.ends_y[1], self.high)

    def feet_corners(self, start: float, end: float) -> Array:
        """Return the corners of both feet between two y, shape (12, 3): they slope, so that they print without support.

        The frame is printed on its plate.
        """
        side, low = self.half_x + self.leg, self.low
        outline = (self.reach_x, low), (self.reach_x, low + FOOT), (side, low + FOOT + FOOT_REACH)
        return np.array([(sign * x, y, z) for sign in (-1.0, 1.0) for y in (start, end) for x, z in outline])

    def legs(self) -> list[tuple[tuple[float, float, float], tuple[float, float, float]]]:
        """Return the boxes of the four legs with their feet, as low and high corners."""
        spans = ((self.ends_y[0], self.window_y[0]), (self.window_y[1], self.ends_y[1]))
        return [
            (
                (min(side * self.half_x, side * self.reach_x), y0, self.low),
                (max(side * self.half_x, side * self.reach_x), y1, self.high),
            )
            for side in (1.0, -1.0)
            for y0, y1 in spans
        ]


def corner_holes(holes: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Return the four holes of the widest pair of columns that lie furthest apart along y; none if one is missing."""
    widest = max((x for x, _ in holes), default=0.0)
    ys = sorted(y for x, y in holes if x == widest)
    corners = (
        tuple((sign * widest, y) for sign, y in ((1, ys[-1]), (-1, ys[-1]), (-1, ys[0]), (1, ys[0]))) if ys else ()
    )
    return corners if len(set(corners)) == 4 and set(corners) <= set(holes) else ()


def needs_frame(servo: Servo) -> bool:
    """Return whether only the servo's front has holes that may carry it."""
    return not corner_holes(servo.rear.places) and len(servo.front.places) >= 2


def frame_ears(scanner: Scanner, opening: float, *, fork: bool) -> Ears:
    """Return the holes in the corners of a frame for a plate that leaves the heads of the servo's screws free.

    `opening` is the radius of the plate's opening, or the least half width of a fork's, which is as wide as the heads.
    """
    servo, printer = scanner.servo, scanner.printer
    head = SCREWS[servo.front.screw]
    if fork:
        opening = max(opening, max(abs(x) for x, _ in servo.front.places) + head.driver_radius)
    thread = thread_in_part(EAR_SCREW, printer, carries=True)
    half_x, front = _half_x(servo), servo.front.z_mm + GRIP
    rows_y = servo.case_min_mm[1] + EAR_EDGE, servo.case_max_mm[1] - EAR_EDGE
    return Ears(
        onto=SERVO_FRAME,
        front=front,
        seats=front,
        opening=opening,
        half_x=half_x + EAR_LEG,
        screw=EAR_SCREW,
        hole=passing_hole(EAR_SCREW, printer),
        holes=tuple((side * (half_x + EAR_LEG / 2), y) for y in rows_y for side in (-1.0, 1.0)),
        fixing=fixing_in(thread),
        thread_mm=EAR_DEPTH if thread.trap is None else EAR_NUT,
        thread=thread,
        covers=() if fork else tuple((x, y, head) for x, y in servo.front.places),
    )


def _half_x(servo: Servo) -> float:
    return max(-servo.case_min_mm[0], servo.case_max_mm[0]) + GAP


def frame_of(scanner: Scanner, stack: DirectStack, ears: Ears | None) -> ServoFrame:
    """Return the frame of one scanner whose servo needs one; `ears` is what is screwed to it.

    Raises:
        BuildError: the servo's screws come too close to its horn.
    """
    servo, printer = scanner.servo, scanner.printer
    hole = passing_hole(SCREWS[servo.front.screw], printer)
    turns = stack.foot_radius if ears is None else stack.flange_radius
    opening = max(servo.horn_diameter_mm / 2, turns) + HORN_GAP
    wall = min(math.hypot(x, y) for x, y in servo.front.places) - hole / 2 - opening
    if wall < printer.min_wall_mm:
        raise BuildError(
            f"{SERVO_FRAME}: plate: holes = {list(servo.front.places)} in front{servo.caution('holes')}: leave a "
            f"wall of {wall:.2f} mm next to the horn of {servo.name}, {printer.name} needs min_wall_mm = "
            f"{printer.min_wall_mm:g}"
        )
    (_, y0, z0), (_, y1, _) = servo.case_min_mm, servo.case_max_mm
    if y1 - y0 < 2 * (LEAST_LEG + WINDOW):
        raise BuildError(
            f"{SERVO_FRAME}: legs: case of {servo.name}: {y1 - y0:g} mm along y (needs {2 * (LEAST_LEG + WINDOW):g})"
        )
    half_x, leg = _half_x(servo), LEG if ears is None else EAR_LEG
    exit_y = (y0 + y1) / 2 if servo.cable_exit_mm is None else servo.cable_exit_mm[1]
    middle = min(max(exit_y, y0 + LEAST_LEG + WINDOW), y1 - LEAST_LEG - WINDOW)
    window = middle - WINDOW, middle + WINDOW
    out, back, front = half_x + leg + FOOT_REACH / 2, (y0 + window[0]) / 2, (window[1] + y1) / 2
    return ServoFrame(
        low=stack.horn + z0 - SEAT_GAP,
        plate=stack.horn + servo.front.z_mm,
        opening=opening,
        leg=leg,
        half_x=half_x,
        ends_y=(y0, y1),
        window_y=window,
        hole=hole,
        holes=servo.front.places,
        feet=((out, front), (-out, front), (-out, back), (out, back)),
        foot_hole=passing_hole(FOOT_SCREW, printer),
        ears=ears,
    )
