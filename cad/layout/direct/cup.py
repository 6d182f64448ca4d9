"""The printed shaft of a scanner without ring and bearing. No kernel.

A cup around the heads of the horn's screws, low and wide: a cup of 30 mm with a bore of 20 bends no more than an
aluminium rod of 12. Nuts in slots of its wall hold the hub.
"""

import math

from scanwright.cad.layout.direct.frame import GRIP, OVER_HEADS, needs_frame
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.envelope import Envelope, hub_height, rows_of
from scanwright.cad.layout.hub import CrossScrew
from scanwright.cad.layout.joints import LENGTHS, THREAD_FREE
from scanwright.cad.screws import SCREWS, passing_hole, thread_in_part
from scanwright.design.arrays import Array
from scanwright.design.catalogue.servo import Servo
from scanwright.design.scanner import Scanner

INSERT_WALL = 7.0  # of a cup around an insert
BEHIND_NUT = 1.2  # wall of a cup inside a nut
FLOOR = 4.0  # on the horn
ROUND_HOLE = 0.05  # loss of wall by the facets of a hole
FLOOR_ON_FOOT = 3.0  # over the foot of a cup on a servo frame
OVER_BOSS = 2.0  # of the horn: clearance, and a printable floor


def cup_stack(scanner: Scanner, envelope: Envelope, R: Array, cross: CrossScrew) -> DirectStack:
    """Lay out the stack of one scanner without a ring and a bearing; R is the laser in the rotation frame, (3, 3)."""
    servo, screw, printer = scanner.servo, cross.screw, scanner.printer
    floor = max(FLOOR, servo.horn_boss_height_mm + OVER_BOSS)
    bore = servo.horn_circle_mm + 2 * SCREWS[servo.horn_screw].driver_radius
    trap = thread_in_part(screw, printer, carries=True).trap
    wall = INSERT_WALL if trap is None else cross.before_nut + trap.depth + BEHIND_NUT
    diameter = math.ceil(2 * (bore + 2 * wall)) / 2
    hub_radius = flange = diameter / 2 + cross.cup_wall
    foot, foot_height, grip = 0.0, 0.0, 0.0
    if needs_frame(servo):  # it must widen above the heads of the frame's screws
        foot = (servo.horn_circle_mm + passing_hole(SCREWS[servo.horn_screw], scanner.printer)) / 2
        foot += scanner.printer.min_wall_mm + ROUND_HOLE
        # over the horn's face: the heads of the frame's screws, with clearance
        foot_height = servo.front.z_mm + GRIP + SCREWS[servo.front.screw].head_height + OVER_HEADS
        flange = diameter / 2
        wall = SCREWS[servo.horn_screw].driver_radius + scanner.printer.min_wall_mm  # around the heads in the cone
        grip = _grip(servo, max(floor, foot_height + max(FLOOR_ON_FOOT, wall)))
        floor = max(grip, foot_height + flange - foot)  # a cone of 45 deg needs no support
    return DirectStack(
        h=hub_height(envelope, R, hub_radius, cross=cross),
        R_rot_laser=rows_of(R),
        ring_length=0.0,
        ring_radius=0.0,
        ring_bore=0.0,
        shaft_diameter=diameter,
        cross_screw=cross,
        hub_wall=cross.cup_wall,
        flange_radius=flange,
        flange_thickness=floor,
        collar_radius=servo.horn_circle_mm / 2,
        collar_height=floor,
        waist_length=0.0,
        waist_diameter=diameter,
        bearing=None,
        sub_plate=None,
        cup_bore=bore,
        foot_radius=foot,
        foot_height=foot_height,
        grip=grip,
    )


def _grip(servo: Servo, least: float) -> float:
    """Return the thickness, at least `least`, at which a screw of a standard length fills the horn's thread."""
    deep = servo.horn_thread_depth_mm - THREAD_FREE
    lengths = LENGTHS[servo.horn_screw]
    return max(least, next((length for length in lengths if length >= least + deep), lengths[-1]) - deep)
