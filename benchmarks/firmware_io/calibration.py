"""How good and how fast the calibration is, on simulated rooms beside the Cramer-Rao bound.

    uv run python -m benchmarks.firmware_io.calibration [RUNS] [BEAMS]

RUNS (default 100) scans of the furnished room by a tilted fan, one turn of 18 s, 10 mm noise, BEAMS (default 1080:
777,600 points) to a scan, each with its own noise and its own start error: up to 5 deg and 20 mm. The table is printed
anew every 10 runs. A normalised error squared is e' C^-1 e, with C the covariance that the calibration states: its mean
is the number of parameters where C is true.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from benchmarks.firmware_io.rooms import FURNISHED, NAMES, Floats, Setup, Truth, bound, faces, simulate, write
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import ScanwrightError
from scanwright.firmware_io.calibration.estimate import Estimate, estimate
from scanwright.firmware_io.calibration.model import PARAMETERS, Mount, gather, start_vector
from scanwright.firmware_io.recording.recording import open_recording

MOUNT = 4


def main() -> None:
    """Print the figures."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    beams = int(sys.argv[2]) if len(sys.argv) > 2 else 1080
    setup = Setup(beams=beams)
    sd = np.sqrt(np.diag(bound(FURNISHED, setup, Truth(), NAMES[:9])))
    done: list[_Run] = []
    for seed in range(runs):
        truth = faulty(seed)
        try:
            found, seconds, busy = calibrated(setup, truth, seed)
        except ScanwrightError as refusal:
            print(f"run {seed}: {refusal}")
            continue
        off = found.x[:MOUNT] - [getattr(truth, name) for name in NAMES[:MOUNT]]
        spread = np.sqrt(np.diag(found.covariance))[:MOUNT]
        if np.any(np.abs(off) > 10 * spread):
            print(f"run {seed}: did not converge: {off / spread} standard deviations")
            continue
        square = off @ np.linalg.solve(found.covariance[:MOUNT, :MOUNT], off)
        stray, used = strays(found, faces(FURNISHED, setup, truth, found.tiles.beams.time_ns))
        done.append(_Run(off, spread, float(square), seconds, busy, stray / used))
        if (seed + 1) % 10 == 0 and seed + 1 < runs:
            _print(done, seed + 1, setup, sd)
    _print(done, runs, setup, sd)
    for speeds_deg_s in ((20.0,), (20.0, 60.0)):
        time_offset(beams, speeds_deg_s)


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """One calibration that converged: of the mount, errors and what was stated for them, shape (4,)."""

    off: Floats
    stated: Floats
    square: float
    seconds: float
    busy: float
    stray: float


def _print(done: list[_Run], runs: int, setup: Setup, bound_sd: Floats) -> None:
    """The table of the runs so far."""
    print(f"{len(done)} of {runs} runs converged from up to 5 deg and 20 mm, {setup.beams * 720:,} beams each")
    print("                   error rms     stated      bound   error/bound  error/stated (95 % of such means lie in)")
    low, high = np.sqrt(chi2.ppf([0.025, 0.975], len(done)) / len(done))
    for k in range(MOUNT):
        one = PARAMETERS[k]
        rms = float(np.sqrt(np.mean([run.off[k] ** 2 for run in done])))
        ratio = float(np.sqrt(np.mean([(run.off[k] / run.stated[k]) ** 2 for run in done])))
        shown = [value * one.shown for value in (rms, float(np.median([run.stated[k] for run in done])), bound_sd[k])]
        figures = " ".join(f"{value:10.4f}" for value in shown)
        print(
            f"  {one.words:16}{figures} {one.unit:4}{rms / bound_sd[k]:8.2f}{ratio:12.2f}   ({low:.2f} to {high:.2f})"
        )
    low, high = chi2.ppf([0.025, 0.975], MOUNT * len(done)) / len(done)
    squares = np.mean([run.square for run in done])
    print(f"  normalised error squared, mean {squares:.2f}, 95 % band {low:.2f} to {high:.2f} (4 parameters)")
    stray = np.mean([run.stray for run in done])
    print(f"  beams taken for another surface's: {1e6 * stray:.0f} of a million that were used")
    seconds, busy = ([getattr(run, name) for run in done] for name in ("seconds", "busy"))
    print(
        f"  {np.median(seconds):.1f} s each (median, estimate alone), {min(seconds):.1f} to {max(seconds):.1f} s; ",
        end="",
    )
    print(f"of the processor {np.median(busy):.1f} s", flush=True)


def strays(found: Estimate, face: NDArray[np.int64]) -> tuple[int, int]:
    """How many of the beams that were used met another face than most of their surface, and how many were used.

    `face`: of each beam of the tiles.
    """
    surface, met = found.grouping.surface[found.tiles.tile[found.clear]], face[found.clear]
    _, pair, count = np.unique(np.column_stack([surface, met]), axis=0, return_inverse=True, return_counts=True)
    most = np.zeros(surface.max() + 1, np.int64)
    np.maximum.at(most, surface, count[pair.ravel()])
    return int(met.size - most.sum()), int(met.size)


def time_offset(beams: int, speeds_deg_s: tuple[float, ...]) -> None:
    """Both ways at some speeds: what of lag and backlash comes out."""
    sweeps = tuple((way * speed, 360.0) for speed in speeds_deg_s for way in (1, -1))
    setup = Setup(beams=beams // 2, sweeps=sweeps)
    truth = Truth(lag_s=0.0237, backlash_rad=float(np.radians(1 / 3)))
    found, took, _ = calibrated(setup, truth, 0)
    spread = np.sqrt(np.diag(found.covariance))
    at_speeds = " and ".join(f"{speed:g}" for speed in speeds_deg_s)
    print(f"both ways at {at_speeds} deg/s, {found.tiles.beams.range_m.size:,} beams, {took:.1f} s:")
    for name in ("lag_s", "backlash_rad"):
        k = [p.name for p in PARAMETERS].index(name)
        one = PARAMETERS[k]
        if k not in found.choice.free:
            print(f"  {one.words:16} held: {next(fixed.why for fixed in found.choice.fixed if name in fixed.names)}")
            continue
        at = found.choice.free.tolist().index(k)
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


def calibrated(setup: Setup, truth: Truth, seed: int) -> tuple[Estimate, float, float]:
    """One simulated calibration that starts from the design, and the seconds (wall, processor) of its estimate."""
    with tempfile.TemporaryDirectory() as folder:
        recording = open_recording(write(Path(folder) / "r.mcap", simulate(FURNISHED, setup, truth, seed)))
        beams, _ = gather([recording], one_place=True)
    mount, start = mount_of(setup)
    begin, begin_busy = time.perf_counter(), time.process_time()
    found = estimate(beams, mount, start)
    return found, time.perf_counter() - begin, time.process_time() - begin_busy


def mount_of(setup: Setup) -> tuple[Mount, Floats]:
    """The design of a simulated scanner."""
    angles = designed(setup)
    return Mount.of(angles), start_vector(angles)


def designed(setup: Setup) -> AngleSet:
    """The angle set that a simulated scanner was built from."""
    (alpha_rot, beta_rot), (alpha_laser, beta_laser) = setup.rot_deg, setup.laser_deg
    angles = Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha_laser, beta_laser=beta_laser)
    return AngleSet(task="simulated", angles_deg=angles, sensor="any", servo="MX-64R")


if __name__ == "__main__":
    main()
