"""Whether the stated errors of J hold, and whether anything beats the reported optima: what would break is printed.

    uv run python -m benchmarks.design.claims [errors] [optima] [--pairs 300] [--draws 100000] [--tasks NAME...]
        [--seed 1]

Errors: random tasks at random settings, against the reference of `design.accuracy.methods`, which shares no
quadrature with the program. That reference is for turning scanners and objectives of one mean, `log` and `required`.
Optima: settings drawn at random from the ranges of each shipped task, and scipy's `differential_evolution`. All are
looked at roughly, the best of them with all nodes.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution

from design.accuracy.methods import Reference, reference
from design.arrays import Array
from design.catalogue.catalogue import load_catalogue
from design.errors import TaskError
from design.objective.problem import Problem, problem_of
from design.objective.score import Score, quick_J, score
from design.search.families import EQUAL, Family
from design.search.search import search
from design.task.task import NAMES, AngleRanges, LoadedTask, Task, load_task, shipped_tasks

MOST_ERROR = 1e-3  # that a score may state at the default
SENSORS = ("UTM-30LX", "URG-04LX", "UST-20LX", "LMS 200")
PERIODS_S = 1.0, 60.0
BALLS_DEG = 0.5, 10.0
LOOKS = ((120, 1000), (1215, 30))  # quadrature nodes, and how many of the settings are looked at again
GENERATIONS = 40


@dataclass(frozen=True, slots=True)
class Claim:
    """One stated error beside the true one. `task` is what it needs to be repeated."""

    task: dict[str, Any]
    angles_deg: tuple[float, ...]
    score: Score
    truth: Reference

    @property
    def off(self) -> float:
        """Distance from the reference, less what the reference itself may be off."""
        return max(0.0, abs(self.score.J - self.truth.J) - self.truth.J_error)

    @property
    def kept(self) -> bool:
        """Whether the stated error holds and is small."""
        return self.off <= self.score.J_error <= MOST_ERROR


@dataclass(frozen=True, slots=True)
class Contest:
    """The optimum of a task beside the best of others.

    Attributes:
        best: of the search.
        rivals: best setting [deg] and score of each kind of rival.
        once: whether no two families have the same J.
    """

    best: Family
    rivals: dict[str, tuple[Array, Score]]
    once: bool

    @property
    def unbeaten(self) -> bool:
        """Whether no rival is better by more than both stated errors."""
        own = self.best.score
        return all(rival.J + rival.J_error >= own.J - own.J_error for _, rival in self.rivals.values())


def random_claim(rng: np.random.Generator, largest_ball_deg: float = BALLS_DEG[1]) -> Claim:
    """A task out of the blue, one of its settings, and what the program says of it."""
    while True:
        table = random_task(rng, largest_ball_deg)
        try:
            problem = problem_of(LoadedTask(Task.model_validate(table), Path(), load_catalogue(), ()))
            break
        except TaskError:  # the mask hides the whole region
            continue
    low, high = np.array([AngleRanges().limits(name) for name in NAMES]).T
    angles_deg = rng.uniform(low, high)
    if rng.random() < 0.3:  # where edges, poles and lines meet
        angles_deg = np.clip(np.round(angles_deg / 15) * 15, low, high)
    angles = np.radians(angles_deg)
    return Claim(table, tuple(angles_deg.tolist()), score(problem, angles), reference(problem, angles))


def random_task(rng: np.random.Generator, largest_ball_deg: float) -> dict[str, Any]:
    """A task with one to three regions, and a mask in every other one."""
    density: dict[str, Any] = {"ball_radius_deg": _log_uniform(rng, BALLS_DEG[0], largest_ball_deg)}
    if rng.random() < 0.2:
        density |= {"objective": "required", "required": _log_uniform(rng, 1.0, 300.0)}
    period_s = _log_uniform(rng, *PERIODS_S)
    if rng.random() < 0.5:  # a turn of whole lines, as most people take
        period_s = float(round(period_s))
    return {
        "name": "random",
        "sensor": str(rng.choice(SENSORS)),
        "servo": "MX-64R",
        "slip_ring": "UH1256-02-0610-06S",
        "motion": {"period_s": period_s},
        "density": density,
        "weight": [_region(rng) | {"value": rng.uniform(0.1, 1)} for _ in range(rng.integers(1, 4))],
        "mask": [_region(rng, largest=0.3)] if rng.random() < 0.5 else [],
    }


def contest(problem: Problem, ranges: AngleRanges, draws: int, generations: int, seed: int) -> Contest:
    """The search of a task against settings drawn at random and against evolution."""
    found = search(problem, ranges)
    low, high = np.array([ranges.limits(name) for name in NAMES]).T
    drawn = np.random.default_rng(seed).uniform(low, high, (draws, 4))
    free = high > low

    def J(moved: Array) -> float:
        setting = low.copy()
        setting[free] = moved
        return quick_J(problem, np.radians(setting), LOOKS[0][0])

    bounds = np.column_stack([low, high])[free]
    evolved = differential_evolution(J, bounds, maxiter=generations, tol=1e-6, polish=False, rng=seed)
    setting = low.copy()
    setting[free] = evolved.x
    J_found = np.sort([family.score.J for family in found.best])
    return Contest(
        best=found.best[0],
        rivals={
            f"{draws:,} random settings": best_of(problem, drawn),
            f"differential evolution, {evolved.nfev:,} settings": (setting, score(problem, np.radians(setting))),
        },
        once=bool((np.diff(J_found) > EQUAL).all()),
    )


def best_of(problem: Problem, settings_deg: Array) -> tuple[Array, Score]:
    """The best of many settings: all looked at roughly, the best of them more closely, the last few scored."""
    left = settings_deg
    for nodes, kept in LOOKS:
        J = [quick_J(problem, setting, nodes) for setting in np.radians(left)]
        left = left[np.argsort(J)[:kept]]
    scores = [score(problem, setting) for setting in np.radians(left)]
    best = int(np.argmin([s.J for s in scores]))
    return left[best], scores[best]


def main() -> None:
    """Print what holds and what does not."""
    parser = argparse.ArgumentParser()
    parser.add_argument("what", nargs="*", default=["errors", "optima"])
    parser.add_argument("--pairs", type=int, default=300)
    parser.add_argument("--draws", type=int, default=100_000)
    parser.add_argument("--tasks", nargs="*", default=shipped_tasks())
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    if "errors" in asked.what:
        print_errors(asked.pairs, asked.seed)
    if "optima" in asked.what:
        for name in asked.tasks:
            print_contest(load_task(Path(name)), asked.draws, asked.seed)


def print_errors(pairs: int, seed: int) -> None:
    """Each broken claim with all that repeats it, then the sum of all."""
    claims = []
    for i in range(pairs):
        claims.append(random_claim(np.random.default_rng([seed, i])))
        if not claims[-1].kept:
            print(f"BROKEN pair {i}, off by {claims[-1].off:.1e}: {claims[-1]}", flush=True)
        if (i + 1) % 25 == 0:
            print(f"{i + 1} pairs, {sum(not claim.kept for claim in claims)} broken", flush=True)
    stated = np.array([claim.score.J_error for claim in claims])
    off = np.array([claim.off for claim in claims])
    print(f"stated errors kept and at most {MOST_ERROR:g}: {sum(c.kept for c in claims)} of {pairs}")
    print(f"stated: median {np.median(stated):.1e}, largest {stated.max():.1e}")
    share = (off / stated).max()
    print(f"true:   median {np.median(off):.1e}, largest {off.max():.1e}, at most {share:.2f} of the stated")
    truths = np.array([claim.truth.J_error for claim in claims])
    unsure = int((truths > stated).sum())
    print(f"the reference's own error: largest {truths.max():.1e}, above the stated one in {unsure} pairs", flush=True)


def print_contest(loaded: LoadedTask, draws: int, seed: int) -> None:
    """The optimum of a task and its rivals."""
    ranges = loaded.task.angles
    if all(len(ranges.grid_deg(name)) == 1 for name in NAMES):
        print(f"{loaded.task.name}: fixes all four angles, nothing to beat", flush=True)
        return
    result = contest(problem_of(loaded), ranges, draws, GENERATIONS, seed)
    best = result.best
    verdict = "unbeaten" if result.unbeaten else "BEATEN"
    once = "each family once" if result.once else "A FAMILY TWICE"
    print(f"{loaded.task.name}: {verdict}, {once}")
    print(f"  {best.angles_deg}: J = {best.score.J:.6f} +- {best.score.J_error:.0e} {best.word}")
    for name, (setting, rival) in result.rivals.items():
        print(f"  {setting.round(2).tolist()}: J = {rival.J:.6f} +- {rival.J_error:.0e} {name}", flush=True)


def _region(rng: np.random.Generator, largest: float = 1.0) -> dict[str, Any]:
    """A band or a cone, at most a share of all that there is."""
    if rng.random() < 0.5:
        axis = rng.normal(size=3)
        return {"shape": "cone", "axis": axis.tolist(), "half_angle_deg": _log_uniform(rng, 3.0, 180 * largest)}
    theta = np.sort(rng.uniform(0, 180, 2))
    theta[1] = theta[0] + largest * (theta[1] - theta[0])
    phi = rng.uniform(-180, 180)
    width = rng.uniform(5, 360 * largest)
    return {"shape": "band", "theta_deg": theta.tolist(), "phi_deg": [phi, phi + width]}


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


if __name__ == "__main__":
    main()
