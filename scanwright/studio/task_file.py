"""Write the task file of the studio; a wrong name, or a file that cannot be written, raises TaskError."""

from __future__ import annotations

import os
import re
from pathlib import Path

import tomli_w
from pydantic import ValidationError

from scanwright.design.errors import TaskError
from scanwright.design.files.faults import format_validation_error
from scanwright.design.task.angle_ranges import NAMES
from scanwright.design.task.task import LoadedTask, Task, load_task
from scanwright.pipeline.records import rename_files
from scanwright.studio.state import Setting

NAME = re.compile("[A-Za-z0-9][A-Za-z0-9_-]{0,63}")  # as `Task.name`; it becomes a file name


def task_text(loaded: LoadedTask, folder: Path, name: str, fixed: Setting | None) -> str:
    """Return the text of the task file for a folder: without defaults, with file names relative to the folder."""
    if not NAME.fullmatch(name):
        raise TaskError(f"name: use letters, digits, _ and -, at most 64, a letter or digit first (got '{name}')")
    table = loaded.task.model_dump(mode="json", exclude_defaults=True, exclude_none=True) | {"name": name}
    table["motion"] = loaded.task.motion.model_dump(mode="json")
    rename_files(table, loaded.task, lambda file, _: os.path.relpath(loaded.source.parent / file, folder))
    if fixed is not None:
        table["angles"] = table.get("angles", {}) | {
            f"{angle}_deg": value for angle, value in zip(NAMES, fixed.angles_deg, strict=True)
        }
    try:
        Task.model_validate(table)
    except ValidationError as error:
        raise TaskError(format_validation_error(error, f"{name}.toml", Task)) from error
    return tomli_w.dumps(table)


def save_task(loaded: LoadedTask, folder: Path, name: str, fixed: Setting | None, *, overwrite: bool) -> Path:
    """Write `name.toml` into a folder, and read it back."""
    text = task_text(loaded, folder, name, fixed)  # rejects a name that is a path
    path = folder / f"{name}.toml"
    if path.is_symlink():
        raise TaskError(f"{path}: is a symbolic link; choose another name")
    try:
        with path.open("w" if overwrite else "x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise TaskError(f"{path}: exists; tick 'overwrite', or choose another name") from error
    except OSError as error:
        raise TaskError(f"{path}: cannot be written: {error.strerror}") from error
    load_task(path)
    return path
