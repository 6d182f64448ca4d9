"""Whether the stated errors of J hold, and whether anything beats the reported optima: what would break is printed.

    uv run python -m benchmarks.design.claims [errors] [stated] [optima] [evolution] [--pairs 300] [--nodes 2187]
        [--draws 100000] [--tasks NAME...] [--random 100] [--budget-s 70] [--first 0] [--seed 1] [--work 1e8]
        [--fields NAME...]

Errors: random tasks (`random_tasks`: every shape, mask, objective, quadrature, motion and lidar, written to files and
loaded from them) at random settings, against `design.objective.counted`, which shares no code with the program. The
count takes more directions until three of its standard errors are within the stated error, up to --work.
Stated: the same tasks if they turn, on `--nodes` nodes against `FINER` times as many: the median of the stated error
over the true one, where that is above `LEAST`, and the coverage.
Optima: settings drawn at random from the ranges of each shipped task, and scipy's `differential_evolution`.
Evolution: random tasks, the optimum of each against `differential_evolution` with a budget of processor time.
Every pair and every random task has a number, so `--first` goes on where another run stopped. A seed of 0 is a new one
every time.
"""

from __future__ import annotations

import argparse
import secrets
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from benchmarks.design.contests import print_contest, print_evolution
from benchmarks.design.random_tasks import FIELDS, RandomTask, random_task
from scanwright.design.arrays import Array
from scanwright.design.errors import ScanwrightError, TaskError
from scanwright.design.objective.counted import Counted, counted_J
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import Score, score, score_on
from scanwright.design.objective.self_check import require_counted
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.task.task import load_task, shipped_tasks

SMALL_ERROR = 1e-3  # what most scores state at the default
FEW = 2**12  # directions of one set of the count at first
MOST_WORK = 1e8  # directions of one set times the beams that are near to one, at most
FINER, LEAST = 9, 2e-7  # times the nodes that tell the true error; of J, below it two rules differ by rounding
SURELY_SEEN = 1e-3  # share of the directions that have a weight: more than that the program must find, too


@dataclass(frozen=True, slots=True)
class Claim:
    """One stated error beside the true one.

    Attributes:
        drawn: the task and the setting.
        score: what the program states; None where it refuses the task.
        truth: the count; None where no direction has a weight.
        refusal: why the program refuses.
        alarm: what the program's own check says of a score, if it takes it for wrong.
        took_s: the program, its own check, and the count.
    """

    drawn: RandomTask
    score: Score | None
    truth: Counted | None
    refusal: str
    alarm: str
    took_s: tuple[float, float, float]

    @property
    def off(self) -> float:
        """Distance from the count, less what the count itself may be off by."""
        if self.score is None or self.truth is None or self.score.J == self.truth.J:
            return 0.0
        return max(0.0, abs(self.score.J - self.truth.J) - self.truth.J_error)

    @property
    def kept(self) -> bool:
        """Whether the stated error holds, and a refusal is right."""
        if self.score is None or self.truth is None:
            return self.score is None and self.truth is None
        return self.off <= self.score.J_error

    @property
    def unsure(self) -> bool:
        """Whether the count is less sure than a third of the stated error."""
        return self.score is not None and self.truth is not None and self.truth.J_error > self.score.J_error

    def words(self) -> str:
        """All that there is to know of it."""
        kinds, task = ", ".join(self.drawn.kinds), self.drawn.loaded.task.model_dump(mode="json", exclude_defaults=True)
        beams = f"{int(self.drawn.beams.sum())} of {len(self.drawn.beams)} beams"
        return f"{kinds}: {self.score} {self.refusal}, counted {self.truth}, {self.drawn.angles_deg}, {beams}, {task}"


def random_claim(
    rng: np.random.Generator,
    folder: Path,
    field: str | None = None,
    *,
    small: bool = False,
    most_work: float = MOST_WORK,
) -> Claim:
    """A random task, one of its settings, what the program says of it, and what a count says.

    Args:
        rng: what it is drawn from.
        folder: where the files of the task are written.
        field: kind of its weights, of `random_tasks.FIELDS`; any if None.
        small: whether its lidar has few beams and its turns are short.
        most_work: of the count: directions of one set times beams near to each.
    """
    drawn = random_task(rng, folder, field, small=small)
    start = perf_counter()
    found, refusal, alarm = None, "", ""
    bearings = drawn.loaded.lidar.bearings_rad()[drawn.beams]
    try:
        problem = problem_of(drawn.loaded)
        found = score(problem.with_beams(bearings, problem.lines, problem.sweep), drawn.angles_rad)
    except ScanwrightError as error:
        refusal = str(error)
    checked = perf_counter()
    if found is not None:
        try:
            shadow = None if drawn.beams.all() else SelfOcclusion(~drawn.beams, None)
            require_counted(drawn.loaded, drawn.angles_rad, found, shadow)
        except ScanwrightError as error:
            alarm = str(error)
    middle = perf_counter()
    truth = _counted(drawn, bearings, int(rng.integers(1 << 30)), np.inf if found is None else found.J_error, most_work)
    took_s = checked - start, middle - checked, perf_counter() - middle
    return Claim(drawn, found, truth, refusal, alarm, took_s)


