"""Is calibration as wrong as it says, and does it warn when it is? Random rooms, mounts, scanners and disturbances.

    uv run python -m benchmarks.firmware_io.calibration_errors [ROOMS] [MOVED] [SEED]

ROOMS (default 200) rooms of random size, heading and furniture, mounts in turn rolling, pitching and any other, 129,600
beams of 10 mm noise in one turn, an encoder of 4096 steps with harmonics, a biased lidar, errors of the mount of up to
5 deg and 20 mm, from the one of number SEED (default 0) on. The mean of `e C^-1 e` over the four errors of the mount is
4 where the stated C is true. Then MOVED rooms each (default a quarter of ROOMS) with a platform that creeps (0.5 to 5
mm/s) or drives (20 to 200 mm/s), with one person that walks about, and with three. A verdict is false where nothing
moved, the result is right and there is a warning; missed where the result is wrong (chi-square of four above 18.5) and
there is none. Of people who were not named it says how many beams met them, and what another look could tell of that.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from benchmarks.firmware_io.calibration import MOUNT, designed, faulty
from benchmarks.firmware_io.rooms import (
    NAMES,
    Room,
    Setup,
    Truth,
    Unrest,
    random_mount,
    random_room,
    simulate,
    walked,
    write,
)
from scanwright.design.errors import ScanwrightError
from scanwright.firmware_io.calibration.calibrate import calibrate_recordings

WRONG = 18.5
BEAMS = 180
STEP_DEG = 360 / 4096
KINDS = ("creeps", "drives", "one walks", "three walk")


@dataclass(frozen=True, slots=True)
class Verdict:
    """What one calibration was off by, in squared sigmas of its four errors, and what it warned of."""

    seed: int
    square: float
    warned: tuple[str, ...]


def main() -> None:
    """Print the counts."""
    given = [int(word) for word in sys.argv[1:]]
    rooms = given[0] if given else 200
    moved = given[1] if len(given) > 1 else rooms // len(KINDS)
    first = given[2] if len(given) > 2 else 0
    still = _all([(seed, Unrest()) for seed in range(first, first + rooms)])
    squares = np.array([verdict.square for verdict in still])
    low, high = chi2.ppf([0.025, 0.975], MOUNT * len(still)) / len(still)
    print(f"{len(still)} of {rooms} rooms at rest: normalised error squared {squares.mean():.2f} on average", end="")
    print(f" (95 % band {low:.2f} to {high:.2f}), at most {squares.max():.1f}")
    false = [verdict for verdict in still if verdict.warned and verdict.square <= WRONG]
    print(
        f"  {len(false)} false warnings, {_missed(still)} of {(squares > WRONG).sum()} wrong results missed", flush=True
    )
    for verdict in false:
        print(f"    room {verdict.seed}, {verdict.square:.1f}: {'; '.join(verdict.warned)}")
    for kind in KINDS:
        found = _all([(seed, unrest(kind, seed)) for seed in range(first + rooms, first + rooms + moved)])
        wrong = sum(verdict.square > WRONG for verdict in found)
        named = sum(bool(verdict.warned) for verdict in found)
        print(f"{kind}: {named} of {len(found)} named, {_missed(found)} of {wrong} wrong results missed", flush=True)
        if unrest(kind, first).walkers:
            for verdict in found:
                if not verdict.warned:
                    met, behind = walked(*case(verdict.seed), 50_000 + verdict.seed, unrest(kind, verdict.seed))
                    print(f"    room {verdict.seed}: {met} beams met somebody, near {behind} another look went on")


def unrest(kind: str, seed: int) -> Unrest:
    """What moves, and how."""
    rng = np.random.default_rng(7000 + seed)
    heading = rng.uniform(0, 2 * np.pi)
    speed = {"creeps": 5e-4, "drives": 0.02}.get(kind, 0.0) * 10 ** rng.random()
    walkers = {"one walks": 1, "three walk": 3}.get(kind, 0)
    return Unrest(velocity_m_s=(speed * np.cos(heading), speed * np.sin(heading), 0.0), walkers=walkers)


def one(seed: int, moving: Unrest, folder: Path) -> Verdict:
    """Scan and calibrate as `scanwright calibrate` does."""
    room, setup, truth = case(seed)
    recording = write(folder / "r.mcap", simulate(room, setup, truth, 50_000 + seed, moving))
    found = calibrate_recordings([recording], designed(setup), folder / "a.json")
    x = np.array([*np.radians(found.angles.delta_rotvec_rot_deg), *np.array(found.angles.t_rot_laser_mm[:2]) / 1e3])
    off = x - [getattr(truth, name) for name in NAMES[:MOUNT]]
    square = float(off @ np.linalg.solve(np.array(found.angles.covariance), off))
    return Verdict(seed, square, tuple(found.record["notes"]))


def case(seed: int) -> tuple[Room, Setup, Truth]:
    """Room, set-up and scanner of a seed."""
    rng = np.random.default_rng(seed)
    return random_room(rng), random_mount(rng, seed, beams=BEAMS, step_deg=STEP_DEG), faulty(seed)


def _all(cases: list[tuple[int, Unrest]]) -> list[Verdict]:
    done = []
    for seed, moving in cases:
        with tempfile.TemporaryDirectory() as folder:
            try:
                done.append(one(seed, moving, Path(folder)))
            except ScanwrightError as refusal:
                print(f"room {seed}: refused: {refusal}")
    return done


def _missed(verdicts: list[Verdict]) -> int:
    return sum(verdict.square > WRONG and not verdict.warned for verdict in verdicts)


if __name__ == "__main__":
    main()
