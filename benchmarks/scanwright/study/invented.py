"""Invented work: a study of candidates that take a fixed time, or none, and whose numbers come from their records."""

from __future__ import annotations

import hashlib
import math
import os
import time
from functools import partial
from pathlib import Path
from typing import Any

from scanwright.design.progress import no_progress
from scanwright.design.task.task import Limits, LoadedTask, load_task
from scanwright.study.candidate import record_digest
from scanwright.study.crossing import Crossing
from scanwright.study.front import six_digits
from scanwright.study.results import Result, open_results
from scanwright.study.run import StudyRun
from scanwright.study.study import LoadedStudy, Mounting, Study
from scanwright.study.table import write_answer
from scanwright.study.workers import crew_of

LOOPS_PER_S = 28_000_000  # of the loop below, roughly: work of a fixed size, not of a fixed time


def spin(seconds: float) -> int:
    """A fixed amount of work on one core."""
    total = 0
    for i in range(int(seconds * LOOPS_PER_S)):
        total ^= i
    return total


def die(after_s: float) -> None:
    """End the process as a crash does, once it has been at work for a while."""
    time.sleep(after_s)
    os._exit(1)


def invented_search(loaded: LoadedTask) -> Result:
    """A search that costs nothing; its bound comes from the record."""
    period_s = loaded.task.motion.duration_s
    motion = loaded.task.motion.model_dump(mode="json")
    J = -math.log(period_s) - _dice(loaded, 0)
    bounds = {"J": J, "beams_per_ball": math.expm1(-J), "period_s": period_s}
    return {"status": "found", "motion": motion, "reference_J": 0.0, "families": [], "bounds": bounds}


def invented_judge(loaded: LoadedTask, found: Result, seconds: float = 0.0, ledger: str = "") -> Result:
    """A candidate of so much work, a little worse than its bound; a line in the ledger when it is done."""
    spin(seconds)
    if ledger:
        with Path(ledger).open("a") as file:
            file.write(f"{record_digest(loaded)}\n")
    values: dict[str, Any] = {"J": found["bounds"]["J"] + _dice(loaded, 1), "period_s": loaded.task.motion.duration_s}
    values = {name: six_digits(value) for name, value in values.items()}
    return {"status": "built", "angles_deg": [0.0] * 4, "J_error": 0.0, "values": values, "weakest": ""}


def _dice(loaded: LoadedTask, throw: int) -> float:
    """A number between 0 and 0.2 that period and limit decide: a new field of tasks throws no other one."""
    thrown = f"{loaded.task.motion.duration_s:g} {loaded.task.limits.max_blocked} {throw}"
    return int(hashlib.sha256(thrown.encode("ascii")).hexdigest()[:6], 16) / 2**24 / 5


def invented_study(units: int, mountings: int = 1, front: tuple[str, ...] = ("J", "period_s")) -> LoadedStudy:
    """One task at so many periods, in so many mountings that share their searches."""
    limits = [Limits(max_blocked=(i + 1) / mountings) for i in range(mountings)]
    study = Study(
        name="invented",
        tasks=("pitching",),
        periods_s=tuple(round(2.0 + 500.0 * i * mountings / units, 6) for i in range(units // mountings)),
        mounting=tuple(Mounting(name=f"m{i}", limits=limit) for i, limit in enumerate(limits)),
        front=front,
        winners=0,
        time_limit_s=60,
    )
    task = load_task(Path("pitching"))
    return LoadedStudy(study, Path("invented.toml"), (task,), task.products)


def run_invented(
    folder: Path, scheduler: str | None, units: int, seconds: float, processes: int | None = None
) -> float:
    """Run an invented study into a folder; the time of its work."""
    judge = partial(invented_judge, seconds=seconds, ledger=str(folder / "ledger"))
    crossing = Crossing(invented_study(units))
    run = StudyRun(crossing, open_results(folder / "results"), judge, invented_search)
    with crew_of(scheduler, processes) as crew:
        start = time.monotonic()
        run.work(crew, no_progress)
        took = time.monotonic() - start
    write_answer(crossing.loaded.study, run.rows(), folder)
    return took