def _counted(drawn: RandomTask, bearings_rad: Array, seed: int, asked: float, most_work: float) -> Counted | None:
    """The count, on as many directions as three of its standard errors need to be within an error, or the work allows.

    None if it finds no weight; or hardly any where the program, which an infinite error stands for, finds none.
    """
    own, points = drawn.own_tables(), FEW
    ball_deg = drawn.loaded.task.density.ball_radius_deg
    near = max(4.0, len(bearings_rad) * min(1.0, ball_deg / 60))  # of a fan that stands askew
    most = max(FEW, int(most_work / near))
    while True:
        try:
            found = counted_J(own, drawn.angles_rad, seed, points, bearings_rad=bearings_rad)
        except TaskError:
            return None
        if np.isinf(asked):
            return found if found.weighted > SURELY_SEEN else None
        if found.J_error <= asked or points >= most:
            return found
        # the error falls at least as the root of their number, often nearly as their number
        wanted = points * min(found.J_error / max(asked, 1e-12), 1e6) ** 1.5
        points = int(min(most, max(2 * points, 2 ** np.ceil(np.log2(wanted)))))


def main() -> None:
    """Print what holds and what does not."""
    parser = argparse.ArgumentParser()
    parser.add_argument("what", nargs="*", default=["errors", "optima"])
    parser.add_argument("--pairs", type=int, default=300)
    parser.add_argument("--nodes", type=int, default=2187)
    parser.add_argument("--draws", type=int, default=100_000)
    parser.add_argument("--tasks", nargs="*", default=shipped_tasks())
    parser.add_argument("--random", type=int, default=100)
    parser.add_argument("--budget-s", type=float, default=70.0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", type=float, default=MOST_WORK)
    parser.add_argument("--fields", nargs="*", default=list(FIELDS))
    asked = parser.parse_args()
    seed = asked.seed or secrets.randbelow(1 << 31)
    print(f"seed {seed}", flush=True)
    kept = True
    if "errors" in asked.what:
        kept = print_errors(range(asked.first, asked.pairs), seed, asked.fields, asked.work)
    if "stated" in asked.what:
        print_stated(range(asked.first, asked.pairs), seed, asked.nodes)
    if "optima" in asked.what:
        for name in asked.tasks:
            print_contest(load_task(Path(name)), asked.draws, seed)
    if "evolution" in asked.what:
        print_evolution(range(asked.first, asked.random), seed, asked.budget_s)
    raise SystemExit(0 if kept else 1)


def print_errors(pairs: range, seed: int, fields: Iterable[str], most_work: float) -> bool:
    """Each broken claim with all that repeats it, then the sum of all; returns whether all are kept."""
    claims = []
    for i in pairs:
        rng = np.random.default_rng([seed, i])
        with TemporaryDirectory() as folder:
            field = None if set(fields) == set(FIELDS) else str(rng.choice(list(fields)))
            claim = random_claim(rng, Path(folder), field, most_work=most_work)
        claims.append(claim)
        if claim.alarm:
            print(f"ALARM pair {i}: {claim.alarm}: {claim.words()}", flush=True)
        if not claim.kept:
            print(f"BROKEN pair {i}, off by {claim.off:.1e}: {claim.words()}", flush=True)
        if sum(claim.took_s) > 20:
            print(
                f"SLOW pair {i}, {claim.took_s[0]:.1f} s and count {claim.took_s[2]:.1f} s: {claim.words()}", flush=True
            )
        if (i + 1) % 25 == 0:
            print(f"{i + 1} pairs, {sum(not claim.kept for claim in claims)} broken", flush=True)
    judged = [claim for claim in claims if claim.score is not None and claim.truth is not None]
    scores, truths = [claim.score for claim in judged], [claim.truth for claim in judged]
    stated = np.array([found.J_error for found in scores if found is not None])
    off = np.array([claim.off for claim in judged])
    print(f"stated errors kept: {sum(claim.kept for claim in claims)} of {len(pairs)}")
    print(f"taken for wrong by the program's own check: {sum(bool(claim.alarm) for claim in claims)}")
    print(f"refused as empty, and rightly: {sum(claim.kept for claim in claims if claim.score is None)}")
    large = int((stated > SMALL_ERROR).sum())
    print(f"stated: median {np.median(stated):.1e}, largest {stated.max():.1e}, above {SMALL_ERROR:g} in {large} pairs")
    share = (off / np.maximum(stated, 1e-300)).max()
    print(f"true:   median {np.median(off):.1e}, largest {off.max():.1e}, at most {share:.2f} of the stated")
    counted = np.array([truth.J_error for truth in truths if truth is not None])
    unsure = [claim for claim in judged if claim.unsure]
    print(
        f"the count's own error: largest {counted.max():.1e}; not within the stated one in {len(unsure)} pairs, "
        f"{sum(claim.kept for claim in unsure)} of them kept"
    )
    print("seconds by kind: program, its own check, count (median, largest of each), pairs")
    taken: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    for claim in claims:
        for kind in dict.fromkeys(claim.drawn.kinds):
            taken[kind].append(claim.took_s)
    for kind, seconds in sorted(taken.items()):
        figures = np.stack([np.median(seconds, axis=0), np.max(seconds, axis=0)], axis=1).ravel()
        print(f"  {kind:16} {' '.join(f'{figure:6.2f}' for figure in figures)} {len(seconds):5}", flush=True)
    return all(claim.kept for claim in claims)


def print_stated(pairs: range, seed: int, nodes: int) -> None:
    """Print how far stated errors are above the true ones, how many hold, and the largest share that is true."""
    stated, true = [], []
    for i in pairs:
        with TemporaryDirectory() as folder:
            drawn = random_task(np.random.default_rng([seed, i]), Path(folder))
        try:
            problem = problem_of(drawn.loaded)
            problem = problem.with_beams(problem.bearings_rad[drawn.beams], problem.lines, problem.sweep)
            # the error of a sweep is the spread of its sets, that of a lowest count is at least one
            if problem.sweep is not None or problem.grid_step_deg or problem.objective.name == "worst":
                continue
            rough = score_on(problem, drawn.angles_rad, nodes)
            fine = score_on(problem, drawn.angles_rad, FINER * nodes, stated=False)
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
