"""What a person changes in the studio: angles, and paint on the walls.

Paint is a sequence of dabs. Each is a cone after the regions of the task, so that later paint wins.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import ValidationError

from scanwright.design.arrays import Array
from scanwright.design.errors import TaskError
from scanwright.design.files.faults import format_validation_error
from scanwright.design.task.shapes import ConeRegion, MaskRegion, Region
from scanwright.design.task.task import LoadedTask

BOUNDS_DEG = 180.0, 90.0, 90.0, 90.0  # of the mounting angles in a task file
MOST_DABS = 60  # with more, J is slow: each edge of a region is a break of its quadrature
DECIMALS = 4  # of an axis in the task file: 0.006 deg

Brush = Literal["matters", "does not matter", "hidden"]


@dataclass(frozen=True, slots=True)
class Setting:
    """The four mounting angles."""

    angles_deg: tuple[float, float, float, float]

    @classmethod
    def within_bounds(cls, angles_deg: Iterable[float]) -> Setting:
        """Return a setting, clipped and rounded to 0.01 deg; raise ValueError if it is not four finite numbers."""
        angles = np.array([float(angle) for angle in angles_deg])
        if angles.shape != (4,) or not np.isfinite(angles).all():
            raise ValueError(f"{angles.tolist()}: not four finite angles")
        alpha_rot, beta_rot, alpha_laser, beta_laser = (
            round(float(np.clip(angle, -bound, bound)), 2) + 0.0
            for angle, bound in zip(angles, BOUNDS_DEG, strict=True)
        )
        return cls((alpha_rot, beta_rot, alpha_laser, beta_laser))

    @classmethod
    def read(cls, text: str) -> Setting:
        """Return the setting of a text; raise TaskError if it is not four numbers within the bounds."""
        try:
            angles = [float(part) for part in text.replace(",", " ").split()]
            setting = cls.within_bounds(angles)
        except ValueError as error:
            raise TaskError(f"angles: not four numbers (got '{text}'; for example 0, 90, 0, -90)") from error
        for angle, bound in zip(angles, BOUNDS_DEG, strict=True):
            if abs(angle) > bound:
                raise TaskError(f"angles: {angle:g} deg is out of bounds (allowed -{bound:g} to {bound:g})")
        return setting

    @property
    def text(self) -> str:
        """The angles as `read` reads them."""
        return ", ".join(f"{angle:g}" for angle in self.angles_deg)

    @property
    def angles_rad(self) -> Array:
        """The angles [rad], shape (4,)."""
        return np.radians(self.angles_deg)


@dataclass(frozen=True, slots=True)
class Dab:
    """One touch of the brush."""

    direction: tuple[float, float, float]  # unit vector in the world
    radius_deg: float  # of the cone
    brush: Brush  # what it paints
    value: float = 1.0  # weight, of what matters

    @property
    def paints(self) -> tuple[float, Brush, float]:
        """All but the direction."""
        return self.radius_deg, self.brush, self.value

    def cone(self) -> ConeRegion:
        """Return the region of a task file."""
        axis = tuple(round(float(x), DECIMALS) + 0.0 for x in self.direction)
        value = {"matters": self.value, "does not matter": 0.0, "hidden": 1.0}[self.brush]
        return ConeRegion(shape="cone", axis=axis, half_angle_deg=self.radius_deg, value=value)


def painted(loaded: LoadedTask, dabs: tuple[Dab, ...]) -> LoadedTask:
    """Return the task with paint: dabs that hide join the masks, the others the weights; raise TaskError if invalid."""
    if len(dabs) > MOST_DABS:
        raise TaskError(f"paint: {len(dabs)} dabs: {MOST_DABS} at most; use a wider brush, or a map")
    task = loaded.task
    try:
        weights: tuple[Region, ...] = tuple(dab.cone() for dab in dabs if dab.brush != "hidden")
        masks: tuple[MaskRegion, ...] = tuple(dab.cone() for dab in dabs if dab.brush == "hidden")
    except ValidationError as error:
        raise TaskError(format_validation_error(error, "paint", ConeRegion)) from error
    changed = task.model_copy(update={"weight": (*task.weight, *weights), "mask": (*task.mask, *masks)})
    return replace(loaded, task=changed)
