"""Map files of a ROS map_server: YAML and PGM. Errors raise RecordingError."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import atomic_write, check_place
from scanwright.firmware_io.mapping.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

_SHADES = {UNKNOWN: 205, FREE: 254, OCCUPIED: 0}
# 205 means 0.19608, above the lower threshold: unknown. With Nav2's default, 0.25, it would be free.
_THRESHOLDS = {"occupied_thresh": 0.65, "free_thresh": 0.196}


def image_path(path: Path) -> Path:
    """Return the path of the PGM of a map."""
    return path.with_suffix(".pgm")


def check_map_place(path: Path) -> None:
    """Raise RecordingError if a map cannot be written."""
    check_place(path, RecordingError)
    if path.suffix not in (".yaml", ".yml"):
        raise RecordingError(
            f"{path}: a map_server reads {path.with_suffix('.yaml').name}, with a .pgm in the same folder"
        )
    check_place(image_path(path), RecordingError)


def write_map(path: Path, grid: OccupancyGrid) -> tuple[Path, Path]:
    """Write a map, and return its files: YAML and image.

    The first row of the image has the largest y; the origin is the lower left corner of the lower left pixel, its third
    number the yaw.
    """
    check_map_place(path)
    image = image_path(path)
    rows, columns = grid.cells.shape
    shades = np.zeros(256, np.uint8)
    for value, shade in _SHADES.items():
        shades[value] = shade  # index -1 is the last one
    with atomic_write(image, RecordingError) as part:
        part.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + shades[grid.cells[::-1]].tobytes())
    x, y = (round(float(value), 6) for value in grid.origin_m)
    lines = [
        f"image: {json.dumps(image.name)}",  # a string of JSON is one of YAML
        "mode: trinary",
        f"resolution: {grid.resolution_m!r}",
        f"origin: [{x!r}, {y!r}, 0.0]",
        "negate: 0",
        *(f"{name}: {value}" for name, value in _THRESHOLDS.items()),
    ]
    with atomic_write(path, RecordingError) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path, image
