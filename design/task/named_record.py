"""Tables of records that come with the package by name, or from a file that a person names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scanwright.design.errors import TaskError, suggest
from scanwright.design.files.text_files import read_toml


def named_table(path: Path, shipped: Path, what: str) -> tuple[dict[str, Any], Path]:
    """The table of a TOML file, or of one of the folder `shipped` by its bare name; and the file it came from.

    Args:
        path: the file, or the name.
        shipped: folder of those that come with the package.
        what: the word for it in messages, such as "task".

    Raises:
        TaskError: there is none, or it is not TOML.
    """
    source = _found(path, shipped, what)
    try:
        return read_toml(source, f"the {what} file"), source
    except TaskError as error:
        if not isinstance(error.__cause__, FileNotFoundError):
            raise
        beside = [str(other) for other in source.parent.glob("*.toml")]
        raise TaskError(f"{path}: no such {what} file{suggest(str(path), [*beside, *names_in(shipped)])}") from error


def names_in(shipped: Path) -> list[str]:
    """What can be named without a file."""
    return sorted(path.stem for path in shipped.glob("*.toml"))


def _found(path: Path, shipped: Path, what: str) -> Path:
    if path.suffix == ".toml" or path.is_file():
        return path
    named = shipped / f"{path}.toml"
    if path.parent == Path() and named.exists():
        return named
    within = path / f"{what}.toml"
    if within.is_file():
        raise TaskError(f"{path}: this is a folder: name {within}")
    if path.is_dir():
        raise TaskError(f"{path}: this is a folder without a {within.name}, not a {what} file")
    if path.exists():
        raise TaskError(f"{path}: this is no regular file, so no {what} file")
    if path.is_symlink():
        raise TaskError(f"{path}: this is a link that leads to no file")
    known = suggest(path.name, names_in(shipped))
    raise TaskError(f"{path}: no such {what} file, and no shipped {what} of that name{known}")
