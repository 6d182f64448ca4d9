"""Draw what each fault of a recording does to the walls of a room: docs/pictures/import_faults.png.

    python -m benchmarks.firmware_io.recordings.fault_pictures docs/pictures/import_faults.png

A lidar with an upright scan plane sweeps back and forth in a room of 8 by 5 m. Seen from above: its horizontal beams.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from scanwright.design.arrays import Floats

_HALF_M = np.array([4.0, 2.5])
_PERIOD_S = 0.05
_SWING_RAD, _SPEED_RAD_S = np.radians(100), np.radians(120)


def axis_rad(seconds: Floats) -> Floats:
    """Angle of the axis that sweeps back and forth."""
    phase = (seconds * _SPEED_RAD_S / (2 * _SWING_RAD)) % 2
    return 2 * _SWING_RAD * (np.abs(phase - 1) - 0.5)


def seen(angle_of: Callable[[Floats], Floats], offset_s: float, far_share: float = 0.0) -> Floats:
    """Points (n, 2) of the two horizontal beams of each scan, if the angle at a time is taken for that of a beam.

    Args:
        angle_of: angle that is assigned to a time.
        offset_s: by how much the time assigned to a beam is late.
        far_share: share of beams without a return that have the range limit.
    """
    rng = np.random.default_rng(0)
    points = []
    for late_s, side in ((0.0, 0.0), (_PERIOD_S / 2, np.pi)):
        true_s = np.arange(0, 6, _PERIOD_S / 8) + late_s
        direction = axis_rad(true_s) + side
        ray = np.column_stack([np.cos(direction), np.sin(direction)])
        range_m = np.min(_HALF_M / np.maximum(np.abs(ray), 1e-9), axis=1) + rng.normal(0, 0.01, true_s.size)
        range_m = np.where(rng.random(true_s.size) < far_share, 6.0, range_m)
        turned = angle_of(true_s + offset_s) + side
        points.append(range_m[:, None] * np.column_stack([np.cos(turned), np.sin(turned)]))
    return np.concatenate(points)


def _spiked(seconds: Floats) -> Floats:
    return np.where(np.arange(seconds.size) % 40 == 0, 0.7, axis_rad(seconds))


def _drifting(seconds: Floats) -> Floats:
    return axis_rad(seconds + 0.02 * (seconds - 3))


PANELS: tuple[tuple[str, Floats], ...] = (
    ("as it is", seen(axis_rad, 0.0)),
    ("stamp of the last beam (50 ms)", seen(axis_rad, 0.05)),
    ("clocks 0.2 s apart", seen(axis_rad, 0.2)),
    ("a clock drifts by 2 %", seen(_drifting, 0.0)),
    ("every 40th angle is wrong", seen(_spiked, 0.0)),
    ("no return is the range limit", seen(axis_rad, 0.0, 0.1)),
)


def main(out: Path) -> None:
    """Draw the panels."""
    figure = Figure(figsize=(11, 5.6), layout="constrained")
    for axes, (title, points_m) in zip(figure.subplots(2, 3).ravel(), PANELS, strict=True):
        axes.scatter(*points_m.T, s=2, color="#1f5f8b", linewidths=0)
        axes.plot(0, 0, "+", color="#c0392b")
        axes.set(title=title, xlim=(-6.5, 6.5), ylim=(-4.5, 4.5), aspect="equal", xticks=[], yticks=[])
    figure.savefig(out, dpi=90)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
