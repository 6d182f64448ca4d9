"""Is registration as wrong as it says? Squared errors in stated sigmas, over random rooms, noises, turns and scanners.

    uv run python -m benchmarks.firmware_io.registration_errors [pairs in each cell, 100] [turn in s: 2, 18; both]

Two stands in a room of random size with eight random boxes, a start some 3 cm and 0.1 deg off, and `align` as
`scanwright register` calls it; rooms that it refuses (their far walls resist a slide too little) are counted and
replaced. Where the calibration is off, its four errors are drawn from the covariance that the
angle set states, are the same in both scans, and the clouds are assembled without them. The mean over n pairs of
`e C^-1 e` is chi-square of 6 n over n; the band holds all cells at once with 95 %. The simulator shares no code with
the registration.
"""

from __future__ import annotations

import sys
from itertools import count, islice, product

import numpy as np
from scipy.stats import chi2

from benchmarks.firmware_io.registration import Boxes, cast, distances, motion, shell
from scanwright.design import frames
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.arrays import Floats
from scanwright.firmware_io.registration.pairwise import align
from scanwright.firmware_io.registration.sensor_view import SensorView, make_view

SPACING_M = 0.1
LINES = {2: 80, 18: 720}
"""Scans in one turn of so many seconds, at 40 Hz."""
NOISES_M = (0.005, 0.03)
SIGMAS = np.array([*np.radians([0.05, 0.05]), 0.5e-3, 0.5e-3])
"""Of the calibration: tilt about x and y [rad], offset along them [m]."""
WORST = 40
BETA, ALPHA = 1.0, 1.08
"""Of the laser [rad]; the axis is upright."""


def main() -> None:
    """Print a row for each cell."""
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    turns = [int(word) for word in sys.argv[2:]] or list(LINES)
    every = len(LINES) * len(NOISES_M) * 2
    low, high = chi2.ppf([0.025 / every, 1 - 0.025 / every], 6 * pairs) / pairs
    print(f"{pairs} pairs in each cell; squared error in sigmas, mean of {low:.2f} to {high:.2f}, none above {WORST}:")
    print("turn  noise  calibration off  mean   worst  median error, stated sigma")
    for seconds, noise_m, off in product(turns, NOISES_M, (False, True)):
        found = (one_pair(seed, LINES[seconds], noise_m, off=off) for seed in count())
        squared, error_mm, sigma_mm = np.array(list(islice(filter(None, found), pairs))).T
        fine = low <= squared.mean() <= high and squared.max() <= WORST
        print(
            f"{seconds:2} s  {1e3 * noise_m:3.0f} mm  {'0.05 deg' if off else 'no':>15}  {squared.mean():5.2f}  "
            f"{squared.max():5.1f}  {np.median(error_mm):.3f} mm, {np.median(sigma_mm):.3f} mm"
            f"{'' if fine else '  OUTSIDE'}",
            flush=True,
        )


def one_pair(seed: int, lines: int, noise_m: float, *, off: bool) -> tuple[float, float, float] | None:
    """Squared error in sigmas, error and stated sigma of the position [mm]; None where the pair is refused."""
    rng = np.random.default_rng(seed)
    truth, (a, b) = two_views(rng, lines, noise_m, off=off)
    turn, shift = rng.normal(0, np.radians(0.06), 3), rng.normal(0, 0.017, 3)
    pair = align(a, b, truth @ frames.rigid(frames.rotvec_to_matrix(turn), shift))
    if pair.why_not:
        print(f"room {seed}: refused: {'; '.join(pair.why_not)}")
        return None
    error = motion(truth, pair.T_a_b)
    squared = float(error @ np.linalg.solve(pair.covariance, error))
    return squared, distances(truth, pair.T_a_b)[0], 1e3 * float(np.sqrt(pair.covariance[3:, 3:].trace()))


def two_views(
    rng: np.random.Generator, lines: int, noise_m: float, *, off: bool, beams: int = 1081
) -> tuple[Floats, tuple[SensorView, SensorView]]:
    """Pose of the second stand in the first one's frame, and both as the registration takes them."""
    boxes = random_room(rng)
    wrong = rng.normal(0, SIGMAS) if off else np.zeros(4)
    scanner = AngleSet(
        task="benchmark",
        source="calibration",
        angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=np.degrees(ALPHA), beta_laser=np.degrees(BETA)),
        sensor="UTM-30LX",
        servo="MX-64R",
        covariance=tuple(tuple(row) for row in np.diag(SIGMAS**2).tolist()),
    )
    R = frames.Rz(rng.uniform(-np.pi, np.pi))
    one = frames.rigid(R, [*rng.uniform(-0.7, 0.7, 2), rng.uniform(0.8, 1.2)])
    moved = frames.rotvec_to_matrix(rng.normal(0, 0.05, 3))
    other = frames.rigid(R @ moved, one[:3, 3] + rng.normal(0, [0.4, 0.4, 0.1]))
    views = []
    for name, T in (("a", one), ("b", other)):
        points_m, joint_rad = faulty_scan(rng, boxes, T, lines, beams, noise_m, wrong)
        views.append(make_view(name, points_m, SPACING_M, *((scanner, joint_rad) if off else ())))
    return np.linalg.inv(one) @ other, (views[0], views[1])


def random_room(rng: np.random.Generator) -> Boxes:
    """A room of 6 to 24 m by 5 to 16 m with up to eight boxes on its floor, none where the stands are."""
    x, y, z = rng.uniform(3, 12), rng.uniform(2.5, 8), rng.uniform(2.3, 5)
    size = rng.uniform([0.4, 0.4, 0.5], [2, 2, min(3, z - 0.2)], (8, 3))
    low = np.column_stack([rng.uniform(-x, x, 8), rng.uniform(-y, y, 8), np.zeros(8)])
    far = np.abs((low + size / 2)[:, :2]).max(axis=1) > 1.8
    return np.concatenate([shell(x, y, z), np.stack([low, low + size], axis=1)[far]])


def faulty_scan(
    rng: np.random.Generator, boxes: Boxes, T_world: Floats, lines: int, beams: int, noise_m: float, wrong: Floats
) -> tuple[Floats, Floats]:
    """One turn about z, placed as if nothing were wrong: points (n, 3) and axis angles (n,)."""
    joint = np.repeat(np.arange(lines) * (2 * np.pi / lines), beams)
    bearing = np.tile(np.radians(np.linspace(-135, 135, beams)), lines)
    in_plane = np.column_stack([np.cos(bearing), np.sin(bearing), np.zeros(joint.size)])
    designed = frames.Ry(BETA) @ frames.Rx(ALPHA)
    true = frames.rotvec_to_matrix(np.array([wrong[0], wrong[1], 0.0])) @ designed
    direction = _turned(joint, in_plane @ true.T) @ T_world[:3, :3].T
    lever = _turned(joint, np.broadcast_to([wrong[2], wrong[3], 0.0], in_plane.shape))
    range_m = cast(boxes, frames.apply(T_world, lever), direction) + rng.normal(0, noise_m, joint.size)
    seen = (range_m > 0.1) & (range_m < 30)
    points = _turned(joint, in_plane @ designed.T) * range_m[:, None]
    return points[seen], joint[seen]


def _turned(angle_rad: Floats, rows: Floats) -> Floats:
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    x, y, z = rows.T
    return np.column_stack([cosine * x - sine * y, sine * x + cosine * y, z])


if __name__ == "__main__":
    main()
