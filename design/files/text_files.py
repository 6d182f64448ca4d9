"""Text and TOML files, read with errors for a person."""

from __future__ import annotations

import codecs
import io
import tomllib
from pathlib import Path
from typing import Any

from scanwright.design.errors import TaskError

A_FILE_FOR_A_FOLDER = "this is a file; name the folder of a build, which holds"
"""What is told to those who name a file of a build folder where the folder is meant; a file's name follows."""


def read_text(path: Path) -> str:
    """The text of a file in UTF-8, also where it begins with a byte order mark, as Windows' Notepad writes it.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not UTF-8.
    """
    data = path.read_bytes()
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise ValueError("UTF-16 text: save it as UTF-8")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError("not UTF-8 text") from error
    return io.StringIO(text, newline=None).read()


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """The table of a TOML file.

    Raises:
        TaskError: the file cannot be read or is not TOML.
    """
    try:
        return tomllib.loads(read_text(path))
    except NotADirectoryError as error:
        raise TaskError(f"{path.parent}: {A_FILE_FOR_A_FOLDER} {path.name}") from error
    except OSError as error:
        raise TaskError(f"{path}: cannot read {what}: {error.strerror}") from error
    except RecursionError as error:
        raise TaskError(f"{path}: not a TOML file: nested too deeply") from error
    except ValueError as error:  # not UTF-8, not TOML, or a path with a NUL in it
        raise TaskError(f"{path}: not a TOML file: {error}") from error
