"""What a person makes of a task in the studio: paint on the sphere, angles, a name; and the file of it.

Paint is laid down in dabs. Each is a cone that joins the task's regions as the last one, so what is painted last wins,
as in every task file: nothing of the studio is lost when the file is written, and the file says nothing else.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tomli_w
from pydantic import ValidationError

from design.errors import TaskError
from design.frames import Array
from design.record import explain
from design.task.shapes import Cone, Map, MaskRegion, Mesh, Region
from design.task.task import NAMES, LoadedTask, Task, load_task

MOST_DABS = 60
"""Beyond it J takes its time: every edge of a region is a break of its quadrature."""
DECIMALS = 4

Brush = Literal["matters", "does not matter", "hidden"]


@dataclass(frozen=True, slots=True)
class Setting:
    """The four mounting angles in degrees; `bound` holds where a task file could name them."""

    alpha_rot_deg: float
    beta_rot_deg: float
    alpha_laser_deg: float
    beta_laser_deg: float

    @property
    def angles_deg(self) -> tuple[float, float, float, float]:
        """In the order of `design.task.task.NAMES`."""
        return self.alpha_rot_deg, self.beta_rot_deg, self.alpha_laser_deg, self.beta_laser_deg

    @property
    def angles_rad(self) -> Array:
        """The same in radians, shape (4,)."""
        return np.radians(self.angles_deg)


def setting_of(angles_deg: Any) -> Setting:
    """Four numbers as a setting, each within what a task file may say and rounded to its 0.01 deg.

    Raises:
        ValueError: one of them is no finite number.
    """
    bounds = (180.0, 90.0, 90.0, 90.0)
    angles = [float(angle) for angle in angles_deg]
    if len(angles) != len(bounds) or not np.isfinite(angles).all():
        raise ValueError(f"{angles}: not four finite angles")
    clipped = [round(float(np.clip(a, -b, b)), 2) + 0.0 for a, b in zip(angles, bounds, strict=True)]
    return Setting(*clipped)


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

    def cone(self) -> Cone:
        """The region of a task file that says the same."""
        axis = tuple(round(float(x), DECIMALS) + 0.0 for x in self.direction)
        value = {"matters": self.value, "does not matter": 0.0, "hidden": 1.0}[self.brush]
        return Cone(shape="cone", axis=axis, half_angle_deg=self.radius_deg, value=value)


def painted(loaded: LoadedTask, dabs: tuple[Dab, ...]) -> LoadedTask:
    """The task with paint on it. Dabs that hide join the masks, the others the weights.

    A task that weighs no region weighs everything (its `background`); the paint then stands on that.

    Raises:
        TaskError: there are more than `MOST_DABS`, or a dab is none that a task file could hold.
    """
    if len(dabs) > MOST_DABS:
        raise TaskError(f"paint: {len(dabs)} dabs: {MOST_DABS} at most; take a wider brush, or draw a map")
    task = loaded.task
    try:
        weights: tuple[Region, ...] = tuple(dab.cone() for dab in dabs if dab.brush != "hidden")
        masks: tuple[MaskRegion, ...] = tuple(dab.cone() for dab in dabs if dab.brush == "hidden")
    except ValidationError as error:
        raise TaskError(explain(error, "paint", Cone)) from error
    changed = task.model_copy(update={"weight": (*task.weight, *weights), "mask": (*task.mask, *masks)})
    return replace(loaded, task=changed)


def task_text(loaded: LoadedTask, folder: Path, name: str, fixed: Setting | None) -> str:
    """The task file as it stands in a folder: what is at its default is left out, file names lead from there.

    Args:
        loaded: the task.
        folder: where the text is to be written.
        name: of the task.
        fixed: angles to write as values in place of the ranges to search.

    Raises:
        TaskError: the name cannot be one.
    """
    table = loaded.task.model_dump(mode="json", exclude_defaults=True, exclude_none=True) | {"name": name}
    table["motion"] = loaded.task.motion.model_dump(mode="json")

    def led(file: str) -> str:
        return os.path.relpath(loaded.source.parent / file, folder)

    for key in ("weight", "mask"):
        for i, region in enumerate(getattr(loaded.task, key)):
            if isinstance(region, Map | Mesh):
                table[key][i]["file"] = led(region.file)
    if loaded.task.scene is not None:
        table["scene"]["file"] = led(loaded.task.scene.file)
    if loaded.task.catalogue:
        table["catalogue"] = [led(extra) for extra in loaded.task.catalogue]
    if fixed is not None:
        table["angles"] = table.get("angles", {}) | {
            f"{angle}_deg": value for angle, value in zip(NAMES, fixed.angles_deg, strict=True)
        }
    try:
        Task.model_validate(table)
    except ValidationError as error:
        raise TaskError(explain(error, f"{name}.toml", Task)) from error
    return tomli_w.dumps(table)


def save_task(loaded: LoadedTask, folder: Path, name: str, fixed: Setting | None, *, overwrite: bool) -> Path:
    """Write `name.toml` into a folder and read it back; nothing is written anywhere else.

    Raises:
        TaskError: the name is not one of a task, the file exists and is not to be overwritten, or what was written
            does not read as a task.
    """
    text = task_text(loaded, folder, name, fixed)  # refuses a name that leads elsewhere
    path = folder / f"{name}.toml"
    if path.is_symlink():
        raise TaskError(f"{path}: a link that leads elsewhere: take another name")
    try:
        with path.open("w" if overwrite else "x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise TaskError(f"{path}: exists; tick 'overwrite', or take another name") from error
    except OSError as error:
        raise TaskError(f"{path}: cannot be written: {error.strerror}") from error
    load_task(path)
    return path
