"""Regions of the sphere, and of a scene, as a task file paints them.

Files speak degrees, and metres where a mesh does; every key that has a unit ends in it.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, Strict, field_validator, model_validator

from design.record import Record

Number = Annotated[float, Strict()]
"""An int or a float of the file; text and true are no numbers."""

Span = tuple[Number, Number]
Triple = tuple[Number, Number, Number]
Value = Annotated[Number, Field(ge=0, le=1e300, description="how much it matters; 0 is nothing")]


def _divides_the_half_circle(step: float) -> float:
    if abs(180 / step - round(180 / step)) > 1e-9:
        raise ValueError("the grid reaches theta = 180 only with a step that divides 180")
    return step


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
    phi_deg: Span = Field(default=(-180.0, 180.0), description="from ahead towards the left: 0 is ahead, 90 left")
    value: Value = 1.0
    required: Required = None

    @model_validator(mode="after")
    def _edges_rise(self) -> BandRegion:
        if not 0 <= self.theta_deg[0] <= self.theta_deg[1] <= 180:
            raise ValueError(f"theta_deg = {list(self.theta_deg)} does not rise within 0 .. 180")
        if not 0 <= self.phi_deg[1] - self.phi_deg[0] <= 360:
            raise ValueError(f"phi_deg = {list(self.phi_deg)} does not rise by at most 360")
        return self


class ConeRegion(Record):
    """Directions within `half_angle_deg` of `axis` (world frame; its length does not matter)."""

    shape: Literal["cone"] = Field(description="around one direction")
    axis: tuple[Number, Number, Number] = Field(description="its middle: x ahead, y left, z up; of any length")
    half_angle_deg: Number = Field(ge=1e-3, le=180, description="from its middle to its edge")
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

    A .npy or .csv table is taken as it is. `value` scales it.
    """

    shape: Literal["map"] = Field(description="weights in a picture or a table")
    file: str = Field(description=".png, .csv or .npy, beside the task: rows theta 0 .. 180, columns phi 0 .. 360")
    value: Value = 1.0
    required: Required = None


class Placed(Record):
    """A mesh, and where the scanner's optical centre and the world's axes are in it (roll, pitch, yaw; z last)."""

    file: str = Field(description=".stl, .ply, .obj, .dae or .glb, beside the task")
    unit_m: Number = Field(default=1.0, gt=0, description="length of one unit of the file")
    sensor_m: Triple = Field(default=(0.0, 0.0, 0.0), description="the optical centre in the mesh: x, y, z")
    rpy_deg: Triple = Field(default=(0.0, 0.0, 0.0), description="axes of the world in the mesh: roll, pitch, yaw")
    step_deg: GridStep = Field(default=2.0, description="between the rays that are cast at it")


class MeshRegion(Placed):
    """What a mesh hides, such as the robot: every direction in which it is hit."""

    shape: Literal["mesh"] = Field(description="where a mesh is, such as the robot itself")
    value: Value = 1.0


class BoxRegion(Record):
    """Surfaces of the scene within a box of its frame. Every square metre of them counts the same."""

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


Region = Annotated[AllRegion | BandRegion | ConeRegion | MapRegion | BoxRegion, Field(discriminator="shape")]
MaskRegion = Annotated[AllRegion | BandRegion | ConeRegion | MapRegion | MeshRegion, Field(discriminator="shape")]
