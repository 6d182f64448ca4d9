"""PTX of Leica: scans with pose, each a grid of points column by column; `0 0 0` is no return. Read only."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np

from scanwright.design.errors import RecordingError
from scanwright.design.files.text_files import read_text
from scanwright.firmware_io.clouds.cloud import Cloud, as_type
from scanwright.firmware_io.clouds.text import read_numbers
from scanwright.firmware_io.foreign import foreign

_HEADER = 10  # lines: columns, rows, position, three axes, a matrix of four rows
_COLOURS = ("red", "green", "blue")


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """Read all scans of a file."""
    lines = foreign(f"{path}: cannot read", read_text, path).splitlines()
    clouds, begin = [], 0
    while any(line.strip() for line in lines[begin:]):
        sizes = [line.strip() for line in lines[begin : begin + 2]]
        if len(sizes) < 2 or not all(size.isdecimal() and len(size) < 10 for size in sizes):
            raise RecordingError(
                f"{path}: line {begin + 1}: '{sizes[0][:40]}': not the number of columns, then of rows"
            )
        columns, rows = map(int, sizes)
        matrix = read_numbers(path, islice(lines, begin + 6, begin + _HEADER), begin + 7)
        first = begin + _HEADER
        values = read_numbers(path, islice(lines, first, first + columns * rows), first + 1)
        if matrix.shape != (4, 4) or values.shape[0] != columns * rows or values.shape[1] not in (3, 4, 7):
            raise RecordingError(
                f"{path}: line {begin + 1}: {columns} x {rows} points of 3, 4 or 7 numbers announced, "
                f"{values.shape[0]} of {values.shape[1]} there"
            )
        points_m = np.where((values[:, :3] == 0).all(axis=1)[:, None], np.nan, values[:, :3])
        further = {"intensity": values[:, 3].astype(np.float32)} if values.shape[1] > 3 else {}
        if values.shape[1] == 7:
            further |= {name: as_type(values[:, 4 + k], np.dtype("u1")) for k, name in enumerate(_COLOURS)}
        clouds.append(Cloud(points_m, further, (columns, rows), np.ascontiguousarray(matrix.T)))
        begin = first + columns * rows
    return clouds, []
