"""Files that are written completely or not at all, and only inside their folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scanwright.design.errors import ScanwrightError


def check_place(path: Path, refusal: type[ScanwrightError]) -> None:
    """Check that a file can be written at a path, before the work that makes it.

    Raises:
        ScanwrightError: `refusal`: the path is a folder, or its folder does not exist.
    """
    try:
        if path.is_dir():
            raise refusal(f"{path}: this is a folder; name a file in it")
        if not path.parent.is_dir():
            raise refusal(f"{path}: the folder {path.parent} does not exist")
    except OSError as error:  # a name longer than names can be
        raise refusal(f"{path}: cannot write: {error.strerror}") from error


def place_in(folder: Path, name: str, refusal: type[ScanwrightError]) -> Path:
    """Return `folder / name` for writing or removing, if no part of `name`, relative without `..`, is a symbolic link.

    The folder itself can be a link, which the user chose. A link below it can come with a folder of another author; a
    write or a removal through it would change files outside of the folder.

    Raises:
        ScanwrightError: `refusal`: the file or a folder above it is a symbolic link.
    """
    path = folder
    for part in Path(name).parts:
        path /= part
        if path.is_symlink():
            raise refusal(f"{path}: a symbolic link, and nothing is written or removed through one: remove the link")
    return path


@contextmanager
def atomic_write(path: Path, refusal: type[ScanwrightError]) -> Iterator[Path]:
    """Yield a temporary path next to `path`; rename it to `path` if the body succeeds, delete it otherwise.

    Raises:
        ScanwrightError: `refusal`: the file cannot be written there.
    """
    check_place(path, refusal)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.unlink(missing_ok=True)  # a link of that name would be followed
        yield part
        part.replace(path)
    except ScanwrightError:
        raise
    except OSError as error:
        raise refusal(f"{path}: cannot write: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)
