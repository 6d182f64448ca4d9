"""NumPy arrays from `.npy` and `.npz` files: numbers only, no larger than the file can contain."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from scanwright.design.errors import ScanwrightError
from scanwright.design.files.text_files import first_line

_NUMBERS = "biuf"  # kinds of dtype
_MOST_BYTES = 1 << 30  # unpacked, or 4 times the archive if that is more: zip compresses up to a thousandfold


def read_npy(path: Path, refusal: type[ScanwrightError]) -> NDArray[Any]:
    """Return the array of an `.npy` file: numbers, no objects.

    Raises:
        ScanwrightError: `refusal`: the file cannot be read, or is not such an array.
    """
    try:
        with path.open("rb") as stream:
            return _array(stream, path.stat().st_size)
    except OSError as error:
        raise refusal(f"{path}: cannot read: {error.strerror}") from error
    except Exception as error:
        raise refusal(f"{path}: not an array of NumPy: {first_line(error)}") from error


def read_npz(path: Path, refusal: type[ScanwrightError]) -> dict[str, NDArray[Any]]:
    """Return the arrays of an `.npz` archive by name: numbers, no objects.

    Raises:
        ScanwrightError: `refusal`: the file cannot be read, or is not such an archive.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            most = max(_MOST_BYTES, 4 * path.stat().st_size)
            if (size := sum(member.file_size for member in members)) > most:
                raise ValueError(f"{size:,} bytes unpacked: at most {most:,}")
            arrays = {}
            for member in members:
                with archive.open(member) as stream:
                    arrays[member.filename.removesuffix(".npy")] = _array(stream, member.file_size)
            return arrays
    except OSError as error:
        raise refusal(f"{path}: cannot read: {error.strerror or first_line(error)}") from error
    except Exception as error:
        raise refusal(f"{path}: not an archive of NumPy, or damaged: {first_line(error)}") from error


def _array(stream: IO[bytes], size: int) -> NDArray[Any]:
    version = npy.read_magic(stream)
    read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}[version]
    shape, fortran, kind = read_header(stream)
    if kind.kind not in _NUMBERS:
        raise ValueError(f"an array of {kind}: numbers only")
    count = 1
    for side in shape:
        count *= side
    if min(shape, default=0) < 0 or count * kind.itemsize > size:
        raise ValueError(f"an array of shape {shape}, {kind}, in {size:,} bytes")
    data = stream.read(count * kind.itemsize)
    array = np.frombuffer(data, kind, count).reshape(shape, order="F" if fortran else "C")
    return array.astype(kind.newbyteorder("="))
