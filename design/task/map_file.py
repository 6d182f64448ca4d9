"""Weights in a picture or a table: rows theta, columns phi."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from scanwright.design.arrays import Array
from scanwright.design.errors import TaskError
from scanwright.design.files.numpy_files import read_npy
from scanwright.design.files.text_files import read_text

_MOST_PIXELS = 1 << 25  # of a picture: 0.04 deg each


def read_map(path: Path) -> Array:
    """Return the weights of the cells, (rows, columns), of a PNG, CSV or NPY file.

    Raises:
        TaskError: it is not a table of finite numbers of 0 or more, at least one of them above 0.
    """
    try:
        table = _map_table(path)
    except TaskError:
        raise
    except OSError as error:
        raise TaskError(f"{path}: cannot read the map: {error.strerror or error}") from error
    except Exception as error:  # damaged pictures raise a dozen types
        raise TaskError(f"{path}: cannot read the map: {error}") from error
    if not isinstance(table, np.ndarray) or table.dtype.kind not in "biuf":
        raise TaskError(f"{path}: a map is one table of real numbers")
    if table.ndim != 2 or table.size == 0:
        raise TaskError(f"{path}: a map has rows (theta) and columns (phi), this one has shape {table.shape}")
    if not np.isfinite(table).all() or (table < 0).any():
        raise TaskError(f"{path}: a map contains weights: finite and not negative")
    if not table.any():
        raise TaskError(f"{path}: every weight of the map is 0")
    return table.astype(float)


def _map_table(path: Path) -> Any:
    if path.suffix == ".npy":
        return read_npy(path, TaskError)
    if path.suffix == ".csv":
        text = read_text(path)
        return np.loadtxt(text.splitlines(), delimiter=",", ndmin=2) if text.strip() else np.empty((0, 0))
    if path.suffix == ".png":
        from matplotlib.image import imread
        from PIL import Image

        with Image.open(path) as picture_file:
            if (pixels := picture_file.width * picture_file.height) > _MOST_PIXELS:
                raise TaskError(f"{path}: a map of {pixels:,} pixels: at most {_MOST_PIXELS:,}")
        picture = imread(path)  # 0..1 already, (rows, columns[, channels])
        return picture if picture.ndim == 2 else picture[..., :3].mean(axis=2)
    raise TaskError(f"{path}: a map is a .png, .csv or .npy file")
