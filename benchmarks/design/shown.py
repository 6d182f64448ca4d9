"""Whether every figure of a valid task can be shown: what ends in a traceback is printed with all that repeats it.

    uv run python -m benchmarks.design.shown [--tasks 2000] [--first 0] [--seed 1]

Random tasks of `random_tasks` at random settings, two of five at whole 15, 45 or 90 deg, go through what stands behind
`evaluate`, `compare`, the report and the studio. A message that refuses a task is right, anything else that is raised
is a fault. One of 25 is compared in full, which searches mounts: that takes seconds.
A seed of 0 is a new one every time.
"""

from __future__ import annotations

import argparse
import json
import secrets
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.design.random_tasks import RandomTask, random_task
from scanwright.design.catalogue.products import Multibeam
from scanwright.design.errors import ScanwrightError
from scanwright.design.evaluation.comparison import compare, ready_made
from scanwright.design.evaluation.comparison_table import notes, table
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.evaluation.evaluation import Lever, evaluate
from scanwright.design.evaluation.poles import Pole
from scanwright.design.motion import Shortest
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.progress import no_progress
from scanwright.design.search.families import Family
from scanwright.design.search.mounts.reference import reference_mounts
from scanwright.design.search.shortest_period import with_period
from scanwright.design.self_occlusion import AXIS_STEPS, SelfOcclusion
from scanwright.design.sphere.directions import spiral
from scanwright.design.task.task import LoadedTask
from scanwright.report.answer import answer, problem_as_built
from scanwright.report.colours import bands_to
from scanwright.report.density_sphere import density_sphere
from scanwright.report.first_screen import cards
from scanwright.report.room import room_about, room_scene
from scanwright.serving.density_room import density_colours
from scanwright.studio.panel.facts import Judge
from scanwright.studio.panel.panel_html import facts_html, kept_html
from scanwright.studio.state import Setting
from scanwright.studio.view.outlines import SAMPLES, edges, highest_density

TOLERANCE = 0.1  # of J: what is shown of it is looked at, not how exact it is
FULL = 25  # one of so many tasks


@dataclass(frozen=True, slots=True)
class Failure:
    """What a command raised that is no message: which one, and the traceback."""

    command: str
    trace: str


def shown(drawn: RandomTask, folder: Path, *, full: bool = False) -> tuple[list[Failure], list[str]]:
    """Show all figures of a task as the commands do; returns what failed, and what was refused with a message.

    Args:
        drawn: the task and its setting; beams that are missing stand for those that parts block.
        folder: where the files of the task are.
        full: whether other mounts and scanners are searched as `compare` does it.
    """
    commands: dict[str, Callable[[RandomTask, Path], None]] = {
        "evaluate": _evaluate,
        "compare": _compare_fully if full else _compare,
        "report": _report,
        "studio": _studio,
    }
    failures, refused = [], []
    for name, command in commands.items():
        try:
            command(drawn, folder)
        except ScanwrightError as error:
            refused.append(f"{name}: {error}")
        except Exception:  # any: these are what is looked for
            failures.append(Failure(name, traceback.format_exc()))
    return failures, refused


def shown_task(rng: np.random.Generator, folder: Path) -> RandomTask:
    """A random task with cheap figures; some spin as fast as their limits allow."""
    drawn = random_task(rng, folder, small=True, tolerance=TOLERANCE)
    task = drawn.loaded.task
    if task.motion.mode == "spin" and rng.random() < 0.1:
        limits = task.limits.model_copy(update={"min_density": 1})
        task = task.model_copy(update={"motion": Shortest(longest_s=20.0), "limits": limits})
    return replace(drawn, loaded=replace(drawn.loaded, task=task))


