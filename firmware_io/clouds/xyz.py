"""XYZ: numbers as text, one point in a line; names, types, shape, pose and start as comments."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write
from scanwright.design.files.text_files import read_text
from scanwright.firmware_io.clouds.cloud import Cloud, as_type, cloud_from_rows, cloud_rows, headlines
from scanwright.firmware_io.foreign import foreign

_DIGITS = {"<f4": "%.9g", "<f8": "%.17g"}  # the fewest that bring every value back
_TYPES = {"|i1", "|u1", *(f"<{kind}{size}" for kind in "iu" for size in (2, 4, 8)), *_DIGITS}


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """The cloud of a file of three or more numbers in a line; columns that the file does not name are numbered."""
    text = foreign(f"{path}: cannot read", read_text, path)
    lines = text.replace(",", " ").splitlines()
    comments = [line.lstrip("#/ ") for line in lines if line.startswith(("#", "//"))]
    numbers = [line for line in lines if line.strip() and not line.startswith(("#", "//"))]
    if not numbers:
        raise RecordingError(f"{path}: no line of numbers")
    values = foreign(f"{path}: not lines of numbers", np.loadtxt, numbers, ndmin=2)
    count = values.shape[1]
    if count < 3:
        raise RecordingError(f"{path}: {count} numbers in a line; a cloud has x y z at least")
    if not np.isfinite(values[:, :3]).any():
        raise RecordingError(f"{path}: none of the {len(values)} lines is a point")
    named = [words for line in comments if len(words := line.lower().split()) == count and words[:3] == ["x", "y", "z"]]
    typed = [words[1:] for line in comments if len(words := line.split()) == count + 1 and words[0] == "types"]
    names = named[0] if named else ["x", "y", "z", *(f"column_{k}" for k in range(4, count + 1))]
    if twice := [name for k, name in enumerate(names) if name in names[:k]]:
        raise RecordingError(f"{path}: column {twice[0]} is named twice")
    types = typed[0] if typed else ["<f8"] * count
    for name, kind in zip(names, types, strict=True):
        if kind not in _TYPES or (name in ("x", "y", "z") and kind not in _DIGITS):
            raise RecordingError(f"{path}: types: {name} is {kind[:40]}: {', '.join(sorted(_TYPES))}; x y z are floats")
    rows = np.empty(len(values), list(zip(names, types, strict=True)))
    for k, name in enumerate(names):
        try:
            rows[name] = as_type(values[:, k], types[k])
        except RecordingError as error:
            raise RecordingError(f"{path}: column {name}: {error}") from error
    return [cloud_from_rows(rows, comments)], [] if named or count == 3 else [
        f"columns 4 to {count} have no name in {path}"
    ]


def write(path: Path, cloud: Cloud) -> list[str]:
    """Write a cloud."""
    rows = cloud_rows(cloud)
    names = rows.dtype.names or ()
    kinds = [rows.dtype[name].str for name in names]
    header = [" ".join(names), "types " + " ".join(kinds), *headlines(cloud)]
    with atomic_write(path, RecordingError) as part:
        np.savetxt(part, rows, [_DIGITS.get(kind, "%d") for kind in kinds], header="\n".join(header))
    return []
