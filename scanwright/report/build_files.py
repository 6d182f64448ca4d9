"""Readers of the files of a build folder: None if a file is missing, an error if no build wrote it."""

from __future__ import annotations

import csv
import gzip
import io
import json
from base64 import b64encode
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from scanwright.design.errors import BuildError

T = TypeVar("T")
KINDS = {".png": "image/png", ".svg": "image/svg+xml"}


def read(path: Path, reader: Callable[[Path], T]) -> T | None:
    """Return the result of a reader of a file; None if there is no file.

    Raises:
        BuildError: the file is not as a build writes it.
    """
    if not path.is_file():
        return None
    try:
        return reader(path)
    except BuildError:
        raise
    except (OSError, EOFError, ValueError, LookupError, TypeError, BadZipFile) as error:
        raise BuildError(f"{path}: not as a build writes it ({error}): build the folder again") from error


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file."""
    return path.read_text(encoding="utf-8")


def read_json(path: Path) -> Any:
    """Return the content of a JSON file."""
    return json.loads(read_text(path))


def read_table(path: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file by the names of its columns."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def read_picture(path: Path) -> str:
    """Return a picture as a data address."""
    return data_uri(path.read_bytes(), path.suffix)


def data_uri(data: bytes, suffix: str = ".png") -> str:
    """Return the file of a picture as an address; `suffix` is its kind."""
    return f"data:{KINDS[suffix]};base64,{b64encode(data).decode('ascii')}"


def png_uri(image: Image.Image) -> str:
    """Return a picture as the address of a PNG."""
    stream = io.BytesIO()
    image.save(stream, format="PNG")
    return data_uri(stream.getvalue())


def packed(text: str) -> str:
    """Return a text compressed, in base64: `inflated` in stage.js reads it."""
    return b64encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")


def numbers(values: ArrayLike, kind: str) -> str:
    """Return an array of numbers of a kind, in base64."""
    return b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
