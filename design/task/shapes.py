"""Regions of the sphere, of planes around the scanner, and of a scene, in a task file.

Files contain degrees, and metres for planes and meshes; every key with a unit ends in it.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field, Strict, field_validator, model_validator

from scanwright.design.arrays import Rotation
from scanwright.design.files.record import Record
from scanwright.design.frames import Rx, Ry, Rz
from scanwright.design.scene.posture import AS_IT_IS, Posture

Number = Annotated[float, Strict()]
"""An int or a float of the file; text and booleans are not accepted."""

Span = tuple[Number, Number]
Triple = tuple[Number, Number, Number]
Value = Annotated[Number, Field(ge=0, le=1e300, description="weight of the region; 0 excludes it")]


def _divides_the_half_circle(step: float) -> float:
    if abs(180 / step - round(180 / step)) > 1e-9:
        raise ValueError("the grid reaches theta = 180 only with a step that divides 180")
    return step


LEAST_M, MOST_M = 1e-3, 1e4
Length = Annotated[Number, Field(ge=LEAST_M, le=MOST_M)]
Far = Annotated[Number, Field(ge=-1e4, le=1e4)]
Turn = Annotated[Number, Field(ge=-360, le=360)]
Heading = Annotated[Number, Field(ge=-720, le=720)]
THINNEST_DEG = 1e-3
STRIPS = 20_000  # of the area of a plane, to integrate the part in range
LITTLE = 1e-3  # share of a plane out of range that is not reported
HEADINGS = {0.0: " ahead", 90.0: " to the left", 180.0: " behind", 270.0: " to the right"}

GridStep = Annotated[Number, Field(ge=0.25, le=10), AfterValidator(_divides_the_half_circle)]
Required = Annotated[Number | None, Field(gt=0, description="beams per ball, for objective = 'required'")]


class AllRegion(Record):
    """Every direction."""

    shape: Literal["all"] = Field(description="every direction")
    value: Value = 1.0
    required: Required = None


class BandRegion(Record):
    """theta from the world's z axis, phi from its x axis; edges inclusive, phi wraps."""

    shape: Literal["band"] = Field(description="between two heights and two headings")
    theta_deg: Span = Field(default=(0.0, 180.0), description="from straight up: 0 is up, 90 level, 180 down")
    phi_deg: tuple[Heading, Heading] = Field(
        default=(-180.0, 180.0), description="from ahead towards the left: 0 is ahead, 90 left"
    )
    value: Value = 1.0
    required: Required = None

    def words(self) -> str:
        """Return its description."""
        up, down = (90 - theta_deg for theta_deg in self.theta_deg)
        around = (
            "all around"
            if self.phi_deg == (-180.0, 180.0)
            else f"heading {self.phi_deg[0]:g} to {self.phi_deg[1]:g} deg"
        )
        return f"the band {around}, elevation {down:g} to {up:g} deg"

    @model_validator(mode="after")
    def _edges_rise(self) -> BandRegion:
        if not 0 <= self.theta_deg[0] <= self.theta_deg[1] <= 180:
            raise ValueError(f"theta_deg = {list(self.theta_deg)} does not rise within 0 .. 180")
        if not 0 <= round(self.phi_deg[1] - self.phi_deg[0], 9) <= 360:  # [a, a + 360] is rounded
            raise ValueError(f"phi_deg = {list(self.phi_deg)} does not rise by at most 360")
        for name, (low, high) in (("theta_deg", self.theta_deg), ("phi_deg", self.phi_deg)):
            if high - low < THINNEST_DEG:
                raise ValueError(
                    f"{name} = {[low, high]} is too narrow: {THINNEST_DEG:g} deg or more "
                    "are needed; its lengths are in metres"
                )
        return self


class ConeRegion(Record):
    """Directions within `half_angle_deg` of `axis` (world frame; its length does not matter)."""

    shape: Literal["cone"] = Field(description="around one direction")
    axis: tuple[Number, Number, Number] = Field(description="its centre: x ahead, y left, z up; of any length")
    half_angle_deg: Number = Field(ge=1e-3, le=180, description="from its centre to its edge")
    value: Value = 1.0
    required: Required = None

    @field_validator("axis")
    @classmethod
    def _has_a_direction(cls, axis: tuple[float, float, float]) -> tuple[float, float, float]:
        longest = max(abs(x) for x in axis)
        if longest == 0:
            raise ValueError("an axis of length zero has no direction")
        if not 1e-100 < longest < 1e100:
            raise ValueError("an axis of such length has no direction that can be computed: scale it")
        return axis


class MapRegion(Record):
    """A picture or table of weights: rows theta 0..180, columns phi 0..360, cell centres; PNG value / 255 (grey).

    A .npy or .csv table is used unchanged. `value` scales it.
    """

    shape: Literal["map"] = Field(description="weights in a picture or a table")
    file: str = Field(description=".png, .csv or .npy, next to the task: rows theta 0 .. 180, columns phi 0 .. 360")
    value: Value = 1.0
    required: Required = None


