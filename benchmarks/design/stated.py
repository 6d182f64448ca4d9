"""How far the stated error of J is above the true one, and how often it holds: the median ratio and the coverage.

    uv run python -m benchmarks.design.stated [--tasks 300] [--nodes 2187] [--seed 1]

Random tasks of `random_tasks` that turn, at random settings: J on some nodes against J on `FINER` times as many. The
ratio counts where the true error is above `LEAST`, as below that the two rules differ by rounding.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.design.random_tasks import random_task
from scanwright.design.errors import ScanwrightError
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score_on

FINER, LEAST = 9, 2e-7


def main() -> None:
    """Print the median ratio, the coverage, and the largest share of a stated error that is true."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--tasks", type=int, default=300)
    parser.add_argument("--nodes", type=int, default=2187)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    stated, true = [], []
    for i in range(asked.tasks):
        with TemporaryDirectory() as folder:
            drawn = random_task(np.random.default_rng([asked.seed, i]), Path(folder))
        try:
            problem = problem_of(drawn.loaded)
            problem = problem.with_beams(problem.bearings_rad[drawn.beams], problem.lines, problem.sweep)
            # the error of a sweep is the spread of its sets, that of a lowest count is at least one
            if problem.sweep is not None or problem.grid_step_deg or problem.objective.name == "worst":
                continue
            rough = score_on(problem, drawn.angles_rad, asked.nodes)
            fine = score_on(problem, drawn.angles_rad, FINER * asked.nodes, stated=False)
        except ScanwrightError:
            continue
        if np.isfinite(fine.J):
            stated.append(rough.J_error)
            true.append(abs(rough.J - fine.J))
    share, measurable = np.array(true) / stated, np.array(true) > LEAST
    print(f"stated over true error: median {np.median(1 / share[measurable]):.1f} of {measurable.sum()} tasks")
    print(f"stated errors kept: {(share <= 1).sum()} of {len(share)}; the true one is at most {share.max():.2f} of it")


if __name__ == "__main__":
    main()
