"""NPY: one array of NumPy, points of three or more numbers, in rows or as an image. Read only."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scanwright.design.errors import RecordingError
from scanwright.design.files.numpy_files import read_npy
from scanwright.firmware_io.clouds.cloud import Cloud


def read(path: Path) -> tuple[list[Cloud], list[str]]:
    """Read the cloud of an array (n, 3 or more) or (rows, columns, 3 or more)."""
    array = read_npy(path, RecordingError)
    if array.ndim not in (2, 3) or array.shape[-1] < 3 or not array.size:
        raise RecordingError(f"{path}: shape {array.shape}: must be (n, 3 or more) or (rows, columns, 3 or more)")
    values = array.reshape(-1, array.shape[-1])
    real = np.float32 if array.dtype == np.float32 else np.float64
    count = values.shape[1]
    columns = {f"column_{k + 1}": values[:, k].astype(real) for k in range(3, count)}
    shape = (array.shape[0], array.shape[1]) if array.ndim == 3 else (1, len(values))
    notes = [f"columns 4 to {count} have no name in {path}"] if count > 3 else []
    return [Cloud(values[:, :3].astype(real), columns, shape)], notes
