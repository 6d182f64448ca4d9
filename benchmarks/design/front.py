"""Measure the front that `tolerance` and `budget_s` of a task choose from, and write `design/objective/front.csv`.

    uv run python -m benchmarks.design.front

For each number of nodes: the largest distance from the reference over the shipped tasks, random settings, turns of
2 and 18 s and balls of 1 and 2 deg, and the median time of one score. Errors that a finer rule does not undercut are
not on the front.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from scanwright.design.accuracy.reference import smooth_reference
from scanwright.design.density.beams import scan_lines
from scanwright.design.objective.problem import FRONT, Problem, problem_of
from scanwright.design.objective.score import quick_J
from scanwright.design.task.task import load_task, shipped_tasks

NODES = (243, 729, 2187, 6561, 19683, 59049, 177147)
SETTINGS = 12


def main() -> None:
    """Write the table."""
    rng = np.random.default_rng(4)
    cases: list[tuple[Problem, np.ndarray, float]] = []
    for name in shipped_tasks():
        plain = problem_of(load_task(Path(name)))
        for _ in range(SETTINGS):
            lines = scan_lines(float(rng.choice([2.0, 18.0])), 40.0)
            ball_rad = float(np.radians(rng.choice([1.0, 2.0])))
            problem = replace(plain.with_beams(plain.bearings_rad, lines), ball_rad=ball_rad)
            angles = np.radians(rng.uniform([-180, -90, -90, -90], [180, 90, 90, 90]))
            cases.append((problem, angles, smooth_reference(problem, angles).J))
    rows = []
    for nodes in NODES:
        errors, seconds = [], []
        for problem, angles, J in cases:
            start = time.perf_counter()
            got = quick_J(problem, angles, nodes)
            seconds.append(time.perf_counter() - start)
            errors.append(abs(got - J))
        rows.append((nodes, max(errors), float(np.median(seconds))))
        print(f"{nodes:8} nodes: worst error {max(errors):.1e}, {rows[-1][2]:.4f} s")
    front = [row for i, row in enumerate(rows) if all(row[1] < other[1] for other in rows[:i])]
    lines_out = ["nodes,J_error,seconds", *(f"{n},{e:.2g},{s:.2g}" for n, e, s in front)]
    FRONT.write_text("\n".join(lines_out) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
