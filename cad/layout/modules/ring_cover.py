"""Every number of the cover around a slip ring with a bore. No kernel: plain numpy.

A tube that comes down over the arms of the ring's adapter, or over the cage of a bearing, whose windows show the ring.
It carries nothing, so its two screws may end in plastic. It stands still, below the ring's top. Rotation frame, mm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scanwright.cad.layout import names
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.direct.adapter import ARM, ARM_HALF_WIDTH, PLATE, PLAY, adapter_of, arm_top
from scanwright.cad.layout.direct.cage import SEAT_GAP, cage_of
from scanwright.cad.layout.direct.stack import STATOR_EXIT
from scanwright.cad.layout.drive import Stack
from scanwright.cad.layout.joints import Joint, inward_axes, round_wall_mm
from scanwright.cad.layout.modules.unasked import unasked
from scanwright.cad.screws import SCREWS, passing_hole
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

SCREW = SCREWS["M3"]
WALL = 2.4
SUNK = 0.8  # of the screws' heads
BESIDE = 0.4  # between the tube and what it comes over
ABOVE = 0.5  # what it stands on
PAD_HALF = 5.0  # of what fills the gap between the tube and a flat arm, around a screw
GROOVE_HALF = 3.0  # of the adapter's cable tie
NOTCH_HALF, NOTCH_HIGH = 7.0, 12.0  # for the stator's leads: at least so high
RIDGE = 6.0  # of a notch, over the middle of the leads that leave by it


@dataclass(frozen=True, slots=True)
class RingCover:
    """One tube.

    Attributes:
        onto: part that its screws end in.
        inner: radius.
        low: height of its lower rim.
        high: of its upper rim.
        ridge: of the notches that its lower rim has at +-y.
        screws: height of its two screws.
        azimuths: of these [rad].
        hole: diameter that they pass.
        face: distance from the axis of what they end in.
        depth: of their threads.
        flat: whether that is flat, not round.
    """

    onto: str
    inner: float
    low: float
    high: float
    ridge: float
    screws: float
    azimuths: tuple[float, float]
    hole: float
    face: float
    depth: float
    flat: bool

    @property
    def outer(self) -> float:
        """Radius."""
        return self.inner + WALL

    @property
    def seat(self) -> float:
        """Distance from the axis of the faces that the heads bear on."""
        return self.outer - SUNK

    @property
    def wall(self) -> float:
        """What a screw passes."""
        if self.flat:
            return self.seat - self.face - BESIDE
        return round_wall_mm(self.inner, self.seat, self.hole)


def cover_of(scanner: Scanner, stack: Stack) -> RingCover | LeftOut:
    """The cover of one scanner, or why there is none.

    Raises:
        BuildError: the case of the servo has no holes for what would hold it.
    """
    if not scanner.modules.ring_cover:
        return unasked(names.RING_COVER)
    if isinstance(stack, BeltStack):
        return LeftOut(names.RING_COVER, "the tower is around the ring", 1, "parts")
    if scanner.slip_ring is None:
        return LeftOut(names.RING_COVER, "this scanner has no slip ring", 1, "parts")
    hole, cage = passing_hole(SCREW, scanner.printer), cage_of(scanner, stack)
    over_leads = stack.ring_bottom + STATOR_EXIT + RIDGE
    if cage is not None:
        low, high = cage.high + ABOVE, stack.cage_roof
        return RingCover(
            onto=names.BEARING_CAGE,
            inner=stack.cage_outer + BESIDE,
            low=low,
            high=high,
            ridge=max(low + NOTCH_HIGH, over_leads),
            screws=(low + high) / 2,
            azimuths=(math.pi / 4, 5 * math.pi / 4),
            hole=hole,
            face=stack.cage_outer,
            depth=round_wall_mm(stack.cage_inner, stack.cage_outer, SCREW.core),
            flat=False,
        )
    adapter = adapter_of(scanner, stack)
    outer, low = stack.ring_radius + PLAY + ARM, adapter.front + SEAT_GAP + PLATE
    tie = (stack.ring_bottom + arm_top(stack, adapter)) / 2
    return RingCover(
        onto=names.SLIP_RING_ADAPTER,
        inner=math.hypot(outer, ARM_HALF_WIDTH) + BESIDE,
        low=low + ABOVE,
        high=stack.ring_top,
        ridge=max(low + ABOVE + NOTCH_HIGH, over_leads),
        screws=(stack.ring_bottom + tie - GROOVE_HALF) / 2,
        azimuths=(0.0, math.pi),
        hole=hole,
        face=outer,
        depth=outer - math.sqrt((stack.ring_radius + PLAY) ** 2 - (SCREW.core / 2) ** 2),
        flat=True,
    )


def cover_joint(p: RingCover) -> Joint:
    """Its two screws."""
    return Joint(
        names.RING_COVER,
        p.onto,
        "thread",
        SCREW,
        inward_axes(p.azimuths, p.seat, p.screws),
        grip_mm=p.wall,
        thread_mm=p.depth,
    )
