"""Conversion of arguments that have several forms: task, angle set, progress callback."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from scanwright.design.angles import AngleSet, load_angles
from scanwright.design.errors import TaskError
from scanwright.design.task.task import LoadedTask, load_task

if TYPE_CHECKING:
    from scanwright.design.evaluation.evaluation import Lever
    from scanwright.design.evaluation.poles import Pole
    from scanwright.pipeline.built_scanner import BuiltScanner

TaskLike = LoadedTask | str | Path | Mapping[str, Any]
"""A loaded task, the name of a shipped one, a file, a build folder, or a table with the keys of a task file."""
AnglesLike = AngleSet | str | Path
"""An angle set, or the file of one."""
P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class _Lines:
    """A progress callback of version 0.1, called with the step alone; other processes get a copy."""

    say: Callable[[str], None]

    def __call__(self, step: str, _fraction: float | None = None, /) -> None:
        self.say(step)


def pole_in(text: str) -> Pole:
    """Return the pole of a text "WIDTH_MM,HEIGHT_MM,RANGE_M"; raises TaskError."""
    from scanwright.design.evaluation.poles import Pole

    width_mm, height_mm, range_m = numbers_in(text, "pole", "WIDTH_MM,HEIGHT_MM,RANGE_M, such as 20,1000,5")
    return Pole(width_mm / 1000, height_mm / 1000, range_m)


def lever_in(text: str) -> Lever:
    """Return the lever arm of a text "X_MM,Y_MM,RANGE_M"; raises TaskError."""
    from scanwright.design.evaluation.evaluation import Lever

    return Lever(*numbers_in(text, "lever", "X_MM,Y_MM,RANGE_M, such as 5,-3,1.0"))


def numbers_in(text: str, field: str, form: str) -> list[float]:
    """Return numbers separated by commas, as many as a form shows before its example.

    Raises:
        TaskError: the text has another form.
    """
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != form.partition(", ")[0].count(",") + 1:
        raise TaskError(f"{field} = '{text}': must be {form}")
    return numbers


def deprecated(text: str, argument: str) -> str:
    """Warn of an argument that was a text in version 0.1; returns the text."""
    message = f"{argument}= as a text is deprecated: pass scanwright.{argument.title()}(...)"
    warnings.warn(message, DeprecationWarning, stacklevel=4)
    return text


def with_say(function: Callable[P, T]) -> Callable[P, T]:
    """Accept `say=`, the name of `progress=` in version 0.1, with a DeprecationWarning."""

    @wraps(function)
    def accepting(*args: P.args, **kwargs: P.kwargs) -> T:
        if "say" in kwargs:
            warnings.warn("say= is now progress=, called with (step, fraction)", DeprecationWarning, stacklevel=2)
            kwargs["progress"] = _Lines(kwargs.pop("say"))  # type: ignore[arg-type]
        return function(*args, **kwargs)

    return accepting


def as_built_scanner(task: TaskLike) -> BuiltScanner | None:
    """Return the scanner of a build folder; None if the task has another form. Raises as `open_built`."""
    if not isinstance(task, str | Path):
        return None
    from scanwright.pipeline.built_scanner import is_build_folder, open_built

    return open_built(Path(task)) if is_build_folder(Path(task)) else None


def as_task(task: TaskLike) -> LoadedTask:
    """Return the task, loaded if it is not yet; raises as `load_task`."""
    return task if isinstance(task, LoadedTask) else load_task(task)


def as_angle_set(angles: AnglesLike) -> AngleSet:
    """Return the angle set, read if it is a file; raises as `load_angles`."""
    return angles if isinstance(angles, AngleSet) else load_angles(Path(angles))