class Placed(Record):
    """A mesh, and the scanner's optical centre and the world's axes in it (roll, pitch, yaw; z last)."""

    most_m: ClassVar[float] = 5000.0  # larger meshes need an explicit unit_m
    file: str = Field(description=".stl, .ply, .obj, .dae or .glb, next to the task")
    unit_m: Number = Field(default=1.0, gt=0, description="length of one unit of the file")
    sensor_m: Triple = Field(default=(0.0, 0.0, 0.0), description="the optical centre in the mesh: x, y, z")
    rpy_deg: tuple[Turn, Turn, Turn] = Field(
        default=(0.0, 0.0, 0.0), description="axes of the world in the mesh: roll, pitch, yaw"
    )
    step_deg: GridStep = Field(default=2.0, description="between the rays")

    @property
    def posture(self) -> Posture:
        """The posture of the robot of a URDF."""
        return AS_IT_IS

    def R_mesh_world(self) -> Rotation:
        """Return the axes of the world in the mesh, shape (3, 3)."""
        roll, pitch, yaw = np.radians(self.rpy_deg)
        return Rz(yaw) @ Ry(pitch) @ Rx(roll)


class MeshRegion(Placed):
    """Every direction in which a mesh, such as the robot, is hit."""

    most_m: ClassVar[float] = 50.0
    shape: Literal["mesh"] = Field(description="directions of a mesh, such as the robot itself; also a .urdf")
    value: Value = 1.0
    joint_deg: dict[str, Number] = Field(default={}, description="of a URDF: joint = angle, 0 for the others")
    joint_mm: dict[str, Number] = Field(default={}, description="of a URDF: sliding joint = length, 0 for the others")
    frame: str = Field(default="", description="of a URDF: link that sensor_m and rpy_deg are about, else the root")
    omit: tuple[str, ...] = Field(default=(), description="of a URDF: links without geometry, such as the scanner's")

    @property
    def posture(self) -> Posture:
        """The posture of the robot of a URDF."""
        return Posture(self.joint_deg, self.joint_mm, self.frame, self.omit)


class BoxRegion(Record):
    """Surfaces of the scene within a box of its frame. Every square metre counts the same."""

    shape: Literal["box"] = Field(description="surfaces of the [scene] inside a box")
    min_m: Triple = Field(description="its lowest corner, in the frame of the scene's mesh")
    max_m: Triple = Field(description="its highest corner, in the frame of the scene's mesh")
    value: Value = 1.0
    required: Required = None

    @model_validator(mode="after")
    def _edges_rise(self) -> BoxRegion:
        if not all(low < high for low, high in zip(self.min_m, self.max_m, strict=True)):
            raise ValueError(f"min_m = {list(self.min_m)} is not below max_m = {list(self.max_m)}")
        return self


Pairs = tuple[tuple[str, str], ...]


class OnPlane(Record):
    """A rectangle on a plane near the scanner, in metres: all directions in which its optical centre sees it.

    The world's axes: x ahead, y to the left, z up. Every direction has the same weight, so the near part, which fills
    more of the view, has a higher weight per square metre.
    """

    _rising: ClassVar[Pairs]  # fields: the first of each pair must be below the second
    heading_deg: Number = Field(default=0.0, ge=-360, le=360, description="direction: 0 is ahead, 90 left")
    height_m: Length = Field(description="height of the scanner's optical centre above the ground")
    value: Value = 1.0
    required: Required = None

    def corners_m(self) -> tuple[Triple, Triple, Triple, Triple]:
        """Return its corners from the optical centre, in order around it."""
        turn = math.radians(self.heading_deg)
        a, b, c, d = (
            (x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn), z)
            for x, y, z in self._ahead_m()
        )
        return a, b, c, d

    def share_beyond(self, reach_m: float) -> float:
        """Return the share of its area that is farther from the optical centre than `reach_m`."""
        corners = np.array(self.corners_m())
        sides_m = corners[[1, 3]] - corners[0]
        a_m, b_m = np.linalg.norm(sides_m, axis=1)
        x_m, y_m = -corners[0] @ sides_m.T / (a_m, b_m)  # of the foot of the optical centre, from the first corner
        squared_m2 = reach_m**2 - corners[0] @ corners[0] + x_m**2 + y_m**2
        if not squared_m2 > 0:
            return 1.0
        along_m = (np.arange(STRIPS) + 0.5) * a_m / STRIPS - x_m
        half_m = np.sqrt(np.maximum(squared_m2 - along_m**2, 0.0))
        strips_m = np.clip(y_m + half_m, 0, b_m) - np.clip(y_m - half_m, 0, b_m)
        return max(0.0, float(1 - strips_m.mean() / b_m))

    def words(self) -> str:
        """Return its description."""
        return f"{self._named()}{HEADINGS.get(self.heading_deg % 360, f' at {self.heading_deg:g} deg')}"

    @abstractmethod
    def _ahead_m(self) -> tuple[Triple, Triple, Triple, Triple]:
        """Return the corners at heading 0."""

    @abstractmethod
    def _named(self) -> str:
        """Return its description without the heading."""

    @model_validator(mode="after")
    def _can_be_aimed_at(self) -> OnPlane:
        for low, high in self._rising:
            if not getattr(self, low) < getattr(self, high):
                raise ValueError(f"{high} = {getattr(self, high):g} is not above {low} = {getattr(self, low):g}")
        a, b, c, d = self.corners_m()
        seen_deg = min(_between_deg(_sum(a, b), _sum(c, d)), _between_deg(_sum(b, c), _sum(d, a)))
        if seen_deg < THINNEST_DEG:
            raise ValueError(
                f"from there it looks {seen_deg:.1g} deg thin: {THINNEST_DEG:g} deg or more "
                "are needed; its lengths are in metres"
            )
        return self


