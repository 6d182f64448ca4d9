"""Whether the stated errors of J hold, and whether anything beats the reported optima: what would break is printed.

    uv run python -m benchmarks.design.claims [errors] [optima] [evolution] [--pairs 300] [--draws 100000]
        [--tasks NAME...] [--random 100] [--first 0] [--seed 1]

Errors: random tasks at random settings (bands, cones, rectangles on planes, fine maps, masks of meshes, scenes; regions
down to a thousandth of a degree, balls of 0.3 to 15 degrees; all motions and objectives), against
`design.objective.counted`, which shares no code with the program.
Optima: settings drawn at random from the ranges of each shipped task, and scipy's `differential_evolution`. All are
looked at roughly, the best of them with all nodes.
Evolution: as many random tasks as asked for, the optimum of each against 500 evaluations of `differential_evolution`.
Every pair and every random task has a number, so `--first` goes on where another run stopped.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from scipy.optimize import differential_evolution

from scanwright.design.arrays import Array
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import TaskError
from scanwright.design.objective.counted import Counted, counted_J
from scanwright.design.objective.problem import Problem, problem_of
from scanwright.design.objective.score import Score, score
from scanwright.design.objective.stated_error import error_words
from scanwright.design.scene.surface import Surface, cell_directions
from scanwright.design.search.constraints import Requirements
from scanwright.design.search.families import EQUAL, Family
from scanwright.design.search.search import search
from scanwright.design.task.angle_ranges import NAMES, AngleRanges
from scanwright.design.task.task import Limits, LoadedTask, Task, load_task, shipped_tasks

SMALL_ERROR = 1e-3  # what most scores state at the default
SENSORS = ("UTM-30LX", "URG-04LX", "UST-20LX", "LMS 200")
PERIODS_S = 1.0, 60.0
BALLS_DEG = 0.3, 15.0
OBJECTIVES = {"log": 0.5, "required": 0.15, "kl": 0.1, "homogeneity": 0.15, "worst": 0.1}
FIELDS = {"metres": 0.15, "painted": 0.35, "tiny": 0.15, "map": 0.15, "mesh mask": 0.1, "scene": 0.1}
MOTIONS = {"spin": 0.7, "sweep": 0.15, "stop_and_go": 0.15}
EMPTY_TASK: dict[str, Any] = {
    "name": "random",
    "sensor": "UTM-30LX",
    "servo": "MX-64R",
    "slip_ring": "UH1256-02-0610-06S",
    "motion": {"period_s": 1.0},
}
LOOKS = ((120, 1000), (1215, 30))  # quadrature nodes, and how many of the settings are looked at again
GENERATIONS = 40
POPULATION = 15  # of the evolution, times the angles that are free
EVALUATIONS = 500  # of the evolution against a random task


@dataclass(frozen=True, slots=True)
class Claim:
    """One stated error beside the true one. `task` is what it needs to be repeated."""

    task: dict[str, Any]
    angles_deg: tuple[float, ...]
    score: Score
    truth: Counted

    @property
    def off(self) -> float:
        """Distance from the reference, less what the reference itself may be off."""
        return max(0.0, abs(self.score.J - self.truth.J) - self.truth.J_error)

    @property
    def kept(self) -> bool:
        """Whether the stated error holds."""
        return self.off <= self.score.J_error


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
    def beaten_by(self) -> float:
        """How far the best rival lies below the optimum, beyond both stated errors; at most 0 where none does."""
        own = self.best.score
        return max((own.J - own.J_error - rival.J - rival.J_error for _, rival in self.rivals.values()), default=0.0)


def random_claim(rng: np.random.Generator, largest_ball_deg: float = BALLS_DEG[1]) -> Claim:
    """A task out of the blue, one of its settings, and what the program says of it."""
    while True:
        loaded = random_task(rng, largest_ball_deg)
        low, high = np.array([AngleRanges().limits(name) for name in NAMES]).T
        angles_deg = rng.uniform(low, high)
        if rng.random() < 0.3:  # where edges, poles and lines meet
            angles_deg = np.clip(np.round(angles_deg / 15) * 15, low, high)
        angles = np.radians(angles_deg)
        try:
            found = score(problem_of(loaded), angles)
        except TaskError:  # the mask hides the whole region
            continue
        if np.isfinite(found.J):
            truth = counted_J(loaded, angles, int(rng.integers(1 << 30)))
            return Claim(loaded.task.model_dump(mode="json"), tuple(angles_deg.tolist()), found, truth)


def random_task(rng: np.random.Generator, largest_ball_deg: float) -> LoadedTask:
    """A task of any kind, with one to three regions, and a mask in every other one."""
    motion, field, objective = (_drawn(rng, kinds) for kinds in (MOTIONS, FIELDS, OBJECTIVES))
    density: dict[str, Any] = {"ball_radius_deg": _log_uniform(rng, BALLS_DEG[0], largest_ball_deg)}
    density |= {"objective": objective}
    if objective == "required":
        density |= {"required": _log_uniform(rng, 1.0, 300.0)}
    smallest = 1e-3 if field == "tiny" else 3.0
    weight = [_region(rng, smallest) | {"value": rng.uniform(0.1, 1)} for _ in range(rng.integers(1, 4))]
    mask = [_region(rng, 3.0, largest=0.3)] if rng.random() < 0.5 else []
    maps, surface = [], None
    if field == "metres":
        weight = [_on_plane(rng) | {"value": rng.uniform(0.1, 1)} for _ in weight]
        mask = [_on_plane(rng) for _ in mask]
    if field == "map":
        weight = [*weight[1:], {"shape": "map", "file": "drawn.npy", "value": 1.0}]
        maps = [_table(rng)]
    elif field == "mesh mask":
        mask = [{"shape": "map", "file": "cast.npy"}]
        maps = [(_table(rng) > 1.0).astype(float)]
    elif field == "scene":
        surface = _room(rng)
        middle = rng.uniform(-2, 2, 3)
        size = _log_uniform(rng, 0.5, 4.0)
        weight += [{"shape": "box", "min_m": (middle - size).tolist(), "max_m": (middle + size).tolist()}]
    table = EMPTY_TASK | {
        "sensor": str(rng.choice(SENSORS)),
        "motion": _motion(rng, motion),
        "density": density,
        "weight": weight,
        "mask": mask,
    }
    if surface is not None:
        table |= {"scene": {"file": "room.stl", "sensor_m": [0, 0, 0]}}
    return LoadedTask(Task.model_validate(table), Path(), load_catalogue(), tuple(maps), surface)


def contest(problem: Problem, ranges: AngleRanges, draws: int, generations: int, seed: int) -> Contest:
    """The search of a task against settings drawn at random, if any are, and against evolution."""
    found = search(problem, ranges)
    low, high = np.array([ranges.limits(name) for name in NAMES]).T
    free = high > low
    required = Requirements(problem, Limits(), ranges.holes == "avoid" and found.least_blind is None)

    def J(moved: Array) -> float:
        setting = low.copy()
        setting[free] = moved
        return required.J(setting, LOOKS[0][0])

    bounds = np.column_stack([low, high])[free]
    evolved = differential_evolution(
        J, bounds, maxiter=generations, popsize=POPULATION, tol=1e-6, polish=False, rng=seed
    )
    setting = low.copy()
    setting[free] = evolved.x
    rivals = {}
    if draws:
        drawn = np.random.default_rng(seed).uniform(low, high, (draws, 4))
        rivals[f"{draws:,} random settings"] = best_of(required, drawn)
    at_evolved = required.score(setting)
    if at_evolved is not None:
        rivals[f"differential evolution, {evolved.nfev:,} settings"] = (setting, at_evolved)
    J_found = np.sort([family.score.J for family in found.best])
    return Contest(found.best[0], rivals, once=bool((np.diff(J_found) > EQUAL).all()))


def best_of(required: Requirements, settings_deg: Array) -> tuple[Array, Score]:
    """The best of many settings that are no refused ones: all looked at roughly, the best more closely, then scored."""
    left = settings_deg
    for nodes, kept in LOOKS:
        J = [required.J(setting, nodes) for setting in left]
        left = left[np.argsort(J)[:kept]]
    scores = [score(required.problem, setting) for setting in np.radians(left)]
    best = int(np.argmin([s.J if required.keeps(s, at) else np.inf for s, at in zip(scores, left, strict=True)]))
    return left[best], scores[best]


def main() -> None:
    """Print what holds and what does not."""
    parser = argparse.ArgumentParser()
    parser.add_argument("what", nargs="*", default=["errors", "optima"])
    parser.add_argument("--pairs", type=int, default=300)
    parser.add_argument("--draws", type=int, default=100_000)
    parser.add_argument("--tasks", nargs="*", default=shipped_tasks())
    parser.add_argument("--random", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    if "errors" in asked.what:
        print_errors(range(asked.first, asked.pairs), asked.seed)
    if "optima" in asked.what:
        for name in asked.tasks:
            print_contest(load_task(Path(name)), asked.draws, asked.seed)
    if "evolution" in asked.what:
        print_evolution(range(asked.first, asked.random), asked.seed)


def print_errors(pairs: range, seed: int) -> None:
    """Each broken claim with all that repeats it, then the sum of all."""
    claims = []
    for i in pairs:
        claims.append(random_claim(np.random.default_rng([seed, i])))
        if not claims[-1].kept:
            print(f"BROKEN pair {i}, off by {claims[-1].off:.1e}: {claims[-1]}", flush=True)
        if (i + 1) % 25 == 0:
            print(f"{i + 1} pairs, {sum(not claim.kept for claim in claims)} broken", flush=True)
    stated = np.array([claim.score.J_error for claim in claims])
    off = np.array([claim.off for claim in claims])
    print(f"stated errors kept: {sum(claim.kept for claim in claims)} of {len(pairs)}")
    large = int((stated > SMALL_ERROR).sum())
    print(f"stated: median {np.median(stated):.1e}, largest {stated.max():.1e}, above {SMALL_ERROR:g} in {large} pairs")
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
    verdict = "BEATEN" if result.beaten_by > 0 else "unbeaten"
    once = "each family once" if result.once else "A FAMILY TWICE"
    print(f"{loaded.task.name}: {verdict}, {once}")
    print(f"  {best.angles_deg}: J = {best.score.J:.6f} +- {error_words(best.score.J, best.score.J_error)} {best.word}")
    for name, (setting, rival) in result.rivals.items():
        print(
            f"  {setting.round(2).tolist()}: J = {rival.J:.6f} +- {error_words(rival.J, rival.J_error)} {name}",
            flush=True,
        )


def print_evolution(tasks: range, seed: int) -> None:
    """Random tasks whose optimum evolution beats, with all that repeats them, then how many."""
    beaten = refused = 0
    for i in tasks:
        rng = np.random.default_rng([seed, i])
        loaded = random_task(rng, BALLS_DEG[1])
        generations = EVALUATIONS // (POPULATION * len(NAMES)) - 1
        try:
            result = contest(problem_of(loaded), loaded.task.angles, 0, generations, i)
        except TaskError as error:
            refused += 1
            print(f"task {i} refused: {error}", flush=True)
            continue
        beaten += result.beaten_by > 0
        word = f"BEATEN by {result.beaten_by:.1e}" if result.beaten_by > 0 else "unbeaten"
        best, task = result.best.score, loaded.task
        print(
            f"task {i}, {task.motion.mode}, {task.density.objective}: "
            f"{best.J:.5f} +- {error_words(best.J, best.J_error)} {word}",
            flush=True,
        )
        if result.beaten_by > 0:
            print(f"  {result} {task.model_dump(mode='json')}", flush=True)
    print(f"evolution of {EVALUATIONS} settings beats the optimum of {beaten} of {len(tasks) - refused} random tasks")


def _drawn(rng: np.random.Generator, kinds: dict[str, float]) -> str:
    return str(rng.choice(list(kinds), p=list(kinds.values())))


def _motion(rng: np.random.Generator, mode: str) -> dict[str, Any]:
    period_s = _log_uniform(rng, *PERIODS_S)
    if mode == "sweep":
        lower, upper = np.sort(rng.uniform(-150, 150, 2)).tolist()
        return {"mode": mode, "limits_deg": [lower, upper], "period_s": 2.0 + period_s, "accel_deg_s2": 900.0}
    if mode == "stop_and_go":
        return {"mode": mode, "stops": int(_log_uniform(rng, 10, 700)), "dwell_s": _log_uniform(rng, 0.03, 0.5)}
    # a turn of whole lines, as most people take, in every other task
    return {"period_s": float(round(period_s)) if rng.random() < 0.5 else period_s}


def _region(rng: np.random.Generator, smallest_deg: float, largest: float = 1.0) -> dict[str, Any]:
    """A band or a cone, at most a share of all that there is."""
    if rng.random() < 0.5:
        axis = np.round(rng.normal(size=3), int(rng.integers(0, 3))) + np.array([0.0, 0.0, 1e-3])
        half = _log_uniform(rng, smallest_deg, 180 * largest)
        return {"shape": "cone", "axis": axis.tolist(), "half_angle_deg": half}
    if smallest_deg < 1:
        theta, phi = rng.uniform(0, 170), rng.uniform(-180, 180)
        high, wide = (_log_uniform(rng, smallest_deg, 10) for _ in range(2))
        return {"shape": "band", "theta_deg": [theta, theta + high], "phi_deg": [phi, phi + wide]}
    low, high = np.sort(rng.uniform(0, 180, 2))
    phi, width = rng.uniform(-180, 180), rng.uniform(5, 360 * largest)
    return {"shape": "band", "theta_deg": [low, low + largest * (high - low)], "phi_deg": [phi, phi + width]}


def _on_plane(rng: np.random.Generator) -> dict[str, Any]:
    """A rectangle of ground, ceiling or wall, from a hand's breadth to a field."""
    while True:
        size = [_log_uniform(rng, 0.02, 30) for _ in range(2)]
        region: dict[str, Any] = {"shape": str(rng.choice(["ground", "ceiling", "wall"])), "width_m": size[0]}
        region |= {"height_m": _log_uniform(rng, 0.1, 2), "heading_deg": rng.uniform(-180, 180)}
        if region["shape"] == "wall":
            bottom = rng.uniform(-1, 2)
            region |= {"distance_m": _log_uniform(rng, 0.3, 30), "bottom_m": bottom, "top_m": bottom + size[1]}
        else:
            start = rng.uniform(-5, 5)
            region |= {"from_m": start, "to_m": start + size[1]}
            region |= {"ceiling_m": 2 + _log_uniform(rng, 0.1, 5)} if region["shape"] == "ceiling" else {}
        with suppress(ValidationError):  # too thin to be aimed at
            Task.model_validate(EMPTY_TASK | {"weight": [region]})
            return region


