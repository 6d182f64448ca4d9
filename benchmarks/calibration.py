"""How good and how fast the calibration is, on simulated rooms beside the Cramer-Rao bound.

    uv run python -m benchmarks.calibration [RUNS] [BEAMS]

RUNS (default 100) scans of the furnished room by a tilted fan, one turn of 18 s, 10 mm noise, BEAMS (default 1080:
777,600 points) to a scan, each with its own noise and its own start error: up to 5 deg and 20 mm.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from benchmarks.rooms import FURNISHED, NAMES, Floats, Setup, Truth, bound, simulate, write
from design.angles import Angles, AngleSet
from design.errors import ScanwrightError
from firmware_io.calibration.estimate import Estimate, estimate
from firmware_io.calibration.model import PARAMETERS, Mount, gather, start_vector
from firmware_io.recording import open_recording

MOUNT = 4


def main() -> None:
    """Print the figures."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    beams = int(sys.argv[2]) if len(sys.argv) > 2 else 1080
    setup = Setup(beams=beams)
    sd = np.sqrt(np.diag(bound(FURNISHED, setup, Truth(), NAMES[:9])))
    errors, squares, spans, seconds, lost = [], [], [], [], 0
    for seed in range(runs):
        truth = faulty(seed)
        try:
            found, took = calibrated(setup, truth, seed)
        except ScanwrightError as refusal:
            print(f"run {seed}: {refusal}")
            lost += 1
            continue
        error = found.x[:MOUNT] - [getattr(truth, name) for name in NAMES[:MOUNT]]
        spread = np.sqrt(np.diag(found.covariance))[:MOUNT]
        if np.any(np.abs(error) > 10 * spread):
            print(f"run {seed}: did not converge: {error / spread} standard deviations")
            lost += 1
            continue
        errors.append(error)
        spans.append(spread)
        squares.append(error @ np.linalg.solve(found.covariance[:MOUNT, :MOUNT], error))
        seconds.append(took)
    print(f"{runs - lost} of {runs} runs converged from up to 5 deg and 20 mm, {setup.beams * 720:,} beams each")
    for k, rms in enumerate(np.sqrt(np.mean(np.square(errors), axis=0))):
        one = PARAMETERS[k]
        shown = [value * one.shown for value in (rms, float(np.median(spans, axis=0)[k]), sd[k])]
        print(
            f"  {one.words:16} error {shown[0]:.4f}, stated {shown[1]:.4f}, bound {shown[2]:.4f} {one.unit}: "
            f"{shown[0] / shown[2]:.2f} x the bound"
        )
    low, high = chi2.ppf([0.025, 0.975], MOUNT * len(squares)) / len(squares)
    print(f"  mean normalised error squared {np.mean(squares):.2f}, 95 % band {low:.2f} to {high:.2f} (4 parameters)")
    print(f"  {np.median(seconds):.1f} s each (median, estimate alone), {min(seconds):.1f} to {max(seconds):.1f} s")
    time_offset(beams)


def time_offset(beams: int) -> None:
    """Both ways at two speeds: what of lag and backlash comes out."""
    setup = Setup(beams=beams // 2, sweeps=((20.0, 360.0), (-20.0, 360.0), (60.0, 360.0), (-60.0, 360.0)))
    truth = Truth(lag_s=0.0237, backlash_rad=float(np.radians(1 / 3)))
    found, took = calibrated(setup, truth, 0)
    spread = np.sqrt(np.diag(found.covariance))
    print(f"both ways at 20 and 60 deg/s, {found.tiles.beams.range_m.size:,} beams, {took:.1f} s:")
    for name in ("lag_s", "backlash_rad"):
        k = [p.name for p in PARAMETERS].index(name)
        one, at = PARAMETERS[k], found.choice.free.tolist().index(k)
        off = (found.x[k] - getattr(truth, name)) * one.shown
        print(f"  {one.words:16} off by {off:.4f} {one.unit}, stated {spread[at] * one.shown:.4f}")


def faulty(seed: int) -> Truth:
    """A scanner whose mount is off by up to 5 deg and 20 mm, with a biased lidar and an eccentric encoder."""
    rng = np.random.default_rng(1000 + seed)
    tilt, offset = (size * np.sqrt(rng.random()) for size in (np.radians(5.0), 0.02))
    a, b = rng.uniform(0, 2 * np.pi, 2)
    harmonics = np.radians(rng.uniform(-0.1, 0.1, 4)).tolist()
    return Truth(
        float(tilt * np.cos(a)),
        float(tilt * np.sin(a)),
        float(offset * np.cos(b)),
        float(offset * np.sin(b)),
        float(rng.uniform(-0.01, 0.01)),
        *harmonics,
    )


def calibrated(setup: Setup, truth: Truth, seed: int) -> tuple[Estimate, float]:
    """One simulated calibration that starts from the design, and the seconds that its estimate took."""
    with tempfile.TemporaryDirectory() as folder:
        recording = open_recording(write(Path(folder) / "r.mcap", simulate(FURNISHED, setup, truth, seed)))
        beams, _ = gather([recording], one_place=True)
    mount, start = mount_of(setup)
    begin = time.perf_counter()
    found = estimate(beams, mount, start)
    return found, time.perf_counter() - begin


def mount_of(setup: Setup) -> tuple[Mount, Floats]:
    """The design of a simulated scanner."""
    angles = designed(setup)
    return Mount.of(angles), start_vector(angles)


def designed(setup: Setup) -> AngleSet:
    """The angle set that a simulated scanner was built from."""
    (alpha_rot, beta_rot), (alpha_laser, beta_laser) = setup.rot_deg, setup.laser_deg
    angles = Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha_laser, beta_laser=beta_laser)
    return AngleSet(task="simulated", angles_deg=angles, sensor="any", servo="any")


if __name__ == "__main__":
    main()
