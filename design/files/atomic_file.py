"""Files that are whole or not there, and that stay in the folder they are meant for."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scanwright.design.errors import ScanwrightError


def check_place(path: Path, refusal: type[ScanwrightError]) -> None:
    """Refuse a place where no file can be, for those who would know it before their work and not after it.

    Raises:
        ScanwrightError: a `refusal`: this is a folder, or there is no such folder.
    """
    try:
        if path.is_dir():
            raise refusal(f"{path}: this is a folder; name a file in it")
        if not path.parent.is_dir():
            raise refusal(f"{path}: the folder {path.parent} does not exist")
    except OSError as error:  # a name longer than names can be
        raise refusal(f"{path}: cannot write: {error.strerror}") from error


def place_in(folder: Path, name: str, refusal: type[ScanwrightError]) -> Path:
    """Return `folder / name` for writing or removing, if no link below the folder leads elsewhere.

    The folder itself may be a link, which is the choice of whoever named it. A link below it may come with a folder
    that somebody else made, and a write or a removal through it would change files that are none of ours.

    Args:
        folder: the folder of a build, a study, or another result.
        name: relative to the folder, without `..`.
        refusal: the error to raise.

    Raises:
        ScanwrightError: a `refusal`: the name itself or a folder on the way to it is a symbolic link.
    """
    path = folder
    for part in Path(name).parts:
        path /= part
        if path.is_symlink():
            raise refusal(f"{path}: a symbolic link, and nothing is written or removed through one: remove the link")
    return path


@contextmanager
def whole_file(path: Path, refusal: type[ScanwrightError]) -> Iterator[Path]:
    """Give a temporary name beside `path`; rename it to `path` when the body ends well, delete it when not.

    Raises:
        ScanwrightError: a `refusal`: the file cannot be written there.
    """
    check_place(path, refusal)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.unlink(missing_ok=True)  # a link of that name would be followed
        yield part
        part.replace(path)
    except OSError as error:
        raise refusal(f"{path}: cannot write: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)