def _shadow(drawn: RandomTask) -> SelfOcclusion | None:
    """Beams that are missing as parts that turn with the laser, and a part that stands still before some others."""
    if drawn.beams.all():
        return None
    stator = np.zeros((len(drawn.beams), AXIS_STEPS), dtype=bool)
    stator[: len(drawn.beams) // 4, : AXIS_STEPS // 8] = True
    return SelfOcclusion(~drawn.beams, stator)


def _evaluate(drawn: RandomTask, _: Path) -> None:
    lever = Lever(5, -3, 1.0) if drawn.beams.all() else None
    found = evaluate(drawn.loaded, drawn.angles_rad, Pole(0.02, 1.0, 5.0), lever, no_progress, _shadow(drawn))
    "\n".join(found.lines())
    json.dumps({"angles_deg": drawn.angles_deg, **found.facts()})
    found.beam_directions()


def _compare(drawn: RandomTask, _: Path) -> None:
    loaded = drawn.loaded
    problem = problem_of(loaded)
    products = [product for product in loaded.products if isinstance(product, Multibeam)]
    product = products[len(drawn.beams) % len(products)]
    rows = [ready_made(problem, product, turns) for turns in (1, 3)]
    "\n".join([*table(rows), *notes(loaded, rows)])


def _compare_fully(drawn: RandomTask, _: Path) -> None:
    problem, shadow = problem_of(drawn.loaded), _shadow(drawn)
    best = Family(drawn.angles_deg, score(problem, drawn.angles_rad), 1, "given")  # type: ignore[arg-type]
    mounts = reference_mounts(problem, drawn.loaded.task)
    rows = compare(drawn.loaded, problem, best, mounts, built=None if shadow is None else (drawn.angles_rad, shadow))
    "\n".join([*table(rows), *notes(drawn.loaded, rows)])


def _report(drawn: RandomTask, _: Path) -> None:
    loaded, shadow = with_period(drawn.loaded, drawn.angles_rad, no_progress), _shadow(drawn)
    angles = loaded.angle_set(drawn.angles_deg)
    problem = problem_as_built(loaded, angles)
    found = answer(loaded, angles, shadow)
    tuned = [mount.gain.mount for mount in found.as_built.mounts]
    sphere = density_sphere(problem, angles, tuned, shadow)
    json.dumps(room_scene(room_about(loaded.task), np.zeros(3), np.array(sphere.middle), sphere.below))
    cards(angles, found, None)
    found.as_built.lines()


def _studio(drawn: RandomTask, _: Path) -> None:
    judge = Judge.for_task(drawn.loaded)
    setting = Setting.within_bounds(drawn.angles_deg)
    quick, exact = judge.quick(setting), judge.exact(setting)
    settled = judge.settled(exact)
    for facts in (quick, exact, settled):
        facts_html(facts)
    kept_html({"A": settled, "B": quick})
    highest = highest_density(judge.problem, setting.angles_rad)
    density = mean_density_at(judge.problem, setting.angles_rad, spiral(SAMPLES))
    density_colours(density, bands_to(highest))
    edges(judge.problem.field)


def main() -> None:
    """Print every failure, and the sum."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--tasks", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    seed = asked.seed or secrets.randbelow(1 << 31)
    print(f"seed {seed}", flush=True)
    failed, refusals, tasks = 0, Counter[str](), range(asked.first, asked.tasks)
    for i in tasks:
        with TemporaryDirectory() as folder:
            drawn = shown_task(np.random.default_rng([seed, i]), Path(folder))
            failures, refused = shown(drawn, Path(folder), full=i % FULL == 0)
        failed += bool(failures)
        refusals.update(message.split(":")[0] for message in refused)
        for failure in failures:
            print(f"FAILED task {i}, {failure.command}, {drawn.kinds}, {_repeated(drawn.loaded)}", flush=True)
            print(f"  at {drawn.angles_deg}\n{failure.trace}", flush=True)
        if (i + 1) % 50 == 0:
            print(f"{i + 1} tasks, {failed} failed, refused: {dict(refusals)}", flush=True)
    print(f"shown without a traceback: {len(tasks) - failed} of {len(tasks)} tasks; refused: {dict(refusals)}")
    raise SystemExit(1 if failed else 0)


def _repeated(loaded: LoadedTask) -> dict[str, object]:
    return loaded.task.model_dump(mode="json", exclude_defaults=True)


if __name__ == "__main__":
    main()
