"""How the servo turns the shaft, as data: what a layout is made of, what stands where, and in which order it is built.

Rotation frame at gamma = 0, mm. `cad/layout/direct/drive.py` and `cad/layout/belt/drive.py` fill it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.joints import Fixing
from scanwright.cad.screws import Screw
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Bearing, Belt
from scanwright.design.left_out import LeftOut

Stack = DirectStack | BeltStack
Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Cuboid:
    """A box along the axes between two corners."""

    low: Point
    high: Point


@dataclass(frozen=True, slots=True)
class Rod:
    """A cylinder about the rotation axis."""

    radius: float
    low: float
    high: float

    def cuboid(self) -> Cuboid:
        """The box around it."""
        r = self.radius
        return Cuboid((-r, -r, self.low), (r, r, self.high))


@dataclass(frozen=True, slots=True)
class Mass:
    """What a bought product of a name weighs, as a homogeneous box; `turning` is the share of it that turns."""

    product: str
    mass_g: float
    box: Cuboid
    turning: float = 0.0


@dataclass(frozen=True, slots=True)
class Need:
    """A small thing that is bought for a drive.

    Attributes:
        kind: row of the parts list.
        estimate: name of its price in `cad.files.prices`.
        part: what it is, with its size.
        source: of the row.
    """

    kind: Literal["wiring", "consumable"]
    estimate: str
    part: str
    source: str


@dataclass(frozen=True, slots=True)
class Mounted:
    """What a base mount holds: the servo's case, or a tower, above the mount's rails.

    Attributes:
        onto: body that its screws end in.
        rear: height of its face towards the mount.
        ears: height of the faces around its holes.
        screw: that goes through the mount into them.
        holes: x and y of the four.
        corners: of boxes around all that stands still, shape (n, 3).
        fixing: what the screws hold in: a nut behind the holes, or their thread.
        ear_mm: of material before the nut, or of thread.
        discs: radius and height of what else must stay clear of the deck, round about the axis.
        stands_alone: whether it may stand on a flat deck without a mount where the axis is upright.
    """

    onto: str
    rear: float
    ears: float
    screw: Screw
    holes: tuple[tuple[float, float], ...]
    fixing: Fixing
    ear_mm: float
    corners: Array
    discs: tuple[tuple[float, float], ...]
    stands_alone: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveLayout:
    """One layout of one scanner.

    Attributes:
        stack: every number along the axis.
        shaft: the part that carries the linkage.
        products: what is bought beside lidar, servo and ring, as often as it is needed.
        mounted: what the base mount holds.
        masses: of the bought products between mount and linkage.
        shapes: simple bodies that stand still.
        built: parts and products in the order in which they are put in.
        stacked: parts and products from the deck to the linkage, in which the exploded view lifts them.
        left_out: parts that this scanner does not need.
        borne: parts that another one keeps along the axis without a screw, by a bearing or a retaining ring.
        needs: small things that are bought for it.
    """

    stack: Stack
    shaft: str
    products: tuple[Bearing | Belt, ...]
    mounted: Mounted
    masses: tuple[Mass, ...]
    shapes: tuple[Cuboid | Rod, ...]
    built: tuple[str, ...]
    stacked: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    needs: tuple[Need, ...]
    borne: tuple[tuple[str, str], ...] = ()
