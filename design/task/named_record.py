"""Tables of shipped records by name, or of the file that the user names."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any

from scanwright.design.errors import MissingFileError, TaskError, suggest
from scanwright.design.files.text_files import read_toml


def named_table(path: Path, shipped: Path, what: str) -> tuple[dict[str, Any], Path]:
    """Return the table of a TOML file, or of a file of the folder `shipped` by its bare name; and its path.

    `what` is its name in messages, such as "task".

    Raises:
        TaskError: there is no such file, or it is not TOML.
    """
    source = _path_of(path, shipped, what)
    try:
        return read_toml(source, f"the {what} file"), source
    except MissingFileError as error:
        names = {name: name for name in names_in(shipped)}
        names |= {other.stem: str(other) for other in source.parent.glob("*.toml")}
        close = difflib.get_close_matches(path.stem, names, n=1, cutoff=0.8)  # the person has typed a file's name
        known = f"; did you mean '{names[close[0]]}'?" if close else f"; known: {', '.join(names_in(shipped))}"
        raise MissingFileError(f"{path}: no such {what} file{known}{_new(what)}") from error


def names_in(shipped: Path) -> list[str]:
    """Return the names of the shipped files."""
    return sorted(path.stem for path in shipped.glob("*.toml"))


def _path_of(path: Path, shipped: Path, what: str) -> Path:
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
        raise TaskError(f"{path}: not a regular file, so not a {what} file")
    if path.is_symlink():
        raise MissingFileError(f"{path}: a link to a file that does not exist")
    known = suggest(path.name, names_in(shipped))
    raise MissingFileError(f"{path}: no such {what} file, and no shipped {what} of that name{known}{_new(what)}")


def _new(what: str) -> str:
    return "; `scanwright new` writes one" if what == "task" else ""