def _table(rng: np.random.Generator) -> Array:
    """Weights of cells: patches of a few cells and of many, zero elsewhere."""
    rows = int(rng.choice([18, 45, 90, 180, 360]))
    theta, phi = np.meshgrid(np.arange(rows) + 0.5, np.arange(2 * rows) + 0.5, indexing="ij")
    table = np.zeros(theta.shape)
    for _ in range(rng.integers(1, 5)):
        row, column, size = rng.uniform(0, rows), rng.uniform(0, 2 * rows), _log_uniform(rng, 1.0, rows / 2)
        away = np.hypot(theta - row, (phi - column + rows) % (2 * rows) - rows)
        table += rng.uniform(0.5, 2) * (away < size)
    return table


def _room(rng: np.random.Generator) -> Surface:
    """What the rays would hit in a box about the scanner, in closed form."""
    low, high = -rng.uniform(0.5, 4, 3), rng.uniform(0.5, 4, 3)
    d = cell_directions(float(rng.choice([1.0, 2.0])))
    with np.errstate(divide="ignore"):
        to_walls = np.where(d > 0, high / d, np.where(d < 0, low / d, np.inf))
    range_m = to_walls.min(axis=2)
    facing = np.take_along_axis(np.abs(d), to_walls.argmin(axis=2)[..., None], axis=2)[..., 0]
    return Surface(d, range_m, np.arccos(facing), range_m[..., None] * d)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


if __name__ == "__main__":
    main()
