"""Every number of the homing flag: a vane of the linkage, and a bracket for the optical switch that it passes.

The vane is a piece of a tube about the axis at the end of an arm of the hub, the only thing that turns below the plane
of the hub's lower face; the slot of the switch is open upwards, so that it comes down into it with the linkage. The
bracket stands on the cage of a bearing or on an arm of the ring's adapter and carries next to nothing: its two screws
may end in plastic. Rotation frame at gamma = 0, mm and rad. No kernel: plain numpy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout import names
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.direct.adapter import ARM, PLAY, adapter_of, arm_top
from scanwright.cad.layout.direct.cage import cage_of
from scanwright.cad.layout.drive import Cuboid, Stack
from scanwright.cad.layout.joints import Joint, inward_axes, round_wall_mm, upright_axes
from scanwright.cad.layout.modules.unasked import unasked
from scanwright.cad.screws import SCREWS, passing_hole
from scanwright.design.catalogue.products import SlotSwitch
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

SCREW = SCREWS["M3"]  # of the bracket
VANE = 2.0  # thickness
VANE_HALF = 5.0  # width, half of it
PAST_BEAM = 1.5  # how far the vane reaches below the light
OVER = 1.5  # between the switch and the arm
ARM_HIGH, ARM_HALF = 5.0, 4.0
COLUMN, COLUMN_HALF = 6.0, 8.0  # thickness and half width of the bracket's foot
SHELF = 5.0
BEFORE_FLANGE = 2.0  # between the foot of the bracket and the flange: a screw's head
SLIDE = 2.0  # of each screw of the switch to both sides: no drawing of its holes was at hand
BESIDE = 0.2  # between the bracket and what it stands on
LEAST_APART = 10.0  # of the bracket's two screws
TIE_HALF = 3.0  # of the groove of the adapter's cable tie
UNDER_ROOF = (6.0, 18.0)  # of the screws in a leg of a cage
ASK_DEG = 5.0  # azimuths of the arm are tried in such steps


@dataclass(frozen=True, slots=True)
class Flag:
    """Arm and vane of the linkage's hub.

    Attributes:
        azimuth: of both [rad].
        radius: of the vane's middle.
        low: height of its lower edge.
        base: height of the arm's lower face.
    """

    azimuth: float
    radius: float
    low: float
    base: float


@dataclass(frozen=True, slots=True)
class HomingBracket:
    """The bracket, and where the switch stands on it.

    Attributes:
        onto: part that its screws end in.
        switch: that it carries.
        azimuth: of all of it [rad].
        radius: of the middle of the slot.
        seat: height of the switch's base.
        face: distance from the axis of what it stands on.
        flat: whether that is flat, not round.
        heights: of its two screws.
        depth: of their threads.
        hole: diameter that they pass.
        switch_hole: likewise, of the switch's screws.
    """

    onto: str
    switch: SlotSwitch
    azimuth: float
    radius: float
    seat: float
    face: float
    flat: bool
    heights: tuple[float, float]
    depth: float
    hole: float
    switch_hole: float

    @property
    def outer(self) -> float:
        """Distance from the axis of its outer end."""
        return self.radius + self.switch.hole_pitch_mm / 2 + SLIDE + self.switch_hole / 2 + 3.0

    @property
    def low(self) -> float:
        """Height of its lower end."""
        return min(self.heights) - 5.0

    @property
    def top(self) -> float:
        """Height of the upper end of the switch."""
        return self.seat + self.switch.body_mm[2]

    def switch_room(self) -> Cuboid:
        """The box along the axes around the fork of the switch, about as it stands."""
        x, y = self.radius * math.cos(self.azimuth), self.radius * math.sin(self.azimuth)
        half = self.switch.body_mm[0] / 2
        return Cuboid((x - half, y - half, self.seat), (x + half, y + half, self.top))


def bracket_of(scanner: Scanner, stack: Stack) -> HomingBracket | LeftOut:
    """The bracket of one scanner, or why there is none.

    Raises:
        BuildError: the case of the servo has no holes for what would hold it.
    """
    switch = scanner.switch
    if not scanner.modules.homing_flag or switch is None:
        return unasked(names.HOMING_FLAG)
    if isinstance(stack, BeltStack):
        return _left_out("the tower around the capsule has no place for its bracket")
    if scanner.modules.ring_cover:
        return _left_out("the ring cover stands where its bracket would")
    cage = cage_of(scanner, stack)
    if cage is None and scanner.slip_ring is None:
        return _left_out("neither ring nor bearing needs anything beside the shaft that its bracket could stand on")
    if cage is not None:
        onto, azimuth, face, flat = names.BEARING_CAGE, math.pi / 4, stack.cage_outer, False
        near, far = UNDER_ROOF
        heights = stack.cage_roof - far, stack.cage_roof - near
        depth = round_wall_mm(stack.cage_inner, stack.cage_outer, SCREW.core)
        free = heights[0] - cage.high
    else:
        adapter = adapter_of(scanner, stack)
        onto, azimuth, face, flat = names.SLIP_RING_ADAPTER, 0.0, stack.ring_radius + PLAY + ARM, True
        high = arm_top(stack, adapter)
        tie = (stack.ring_bottom + high) / 2
        heights = (stack.ring_bottom + tie - TIE_HALF) / 2, (tie + TIE_HALF + high) / 2
        depth = face - math.sqrt((stack.ring_radius + PLAY) ** 2 - (SCREW.core / 2) ** 2)
        free = SCREW.nominal
    if heights[1] - heights[0] < LEAST_APART or free < SCREW.nominal:
        return _left_out("the slip ring is too short for the two screws of its bracket")
    return HomingBracket(
        onto=onto,
        switch=switch,
        azimuth=azimuth,
        radius=math.ceil(face + BESIDE + COLUMN + BEFORE_FLANGE + switch.flange_mm[0] / 2),
        seat=min(stack.shoulder - OVER, stack.ring_top if cage is None else stack.cage_top) - switch.body_mm[2],
        face=face,
        flat=flat,
        heights=heights,
        depth=depth,
        hole=passing_hole(SCREW, scanner.printer),
        switch_hole=passing_hole(SCREWS[switch.screw], scanner.printer),
    )


def flag_of(p: HomingBracket | LeftOut, stack: Stack, taken: tuple[float, ...]) -> Flag | None:
    """The flag that passes a bracket's switch, as far as can be from what the hub has all around (azimuths, rad)."""
    if isinstance(p, LeftOut):
        return None
    azimuths = np.radians(np.arange(0.0, 360.0, ASK_DEG))
    apart = np.abs((azimuths[:, None] - np.array(taken) + math.pi) % (2 * math.pi) - math.pi).min(axis=1)
    return Flag(
        azimuth=float(azimuths[int(np.argmax(np.round(apart, 6)))]),
        radius=p.radius,
        low=p.seat + p.switch.beam_height_mm - PAST_BEAM,
        base=stack.shoulder,
    )


