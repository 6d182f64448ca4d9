"""The cloud of the shipped task `low_cost` against the room that its emulators stand in.

    uv run python -m benchmarks.firmware_io.devices.low_cost_cloud [TURNS] [TASK]

One scan (or TURNS full ones) of the emulated scanner of a task (default low_cost), driven and assembled as from
hardware. Told is by how much the points lie before or behind the surface that their beam meets, without those whose
beam meets another surface half a degree aside, beside the noise of the sensor's data sheet.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scanwright import api
from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Floats
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.progress import Progress
from scanwright.design.scene.ray_caster import Scene, cast
from scanwright.firmware_io.clouds.ply import read_ply
from scanwright.firmware_io.emulators.scanner import emulated_scanner
from scanwright.firmware_io.emulators.world import room
from scanwright.firmware_io.scan.acquire import acquire
from scanwright.firmware_io.scan.plan import plan_scan

_ASIDE_RAD = math.radians(0.5)
_LEAST_M = 1e-6


def residuals_m(cloud: np.ndarray, angles: AngleSet, scene: Scene) -> tuple[Floats, float]:
    """How far points lie behind the surface along their beams, and which part of them was taken."""
    points_m = np.stack([cloud[axis] for axis in "xyz"], axis=1).astype(float)
    origins_m = angles.T_world_laser(cloud["joint_rad"])[:, :3, 3]
    range_m = np.linalg.norm(points_m - origins_m, axis=1)
    directions = (points_m - origins_m) / range_m[:, None]
    hits = cast(scene, origins_m, directions)
    normals = scene.normals[hits.triangle]
    across = np.cross(directions, [0.6, 0.0, 0.8])
    across /= np.linalg.norm(across, axis=1)[:, None]
    upright = np.cross(directions, across)
    clear = np.isfinite(hits.range_m)
    here_m = origins_m + hits.range_m[:, None] * directions
    for aside in (across, -across, upright, -upright):
        others = directions + _ASIDE_RAD * aside
        there_m = origins_m + cast(scene, origins_m, others).range_m[:, None] * others
        clear &= np.abs(np.einsum("ij,ij->i", there_m - here_m, normals)) < _LEAST_M  # still on the same plane
    return (range_m - hits.range_m)[clear], float(clear.mean())


@dataclass(frozen=True, slots=True)
class Residuals:
    """How far the points of a scan lie from the room.

    Attributes:
        points: that were taken.
        share: of the cloud that they are.
        median_mm: behind the surface, along the beams.
        spread_mm: robust standard deviation (of the median absolute deviation).
        beyond: share beyond six times the sensor's noise.
    """

    points: int
    share: float
    median_mm: float
    spread_mm: float
    beyond: float


def scanned(angles: AngleSet, turns: int, progress: Progress) -> Residuals:
    """Scan the furnished room with the emulated scanner of an angle set, assemble, and compare.

    Raises:
        ScanwrightError: as `acquire` and `assemble` do.
    """
    scene = room(None)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        (out / "angles.json").write_text(angles.to_json(), encoding="utf-8")
        with emulated_scanner(angles, scene) as emulators:
            acquire(plan_scan(out, turns=turns, lidar=emulators.ports.lidar, servo=emulators.ports.servo), progress)
        (recording,) = (out / "recordings").glob("*.mcap")
        api.assemble(recording, out / "angles.json", out / "cloud.ply")
        error_m, share = residuals_m(read_ply(out / "cloud.ply"), angles, scene)
    median_m = float(np.median(error_m))
    sigma_m = load_catalogue().get(angles.sensor, Lidar).range_sigma_mm / 1e3
    return Residuals(
        points=error_m.size,
        share=share,
        median_mm=1e3 * median_m,
        spread_mm=1e3 * float(np.median(np.abs(error_m - median_m))) / 0.67449,
        beyond=float(np.mean(np.abs(error_m) > 6 * sigma_m)),
    )


def main() -> None:
    """Scan, assemble, compare."""
    turns = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    task = sys.argv[2] if len(sys.argv) > 2 else "low_cost"
    with suppress(PermissionError):
        os.nice(-10)  # emulators need their time, as hardware does not
    angles = api.optimise(task).angle_set()
    sigma_mm = load_catalogue().get(angles.sensor, Lidar).range_sigma_mm
    found = scanned(angles, turns, print)
    print(
        f"{task}, {angles.sensor} on {angles.servo}, {turns} full scan(s): {found.points:,} points ({found.share:.0%} "
        f"away from edges) lie {found.median_mm:+.2f} mm from the room, spread {found.spread_mm:.1f} mm; the sensor's "
        f"noise is {sigma_mm:g} mm; {found.beyond:.2%} beyond six times that"
    )


if __name__ == "__main__":
    main()
