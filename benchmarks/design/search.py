"""What the exhaustive search costs, beside the two honest brute forces, from one run on one machine.

    uv run python -m benchmarks.design.search [TASK] [--step DEG] [--runs N]

`--step 1` covers 2.1e9 settings. Brute force A: one ball search per setting (scipy cKDTree on the simulated scan, all
cores). Brute force B: one ball map per scan plane (as A, on the equal-angle grid), then one weighted sum per axis. Both
are measured on a few settings and multiplied; nobody waits for the rest. The search is all matrix products at heart:
the run tells how much of the machine's own speed they reach, that of a plain float32 `np.matmul` of the same sizes.
For turning scanners: of a sweep each direction counts, and its products are others.
"""

from __future__ import annotations

import argparse
import resource
import time
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np

from scanwright.design.arrays import Array
from scanwright.design.objective.ball_search import scan_tree
from scanwright.design.objective.named_objectives import Moment, log_density
from scanwright.design.objective.problem import Problem, problem_of
from scanwright.design.objective.score import score
from scanwright.design.search.coarse_nodes import Circles
from scanwright.design.search.plane_axis_product import BothOrientations, both_orientations
from scanwright.design.search.search import search
from scanwright.design.sphere.directions import equal_angle_grid, weighted_samples
from scanwright.design.task.task import load_task

MATMUL_S = 3.0
SETTING_DEG = (0.0, -55.0, -80.0, 75.0)


@dataclass(slots=True)
class Products:
    """What the searches multiplied: operations, seconds of all threads, the largest (planes, nodes, axes)."""

    flops: float = 0.0
    seconds: float = 0.0
    largest: tuple[int, int, int] = (0, 0, 0)

    def counting(self, moment: Moment, g: Array, weights: Array) -> BothOrientations:
        """As `both_orientations`, each product counted and timed."""
        pair = both_orientations(moment, g, weights)
        nodes = weights.shape[1]

        def counted(piece: slice, part: slice) -> tuple[Array, Array]:
            start = time.perf_counter()
            result = pair(piece, part)
            self.seconds += time.perf_counter() - start
            rows, columns = result[0].shape
            self.flops += 2.0 * rows * nodes * columns  # even and odd parts together have as many nodes as the whole
            if rows * columns >= self.largest[0] * self.largest[2]:
                self.largest = (rows, (nodes + 1) // 2, columns)
            return result

        return counted


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("task", nargs="?", default="ground_ahead")
    parser.add_argument("--step", type=float, default=None, help="of the grid [deg], instead of the task's")
    parser.add_argument("--runs", type=int, default=3)
    asked = parser.parse_args()
    loaded = load_task(Path(asked.task))
    ranges = loaded.task.angles.model_copy(update={"step_deg": asked.step} if asked.step else {})
    problem = problem_of(loaded)
    setting = np.radians(SETTING_DEG)
    score(problem, setting)
    search(problem, loaded.task.angles)  # compiles

    results = [search(problem, ranges) for _ in range(asked.runs)]
    peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    ours = float(np.median([r.seconds for r in results]))
    covered = results[0].covered
    build, one, whole, per_sum = brute_forces(problem, setting, asked.runs)
    planes = len(ranges.grid_deg("alpha_laser")) * len(ranges.grid_deg("beta_laser"))
    each = covered * (build + one)
    mapped = planes * (build + whole) + covered * per_sum

    products = Products()
    with patch.object(Circles, "orientations", staticmethod(products.counting)):
        counted = search(problem, ranges).seconds
    machine = plain_matmul(products.largest)
    reached = products.flops / products.seconds

    print(f"{loaded.task.name}: {covered:,} settings covered, {results[0].evaluated:,} different J")
    spread = f"{min(r.seconds for r in results):.2f} .. {max(r.seconds for r in results):.2f}"
    print(f"search with rescoring and refinement   {ours:8.2f} s   (median of {asked.runs}, {spread})")
    print(f"peak memory of the process             {peak_gb:8.2f} GB")
    print(f"per covered setting                    {ours / covered * 1e9:8.3g} ns")
    print(f"A, one ball search per setting         {each:8.3g} s   {each / ours:8.3g} x")
    print(f"B, one ball map per plane, then sums   {mapped:8.3g} s   {mapped / ours:8.3g} x")
    sizes = " x ".join(str(n) for n in products.largest)
    print(f"plain float32 matmul, {sizes:17} {machine / 1e9:6.0f} Gflop/s")
    print(f"products of the search                 {reached / 1e9:6.0f} Gflop/s, {reached / machine:.0%} of it")
    plain = products.flops / machine
    work = f"{products.flops / 1e9:6.0f} Gflop, {products.seconds:.2f} s of all threads, {counted:.2f} s of search"
    print(f"products in all                        {work}")
    print(f"all that as plain matmul               {plain:8.2f} s   {plain / counted:.0%} of the search")


def brute_forces(problem: Problem, setting: Array, runs: int) -> tuple[float, float, float, float]:
    """Seconds of a scan with its tree, a ball search over the region, one over the grid, and a weighted sum."""
    chord = 2 * np.sin(problem.ball_rad / 2)
    region = weighted_samples(problem.field, 4000)
    grid = equal_angle_grid(1.0)
    build, one, whole = [], [], []
    for _ in range(runs):
        start = time.perf_counter()
        tree = scan_tree(problem, setting)
        built = time.perf_counter()
        counts = tree.query_ball_point(region.directions, chord, return_length=True, workers=-1)
        region.weights @ log_density(counts)
        searched = time.perf_counter()
        tree.query_ball_point(grid, chord, return_length=True, workers=-1)
        build.append(built - start)
        one.append(searched - built)
        whole.append(time.perf_counter() - searched)
    weights, density = np.random.default_rng(0).random((2, 200, len(grid)))
    start = time.perf_counter()
    np.einsum("ij,ij->i", weights, density)
    per_sum = (time.perf_counter() - start) / len(weights)
    return float(np.median(build)), float(np.median(one)), float(np.median(whole)), per_sum


def plain_matmul(sizes: tuple[int, int, int]) -> float:
    """Operations per second of `np.matmul` in single precision, over some seconds."""
    rows, nodes, axes = sizes
    rng = np.random.default_rng(0)
    a, b = rng.random((rows, nodes), np.float32), rng.random((nodes, axes), np.float32)
    out = np.empty((rows, axes), np.float32)
    start, done = time.perf_counter(), 0
    while time.perf_counter() < start + MATMUL_S:
        np.matmul(a, b, out=out)
        done += 1
    return 2.0 * rows * nodes * axes * done / (time.perf_counter() - start)


if __name__ == "__main__":
    main()
