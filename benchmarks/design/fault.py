"""Whether a fault of version 0.1 that is put back leaves the program: the self-check of J has to refuse its answers.

    uv run python -m benchmarks.design.fault [--tasks 200] [--seed 1]

The fault lost weight of regions with more than 64 corners: the corners were dropped as breaks of the quadrature, and a
segment stayed only if its middle circle had weight. Here nothing compares the sum of weights either, so that only the
count of `design.objective.self_check` stands between the fault and an answer.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from scanwright.design.arrays import Array
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import NumericalError, TaskError
from scanwright.design.objective.problem import Problem, problem_of
from scanwright.design.objective.score import Score, score
from scanwright.design.objective.self_check import NEAR, require_counted
from scanwright.design.scene.surface import cell_directions
from scanwright.design.sphere import polar_rule
from scanwright.design.sphere.corners import Corners, edge_corners
from scanwright.design.sphere.regions import Field
from scanwright.design.task.task import LoadedTask, Task

NO_CORNERS = Corners(np.empty((0, 3)), np.empty((0, 0)))


def random_painted(rng: np.random.Generator) -> tuple[LoadedTask, Array]:
    """A task of brush strokes on cells, or of many rectangles on the ground, and a setting."""
    weight: list[dict[str, Any]] = [{"shape": "map", "file": "strokes.npy"}]
    maps: tuple[Array, ...] = ()
    if rng.random() < 0.5:
        rows = int(rng.integers(12, 34))
        cells = cell_directions(180 / rows)
        table = np.zeros(cells.shape[:2])
        for centre in rng.normal(size=(rng.integers(2, 7), 3)):
            reach = np.cos(np.radians(rng.uniform(5, 25)))
            table[cells @ centre >= reach * np.linalg.norm(centre)] = rng.choice([0.2, 0.5, 1.0])
        maps = (table,)
    else:
        weight = [
            {"shape": "ground", "height_m": 1.0, "heading_deg": rng.uniform(-180, 180), "from_m": near}
            | {"to_m": near + rng.uniform(0.1, 3), "width_m": rng.uniform(0.1, 4), "value": rng.uniform(0.1, 1)}
            for near in rng.uniform(0.0, 3.0, rng.integers(6, 15))
        ]
    task = {"name": "painted", "sensor": "URG-04LX", "servo": "MX-64R", "motion": {"period_s": 4.0}, "weight": weight}
    loaded = LoadedTask(Task.model_validate(task), Path(), load_catalogue(), maps)
    return loaded, np.radians(rng.uniform([-180, -90, -90, -90], [180, 90, 90, 90]))


def without_many_corners(field: Field) -> Corners:
    """The corners of a region, or none of them if they are more than 64."""
    corners = edge_corners(field)
    return NO_CORNERS if len(corners.points) > polar_rule.MANY_CORNERS else corners


def faulty_score(problem: Problem, angles_rad: Array) -> Score:
    """The score of a setting with the fault put back.

    Raises:
        TaskError: the fault leaves no weight at all.
    """
    with (
        patch.object(polar_rule, "edge_corners", without_many_corners),
        patch.object(polar_rule, "is_total", lambda *_: True),
    ):
        return score(problem, angles_rad)


def main() -> None:
    """Print how many faulty answers there are, and how many are refused."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--tasks", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    wrong: dict[str, list[bool]] = {"by more than their errors": [], f"by more than {NEAR:g} beyond them": []}
    for i in range(asked.tasks):
        rng = np.random.default_rng([asked.seed, i])
        loaded, angles_rad = random_painted(rng)
        problem = problem_of(loaded)
        right = score(problem, angles_rad)
        try:
            faulty = faulty_score(problem, angles_rad)
            require_counted(loaded, angles_rad, faulty)
            refused = False
        except TaskError:  # no weight at all is left
            continue
        except NumericalError:
            refused = True
        off = abs(faulty.J - right.J) - faulty.J_error - right.J_error
        for limit, found in zip((0.0, NEAR), wrong.values(), strict=True):
            if off > limit:
                found.append(refused)
    for how, found in wrong.items():
        print(f"answers off {how}: {len(found)}, of which {sum(found)} are refused")


if __name__ == "__main__":
    main()