class GroundRegion(OnPlane):
    """A rectangle of level ground, in metres from below the scanner."""

    _rising: ClassVar[Pairs] = (("from_m", "to_m"),)
    shape: Literal["ground"] = Field(description="level ground, in metres")
    from_m: Far = Field(description="its near end; negative is behind")
    to_m: Far = Field(description="its far end")
    width_m: Length = Field(description="its width, half of it to each side")

    def _ahead_m(self) -> tuple[Triple, Triple, Triple, Triple]:
        return _level(self.from_m, self.to_m, self.width_m, -self.height_m)

    def _named(self) -> str:
        return f"ground {self.from_m:g} to {self.to_m:g} m"


class CeilingRegion(OnPlane):
    """A rectangle of a level ceiling, in metres from above the scanner."""

    _rising: ClassVar[Pairs] = ("height_m", "ceiling_m"), ("from_m", "to_m")
    shape: Literal["ceiling"] = Field(description="a level ceiling, in metres")
    ceiling_m: Length = Field(default=2.5, description="its height above the ground")
    from_m: Far = Field(default=-2.0, description="its near end; negative is behind")
    to_m: Far = Field(default=2.0, description="its far end")
    width_m: Length = Field(default=4.0, description="its width, half of it to each side")

    def _ahead_m(self) -> tuple[Triple, Triple, Triple, Triple]:
        return _level(self.from_m, self.to_m, self.width_m, self.ceiling_m - self.height_m)

    def _named(self) -> str:
        return f"ceiling at {self.ceiling_m:g} m, {self.from_m:g} to {self.to_m:g} m"


class WallRegion(OnPlane):
    """A rectangle of an upright wall across the heading."""

    _rising: ClassVar[Pairs] = (("bottom_m", "top_m"),)
    shape: Literal["wall"] = Field(description="an upright wall, in metres")
    distance_m: Length = Field(description="horizontal distance")
    width_m: Length = Field(description="its width, half of it to each side")
    bottom_m: Far = Field(default=0.0, description="height of its lower edge above the ground")
    top_m: Far = Field(default=2.5, description="height of its upper edge above the ground")

    def _ahead_m(self) -> tuple[Triple, Triple, Triple, Triple]:
        far, side = self.distance_m, self.width_m / 2
        low, high = self.bottom_m - self.height_m, self.top_m - self.height_m
        return (far, -side, low), (far, side, low), (far, side, high), (far, -side, high)

    def _named(self) -> str:
        return f"wall {self.distance_m:g} m away, {self.bottom_m:g} to {self.top_m:g} m high"


def beyond_words(share: float) -> str:
    """Return a share of a plane that is out of range as text: "all" only if nothing is within."""
    return "all" if share == 1 else f"{min(share, 0.9999):.2%}" if share > 0.99 else f"{100 * share:.2g}%"


def _level(from_m: float, to_m: float, width_m: float, z_m: float) -> tuple[Triple, Triple, Triple, Triple]:
    side = width_m / 2
    return (from_m, -side, z_m), (to_m, -side, z_m), (to_m, side, z_m), (from_m, side, z_m)


def _sum(a: Triple, b: Triple) -> Triple:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _between_deg(a: Triple, b: Triple) -> float:
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return math.degrees(math.atan2(math.hypot(*cross), sum(x * y for x, y in zip(a, b, strict=True))))


PlaneRegion = GroundRegion | CeilingRegion | WallRegion
Painted = AllRegion | BandRegion | ConeRegion | MapRegion | PlaneRegion
Region = Annotated[Painted | BoxRegion, Field(discriminator="shape")]
MaskRegion = Annotated[Painted | MeshRegion, Field(discriminator="shape")]
