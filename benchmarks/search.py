"""What the exhaustive search costs, beside the two honest brute forces, from one run on one machine.

    uv run python -m benchmarks.search [TASK]

Brute force A: one ball search per setting (scipy cKDTree on the simulated scan, all cores).
Brute force B: one ball map per scan plane (as A, on the equal-angle grid), then one weighted sum per axis.
Both are measured on a few settings and multiplied; nobody waits for the rest.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from design.objective import score
from design.objectives import log_density
from design.oracle import scan_tree
from design.problem import problem_of
from design.search import search
from design.sphere import equal_angle_grid, weighted_samples
from design.task import load_task

RUNS = 3


def main() -> None:
    """Print the figures."""
    loaded = load_task(Path(sys.argv[1] if len(sys.argv) > 1 else "ground_ahead"))
    problem = problem_of(loaded)
    setting = np.radians([0.0, -55.0, -80.0, 75.0])
    score(problem, setting)
    search(problem, loaded.task.angles)  # compiles

    results = [search(problem, loaded.task.angles) for _ in range(RUNS)]
    ours = float(np.median([r.seconds for r in results]))
    covered = results[0].covered

    chord = 2 * np.sin(problem.ball_rad / 2)
    region = weighted_samples(problem.field, 4000)
    grid = equal_angle_grid(1.0)
    build, one, whole = [], [], []
    for _ in range(RUNS):
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

    planes = len(loaded.task.angles.grid_deg("alpha_laser")) * len(loaded.task.angles.grid_deg("beta_laser"))
    each = covered * (np.median(build) + np.median(one))
    mapped = planes * (np.median(build) + np.median(whole)) + covered * per_sum
    print(f"{loaded.task.name}: {covered:,} settings covered")
    spread = f"{min(r.seconds for r in results):.2f} .. {max(r.seconds for r in results):.2f}"
    print(f"search with rescoring and refinement   {ours:8.2f} s   (median of {RUNS}, {spread})")
    print(f"per covered setting                    {ours / covered * 1e6:8.2f} us")
    print(f"A, one ball search per setting         {each:8.0f} s   {each / ours:8.0f} x")
    print(f"B, one ball map per plane, then sums   {mapped:8.0f} s   {mapped / ours:8.0f} x")


if __name__ == "__main__":
    main()
