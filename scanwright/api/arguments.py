"""What the functions take in more than one form: a task, an angle set, and somebody who listens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scanwright.design.angles import AngleSet, load_angles
from scanwright.design.task.task import LoadedTask, load_task

if TYPE_CHECKING:
    from scanwright.pipeline.built_scanner import BuiltScanner

TaskLike = LoadedTask | str | Path | Mapping[str, Any]
"""A loaded task, the name of a shipped one, a file, a build folder, or a table with the keys of a task file."""
AnglesLike = AngleSet | str | Path
"""An angle set, or the file of one."""
Say = Callable[..., None]
"""Is told what is being done, a line at a time."""


def quiet(_line: str, _fraction: float | None = None) -> None:
    """Progress that nobody asked for."""


def as_built_scanner(task: TaskLike) -> BuiltScanner | None:
    """Return what a build folder holds; None if the task is given in another form. Raises as `open_built`."""
    if not isinstance(task, str | Path):
        return None
    from scanwright.pipeline.built_scanner import is_build_folder, open_built

    return open_built(Path(task)) if is_build_folder(Path(task)) else None


def as_task(task: TaskLike) -> LoadedTask:
    """The task, loaded if it is not yet; raises as `load_task`."""
    return task if isinstance(task, LoadedTask) else load_task(task)


def as_angle_set(angles: AnglesLike) -> AngleSet:
    """The angle set, read if it is a file; raises as `load_angles`."""
    return angles if isinstance(angles, AngleSet) else load_angles(Path(angles))
