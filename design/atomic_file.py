"""Files that are whole or not there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from design.errors import ScanwrightError


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


@contextmanager
def whole_file(path: Path, refusal: type[ScanwrightError]) -> Iterator[Path]:
    """Give a temporary name beside `path`; rename it to `path` when the body ends well, delete it when not.

    Raises:
        ScanwrightError: a `refusal`: the file cannot be written there.
    """
    check_place(path, refusal)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        part.replace(path)
    except OSError as error:
        raise refusal(f"{path}: cannot write: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)
