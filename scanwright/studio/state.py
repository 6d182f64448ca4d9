"""What a person makes of a task in the studio: angles, and paint on the sphere.

Paint is laid down in dabs. Each is a cone that joins the task's regions as the last one, so what is painted last wins,
as in every task file: nothing of the studio is lost when the file is written, and the file says nothing else.
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

BOUNDS_DEG = 180.0, 90.0, 90.0, 90.0
"""Of the mounting angles: what a task file may say."""
MOST_DABS = 60
"""Beyond it J takes its time: every edge of a region is a break of its quadrature."""
DECIMALS = 4  # of an axis in the task file: 0.006 deg

Brush = Literal["matters", "does not matter", "hidden"]


@dataclass(frozen=True, slots=True)
class Setting:
    """The four mounting angles.

    Attributes:
        angles_deg: in the order of `design.task.task.NAMES`.
    """

    angles_deg: tuple[float, float, float, float]

    @classmethod
    def within_bounds(cls, angles_deg: Iterable[float]) -> Setting:
        """Four numbers as a setting, each within what a task file may say and rounded to its 0.01 deg.

        Raises:
            ValueError: they are not four finite numbers.
        """
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
        """Return the setting that a text states.

        Raises:
            TaskError: it is not four numbers within the bounds.
        """
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
        """The same in radians, shape (4,)."""
        return np.radians(self.angles_deg)


@dataclass(frozen=True, slots=True)
class Dab:
    """One touch of the brush.

    Attributes:
        direction: unit vector in the world.
        radius_deg: of the cone.
        brush: what it paints.
        value: weight, of what matters.
    """

    direction: tuple[float, float, float]
    radius_deg: float
    brush: Brush
    value: float = 1.0

    @property
    def paints(self) -> tuple[float, Brush, float]:
        """All of it but where."""
        return self.radius_deg, self.brush, self.value

    def cone(self) -> ConeRegion:
        """The region of a task file that says the same."""
        axis = tuple(round(float(x), DECIMALS) + 0.0 for x in self.direction)
        value = {"matters": self.value, "does not matter": 0.0, "hidden": 1.0}[self.brush]
        return ConeRegion(shape="cone", axis=axis, half_angle_deg=self.radius_deg, value=value)


@dataclass(frozen=True, slots=True, eq=False)
class Canvas:
    """What is being judged; equal to another where it is the same paint on the same loaded task.

    Attributes:
        base: the task.
        dabs: the paint on it.
    """

    base: LoadedTask
    dabs: tuple[Dab, ...] = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Canvas) and self.base is other.base and self.dabs == other.dabs  # its maps are arrays

    def __hash__(self) -> int:
        return hash((id(self.base), self.dabs))

    def painted(self) -> LoadedTask:
        """The task with the paint, as `painted`."""
        return painted(self.base, self.dabs)


def painted(loaded: LoadedTask, dabs: tuple[Dab, ...]) -> LoadedTask:
    """The task with paint on it. Dabs that hide join the masks, the others the weights.

    A task that weighs no region weighs everything (its `background`); the paint then stands on that.

    Raises:
        TaskError: there are more than `MOST_DABS`, or a dab is none that a task file could hold.
    """
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
