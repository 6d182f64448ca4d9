"""The mounting angles of a task: their ranges, and the grid of the search."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from scanwright.design.arrays import Array
from scanwright.design.files.record import Record
from scanwright.design.task.equivalent_settings import BOUNDS, advice
from scanwright.design.task.shapes import Number, Span

Angle = Number | Span
"""One value fixes the angle; two are the range to search, in degrees."""

NAMES = tuple(BOUNDS)


class AngleRanges(Record):
    """Mounting angles to search over, or fixed."""

    alpha_rot_deg: Angle = Field(
        default=(-180.0, 180.0), description="tilt of the servo's axis, upright at 0, about x (ahead)"
    )
    beta_rot_deg: Angle = Field(
        default=(-90.0, 90.0), description="tilt before that about y (left): 90 points it ahead"
    )
    alpha_laser_deg: Angle = Field(
        default=(-90.0, 90.0), description="roll of the lidar, perpendicular to the axis at 0, about its front"
    )
    beta_laser_deg: Angle = Field(
        default=(-90.0, 90.0), description="pitch after that: at -90 its front points along the axis"
    )
    step_deg: Number = Field(default=5.0, ge=0.5, le=45, description="step of the grid of the search, refined to 0.01")
    tolerance_deg: Number = Field(default=0.0, ge=0, le=10, description="of the mounting, for which J is optimised")
    holes: Literal["avoid", "allow"] = Field(
        default="avoid", description="blind spots in the regions; 'allow' is the plain J of the paper"
    )

    prefer: Literal["lowest_J", "simple"] = Field(
        default="lowest_J",
        description="'simple' chooses the fewest angles that cost at most prefer_loss",
    )
    prefer_loss: Number = Field(
        default=0.0,
        ge=0,
        lt=1,
        description="largest cost of 'simple': share of the beam density (of J if not log)",
    )

    @model_validator(mode="after")
    def _within_bounds(self) -> AngleRanges:
        if self.prefer_loss and self.prefer != "simple":
            raise ValueError(f"prefer_loss = {self.prefer_loss:g} is for prefer = 'simple': the lowest J costs nothing")
        setting = {name: self.limits(name) for name in BOUNDS}
        for name, (lower, upper) in setting.items():
            bound = BOUNDS[name]
            if lower > upper:
                raise ValueError(f"{name}_deg = {[lower, upper]} does not rise")
            if not -bound <= lower <= upper <= bound:
                shown = f"{lower:g}" if lower == upper else [lower, upper]
                raise ValueError(f"{name}_deg = {shown} is not within -{bound:g} .. {bound:g}{advice(setting, name)}")
        return self

    def limits(self, name: str) -> Span:
        """Return the range of one angle in degrees; both ends are equal if it is fixed."""
        angle: Angle = getattr(self, f"{name}_deg")
        return angle if isinstance(angle, tuple) else (angle, angle)

    def hold(self, angles_deg: Sequence[float]) -> bool:
        """Return whether a setting, in the order of `NAMES`, is within all ranges."""
        limits = [self.limits(name) for name in NAMES]
        return all(low - 1e-9 <= angle <= high + 1e-9 for angle, (low, high) in zip(angles_deg, limits, strict=True))

    def grid_deg(self, name: str) -> Array:
        """Return the values of one angle in the grid of the search, both limits included."""
        lower, upper = self.limits(name)
        steps = int(np.floor((upper - lower) / self.step_deg + 1e-9))
        grid = lower + self.step_deg * np.arange(steps + 1)
        return grid if upper - grid[-1] < 1e-9 else np.append(grid, upper)
