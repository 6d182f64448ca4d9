"""Text and TOML files, with errors of one line."""

from __future__ import annotations

import codecs
import io
import tomllib
from pathlib import Path
from typing import Any

from scanwright.design.errors import MissingFileError, TaskError, made_by


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file, with or without a byte order mark (Notepad on Windows writes one).

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not UTF-8, or its path has a NUL.
    """
    data = path.read_bytes()
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise ValueError("UTF-16 text: save it as UTF-8")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError("not UTF-8 text") from error
    return io.StringIO(text, newline=None).read()


def read_text_of(path: Path, what: str) -> str:
    """Return the text of a file that a task, a catalogue or an angle set is read from; `what` names it in errors.

    Raises:
        MissingFileError: there is no such file.
        TaskError: it cannot be read.
    """
    try:
        return read_text(path)
    except NotADirectoryError as error:
        raise TaskError(f"{path.parent}: this is a file; name the build folder that contains {path.name}") from error
    except (OSError, ValueError) as error:
        why = f"{path}: cannot read {what}: {getattr(error, 'strerror', None) or error}"
        if isinstance(error, FileNotFoundError):
            raise MissingFileError(f"{why}{made_by(path)}") from error
        raise TaskError(why) from error


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Return the table of a TOML file; `what` names it in errors.

    Raises:
        MissingFileError: there is no such file.
        TaskError: it cannot be read, or is not TOML.
    """
    try:
        return tomllib.loads(read_text_of(path, what))
    except RecursionError as error:
        raise TaskError(f"{path}: not a TOML file: nested too deeply") from error
    except tomllib.TOMLDecodeError as error:
        raise TaskError(f"{path}: not a TOML file: {error}") from error


def first_line(error: Exception) -> str:
    """Return the first line of an error of other libraries, or its type if it has no text."""
    return (str(error).strip() or type(error).__name__).splitlines()[0][:200]
