"""Whether anything beats the optima that the search reports: settings drawn at random, and differential evolution.

All are looked at roughly, the best of them with all nodes. `benchmarks.design.claims` runs these.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from scipy.optimize import differential_evolution

from benchmarks.design.random_tasks import random_task
from scanwright.design.arrays import Array
from scanwright.design.errors import TaskError
from scanwright.design.objective.problem import Problem, problem_of
from scanwright.design.objective.score import Score, score
from scanwright.design.objective.stated_error import error_words
from scanwright.design.search.families import EQUAL, Family
from scanwright.design.search.search import search
from scanwright.design.search.space import SearchSpace
from scanwright.design.task.angle_ranges import NAMES, AngleRanges
from scanwright.design.task.task import Limits, LoadedTask

LOOKS = ((120, 1000), (1215, 30))  # quadrature nodes, and how many of the settings are looked at again
GENERATIONS = 40
POPULATION = 15  # of the evolution, times the angles that are free
MOST_LOST = 1e-3  # of J, if the task states no tolerance
MOST_GENERATIONS = 100_000  # of the evolution against a random task, which ends by its processor time


@dataclass(frozen=True, slots=True)
class Contest:
    """The optimum of a task beside the best of others.

    Attributes:
        best: of the search.
        rivals: best setting [deg] and score of each kind of rival.
        once: whether no two families have the same J.
        tolerance: of J, as the task states it.
    """

    best: Family
    rivals: dict[str, tuple[Array, Score]]
    once: bool
    tolerance: float

    @property
    def beaten_by(self) -> float:
        """How far the best rival lies below the optimum, beyond both stated errors; at most 0 where none does."""
        own = self.best.score
        return max((own.J - own.J_error - rival.J - rival.J_error for _, rival in self.rivals.values()), default=0.0)

    @property
    def verdict(self) -> str:
        """BEATEN if a rival is better by more than the tolerance of J, which the search promises."""
        word = "BEATEN" if self.beaten_by > self.tolerance else "unbeaten within its tolerance"
        return f"{word}, by {self.beaten_by:.1e}" if self.beaten_by > 0 else "unbeaten"


def contest(
    problem: Problem, ranges: AngleRanges, draws: int, generations: int, seed: int, budget_s: float = np.inf
) -> Contest:
    """Search a task, and compare the optimum with random settings, if any, and with differential evolution.

    The evolution ends after a number of generations or after `budget_s` seconds of processor time.
    """
    found = search(problem, ranges)
    low, high = np.array([ranges.limits(name) for name in NAMES]).T
    free = high > low
    space = SearchSpace(problem, ranges, Limits(), ranges.holes == "avoid" and found.least_blind is None)

    def J(moved: Array) -> float:
        setting = low.copy()
        setting[free] = moved
        return space.J(setting, LOOKS[0][0])

    bounds = np.column_stack([low, high])[free]
    end = process_time() + budget_s
    evolved = differential_evolution(
        J,
        bounds,
        maxiter=generations,
        popsize=POPULATION,
        tol=1e-6,
        polish=False,
        rng=seed,
        callback=lambda *_: process_time() > end,
    )
    setting = low.copy()
    setting[free] = evolved.x
    rivals = {}
    if draws:
        drawn = np.random.default_rng(seed).uniform(low, high, (draws, 4))
        rivals[f"{draws:,} random settings"] = best_of(space, drawn)
    at_evolved = space.score(setting)
    if at_evolved is not None:
        rivals[f"differential evolution, {evolved.nfev:,} settings"] = (setting, at_evolved)
    J_found = np.sort([family.score.J for family in found.best])
    return Contest(found.best[0], rivals, bool((np.diff(J_found) > EQUAL).all()), min(problem.tolerance, MOST_LOST))


def best_of(space: SearchSpace, settings_deg: Array) -> tuple[Array, Score]:
    """The best of many settings that are no refused ones: all looked at roughly, the best more closely, then scored."""
    left = settings_deg
    for nodes, kept in LOOKS:
        J = [space.J(setting, nodes) for setting in left]
        left = left[np.argsort(J)[:kept]]
    scores = [score(space.problem, setting) for setting in np.radians(left)]
    best = int(np.argmin([s.J if space.keeps(s, at) else np.inf for s, at in zip(scores, left, strict=True)]))
    return left[best], scores[best]


def print_contest(loaded: LoadedTask, draws: int, seed: int) -> None:
    """The optimum of a task and its rivals."""
    ranges = loaded.task.angles
    if all(len(ranges.grid_deg(name)) == 1 for name in NAMES):
        print(f"{loaded.task.name}: fixes all four angles, nothing to beat", flush=True)
        return
    result = contest(problem_of(loaded), ranges, draws, GENERATIONS, seed)
    best = result.best
    once = "each family once" if result.once else "A FAMILY TWICE"
    print(f"{loaded.task.name}: {result.verdict}, {once}")
    print(f"  {best.angles_deg}: J = {best.score.J:.6f} +- {error_words(best.score.J, best.score.J_error)} {best.word}")
    for name, (setting, rival) in result.rivals.items():
        print(
            f"  {setting.round(2).tolist()}: J = {rival.J:.6f} +- {error_words(rival.J, rival.J_error)} {name}",
            flush=True,
        )


def print_evolution(tasks: range, seed: int, budget_s: float) -> None:
    """Print random tasks whose optimum evolution beats, with all that repeats them, then how many."""
    beaten = refused = 0
    for i in tasks:
        rng = np.random.default_rng([seed, i])
        with TemporaryDirectory() as folder:
            loaded = random_task(rng, Path(folder)).loaded
        try:
            result = contest(problem_of(loaded), loaded.task.angles, 0, MOST_GENERATIONS, i, budget_s)
        except TaskError as error:
            refused += 1
            print(f"task {i} refused: {error}", flush=True)
            continue
        beaten += result.beaten_by > result.tolerance
        best, task = result.best.score, loaded.task
        print(
            f"task {i}, {task.motion.mode}, {task.density.objective}: "
            f"{best.J:.5f} +- {error_words(best.J, best.J_error)} {result.verdict} {list(result.rivals)}",
            flush=True,
        )
        if result.beaten_by > 0:
            print(f"  {result} {task.model_dump(mode='json')}", flush=True)
    print(f"evolution for {budget_s:g} s beats the optimum of {beaten} of {len(tasks) - refused} random tasks")