def passes_at_deg(p: HomingBracket, flag: Flag) -> float:
    """Angle of the servo from where the index marks meet at which the vane's middle is in the light, -180 to 180."""
    return (math.degrees(p.azimuth - flag.azimuth) + 180.0) % 360.0 - 180.0


def vane_half_deg(flag: Flag) -> float:
    """Half of the angle over which the vane darkens the light."""
    return math.degrees(math.asin(VANE_HALF / flag.radius))


def homing_joints(p: HomingBracket) -> list[Joint]:
    """The bracket on what it stands on, and the switch on the bracket, where it slides."""
    half = p.switch.hole_pitch_mm / 2
    out = np.array([math.cos(p.azimuth), math.sin(p.azimuth)])
    heads = p.face + BESIDE + COLUMN
    start = [((p.radius + side * half) * out).tolist() for side in (1.0, -1.0)]
    return [
        Joint(
            names.HOMING_BRACKET,
            p.onto,
            "thread",
            SCREW,
            tuple(axis for z in p.heights for axis in inward_axes((p.azimuth,), heads, z)),
            grip_mm=COLUMN if p.flat else round_wall_mm(p.face + BESIDE, heads, p.hole),
            thread_mm=p.depth,
        ),
        Joint(
            names.HOMING_BRACKET,
            names.SWITCH_BODY,
            "nut",
            SCREWS[p.switch.screw],
            upright_axes(start, p.seat - SHELF, 1.0),
            grip_mm=SHELF,
            thread_mm=p.switch.flange_mm[2],
            slot_mm=(p.switch_hole, 2 * SLIDE + p.switch_hole),
        ),
    ]


def _left_out(why: str) -> LeftOut:
    return LeftOut(names.HOMING_FLAG, why, 1, "parts")
