"""Registration of simulated scans: error, time, drift around a building. `registration_errors` asks what is stated.

    uv run python -m benchmarks.firmware_io.registration

The peer is small_gicp as its own example uses it (`preprocess_points`, `align`) with its tolerances tightened, on the
same points in the same run, in turns. Times are those of the wall and, as other programs may run beside, of the
processor. All truths are those of the simulator, which shares no code with the registration.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import small_gicp
from numba import njit

from scanwright.design import frames
from scanwright.design.arrays import Floats
from scanwright.design.progress import no_progress
from scanwright.firmware_io.registration.pairwise import align
from scanwright.firmware_io.registration.register import register
from scanwright.firmware_io.registration.sensor_view import THREADS, make_view

ROUNDS = 7
PAIRS = 12
SPACING_M = 0.1
Boxes = Floats
"""Solid boxes, shape (m, 2, 3): lowest and highest corner [m]."""


def room() -> Boxes:
    """A room of 20 x 12 x 4 m with seven boxes in it."""
    rng = np.random.default_rng(0)
    low = np.column_stack([rng.uniform(-9, 7, 7), rng.uniform(-5, 3, 7), np.zeros(7)])
    size = np.column_stack([rng.uniform(0.5, 2, 7), rng.uniform(0.5, 2, 7), rng.uniform(0.6, 3, 7)])
    far = np.abs(low[:, :2] + size[:, :2] / 2).max(axis=1) > 1.8
    return np.concatenate([shell(10, 6, 4), np.stack([low, low + size], axis=1)[far]])


def shell(x: float, y: float, z: float) -> Boxes:
    """Floor, ceiling and four walls of a hall from (-x, -y, 0) to (x, y, z)."""
    return np.array(
        [
            [[-x - 1, -y - 1, -1], [x + 1, y + 1, 0]],
            [[-x - 1, -y - 1, z], [x + 1, y + 1, z + 1]],
            [[-x - 1, -y - 1, 0], [-x, y + 1, z]],
            [[x, -y - 1, 0], [x + 1, y + 1, z]],
            [[-x - 1, -y - 1, 0], [x + 1, -y, z]],
            [[-x - 1, y, 0], [x + 1, y + 1, z]],
        ]
    )


def building() -> tuple[Boxes, Floats]:
    """A ring of corridors with furniture around a core, and 20 stands in it, shape (20, 4, 4), that close the ring."""
    rng = np.random.default_rng(5)
    core = np.array([[[-13, -7, 0], [13, 7, 3.2]]])
    wings = np.array(
        [[[x - 0.1, y0, 0], [x + 0.1, y1, 3.2]] for x in (-9.0, 0.0, 9.0) for y0, y1 in ((-12, -10.2), (7, 8.9))]
    )
    along = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    at = np.column_stack([np.clip(22 * np.cos(along), -17.2, 17.2), np.clip(18 * np.sin(along), -11.4, 11.4)])
    at += rng.uniform(-0.4, 0.4, at.shape)
    size = rng.uniform([0.2, 0.2, 0.5], [0.9, 0.9, 2.2], (len(at), 3))
    furniture = np.stack(
        [np.column_stack([at - size[:, :2] / 2, np.zeros(40)]), np.column_stack([at + size[:, :2] / 2, size[:, 2]])], 1
    )
    walk = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    x, y = np.clip(21 * np.cos(walk), -15.2, 15.2), np.clip(15 * np.sin(walk), -9.2, 9.2)
    stands = frames.rigid(frames.Rz(rng.uniform(-np.pi, np.pi, 20)), np.column_stack([x, y, rng.uniform(0.9, 1.1, 20)]))
    return np.concatenate([shell(18, 12, 3.2), core, wings, furniture]), stands


def scan(boxes: Boxes, T_world_laser: Floats, lines: int, beams: int, seed: int, noise_m: float = 0.01) -> Floats:
    """Points of one turn about z, in the frame of the scanner, shape (n, 3); the scan plane is tilted twice."""
    psi = np.arange(lines) * (2 * np.pi / lines)
    phi = np.radians(np.linspace(-135, 135, beams))
    in_plane = np.column_stack([np.cos(phi), np.sin(phi), np.zeros(beams)]) @ (frames.Ry(1.0) @ frames.Rx(1.08)).T
    directions = (in_plane @ np.swapaxes(frames.Rz(psi), 1, 2)).reshape(-1, 3)
    range_m = cast(boxes, T_world_laser[None, :3, 3], directions @ T_world_laser[:3, :3].T)
    range_m += np.random.default_rng(seed).normal(0, noise_m, range_m.size)
    return (directions * range_m[:, None])[(range_m > 0.1) & (range_m < 30)]


@njit(cache=True, error_model="numpy")
def cast(boxes: Boxes, origins: Floats, directions: Floats) -> Floats:
    """Distance to the first box along each ray, shape (n,), inf where there is none (the slab method).

    Args:
        boxes: shape (m, 2, 3).
        origins: shape (n, 3), or (1, 3) where all rays share one.
        directions: shape (n, 3).
    """
    nearest = np.full(len(directions), np.inf)
    for i in range(len(directions)):
        origin = origins[min(i, len(origins) - 1)]
        for box in range(len(boxes)):
            enter, leave = -np.inf, np.inf
            for k in range(3):
                a = (boxes[box, 0, k] - origin[k]) / directions[i, k]
                b = (boxes[box, 1, k] - origin[k]) / directions[i, k]
                enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
            if 0 < enter < leave:
                nearest[i] = min(nearest[i], enter)
    return nearest


def main() -> None:
    """Print the figures."""
    rng = np.random.default_rng(3)
    for lines, seconds in ((720, 18), (80, 2)):
        off = []
        for seed in range(ROUNDS if lines == 720 else PAIRS):
            poses, clouds = two_stands(rng, lines, 2 * seed)
            truth = np.linalg.inv(poses[0]) @ poses[1]
            ours = timed(by_us, clouds)
            peer = timed(by_peer, clouds)
            off.append([*distances(truth, ours[0]), *ours[1:], *distances(truth, peer[0]), *peer[1:]])
        table = np.array(off[1:])  # the first one compiles
        middle, worst = np.median(table, axis=0), table.max(axis=0)
        print(f"one turn in {seconds} s, 2 x {len(clouds[0]):,} points, {len(table)} pairs: median (worst)")
        for k, name in enumerate(("scanwright", "small_gicp")):
            mm, deg, wall, cpu = middle[4 * k : 4 * k + 4]
            mm_worst, deg_worst = worst[4 * k : 4 * k + 2]
            print(
                f"  {name}  {mm:6.3f} ({mm_worst:.3f}) mm  {deg:.5f} ({deg_worst:.5f}) deg  "
                f"{wall:.2f} s of the wall, {cpu:.2f} s of {THREADS} processors"
            )
        ratio = middle[[2, 3]] / middle[[6, 7]]
        print(f"  ours / peer: {ratio[0]:.2f} of the wall, {ratio[1]:.2f} of the processor")
    boxes, stands = building()
    views = [make_view(f"{k}", scan(boxes, T, 180, 361, k), 0.15) for k, T in enumerate(stands)]
    start = time.perf_counter(), time.process_time()
    found = register(views, [], no_progress)
    wall, cpu = time.perf_counter() - start[0], time.process_time() - start[1]
    drift = [distances(np.linalg.inv(stands[0]) @ T, pose) for T, pose in zip(stands, found.T_world, strict=True)]
    mm, deg = np.max(drift, axis=0)
    used = sum(not pair.why_not for pair in found.pairs)
    print(f"building, {len(stands)} stands from no start, {used} pairs used of {len(found.pairs)} tried:")
    print(f"  at most {mm:.1f} mm and {deg:.3f} deg off, {wall:.0f} s of the wall, {cpu:.0f} s of the processor")


def two_stands(rng: np.random.Generator, lines: int, seed: int) -> tuple[list[Floats], list[Floats]]:
    """Poses of two stands in the room, some 0.6 m and 5 deg apart, and what they see."""
    moved = frames.rotvec_to_matrix(rng.normal(0, 0.05, 3))
    poses = [
        frames.rigid(frames.Rz(0.3), [0, 0, 1.0]),
        frames.rigid(frames.Rz(0.3) @ moved, np.array([0.45, 0.35, 1.1]) + rng.normal(0, 0.1, 3)),
    ]
    return poses, [scan(room(), T, lines, 1080, seed + k) for k, T in enumerate(poses)]


def by_us(a: Floats, b: Floats) -> Floats:
    """Everything: thinning, normals, alignment, verdict."""
    return align(make_view("a", a, SPACING_M), make_view("b", b, SPACING_M), np.eye(4)).T_a_b


def by_peer(a: Floats, b: Floats) -> Floats:
    """As the example of small_gicp, voxels of the same edge."""
    target, tree = small_gicp.preprocess_points(a, SPACING_M, 20, THREADS)
    source, _ = small_gicp.preprocess_points(b, SPACING_M, 20, THREADS)
    result = small_gicp.align(
        target, source, tree, num_threads=THREADS, max_iterations=50, rotation_epsilon=1e-5, translation_epsilon=1e-5
    )
    return result.T_target_source


def timed(call: Callable[[Floats, Floats], Floats], clouds: list[Floats]) -> tuple[Floats, float, float]:
    """Result, seconds of the wall, seconds of the processor."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = call(*clouds)
    return result, time.perf_counter() - wall, time.process_time() - cpu


def motion(truth: Floats, T: Floats) -> Floats:
    """Small motion (rotation vector, translation) from the truth to a pose."""
    D = np.linalg.inv(truth) @ T
    return np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1], *(2 * D[:3, 3])]) / 2


def distances(truth: Floats, T: Floats) -> tuple[float, float]:
    """What a pose is off by, in mm and deg."""
    error = motion(truth, T)
    return 1e3 * float(np.linalg.norm(error[3:])), float(np.degrees(np.linalg.norm(error[:3])))


if __name__ == "__main__":
    main()
