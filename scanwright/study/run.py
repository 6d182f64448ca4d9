"""A run of a study: search, bound, make the candidates that no bound excludes, and report the status of each.

The result does not depend on the order in which candidates finish. A candidate is skipped if a finished one beats its
bound; that one is on the final front, or is beaten by one that is. So a candidate has the status `dominated` if the
final front beats its bound, even if it was made earlier, and all others have been made.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from scanwright.cad.checks.checks_json import failure_lines
from scanwright.cad.kernel import require_kernel
from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError
from scanwright.design.files.atomic_file import place_in
from scanwright.design.progress import Progress
from scanwright.design.task.angle_ranges import NAMES
from scanwright.design.task.task import LoadedTask
from scanwright.pipeline.build import build_task
from scanwright.study.bench import judge_candidate
from scanwright.study.candidate import addresses, bounds_of, search_candidate, search_record, winner_task
from scanwright.study.crossing import AXES, Combination, Crossing
from scanwright.study.front import Front, costs
from scanwright.study.results import Result, Results, open_results
from scanwright.study.study import load_study
from scanwright.study.table import Row, write_answer
from scanwright.study.units import Crew, Finished, Unit, finished
from scanwright.study.workers import crew_of

_REPORTED_S = 1.0  # between two progress reports


def run_study(
    study: Path,
    out: Path | None,
    results: Path | None,
    scheduler: str | None,
    processes: int | None,
    progress: Progress,
) -> Iterator[str]:
    """Run the rest of a study, write its tables, and build its winners; yields the results as lines.

    `study` is a file, or the name of a shipped study; `out` the folder of tables and winners, by default out/STUDY;
    `results` the folder of results, by default OUT/results; `scheduler` the address of a running Dask scheduler, by
    default `processes` of this computer, one for each core.

    Raises:
        InstallError: the CAD kernel, or Dask for a scheduler, is not installed.
        TaskError: the study is malformed, or the scheduler does not answer.
        BuildError: a folder cannot be written, or no worker is left.
    """
    require_kernel("study")
    crossing = Crossing(load_study(study))
    folder = out or Path("out") / crossing.loaded.study.name
    run = StudyRun(crossing, open_results(results or place_in(folder, "results", BuildError)))
    with crew_of(scheduler, processes) as crew:
        run.work(crew, progress)
    yield from write_answer(crossing.loaded.study, run.rows(), folder)
    yield run.tally.line()
    for combination, loaded in run.winners():
        target = place_in(folder, combination.name, BuildError)
        built = build_task(loaded, target, progress)
        yield f"built {target}" if built.made else f"{target} is up to date"
        yield from (f"{target}: {line}" for line in failure_lines(built.checks))
    if (folder / "study.parquet").exists():
        yield f"wrote study.csv, study.parquet and front.png to {folder}"
    else:
        yield f"wrote study.csv and front.png to {folder}; study.parquet needs pip install 'scanwright[cluster]'"


@dataclass(slots=True)
class Tally:
    """The work of one run, and its cost."""

    searches: int = 0
    judged: int = 0
    looked_up: int = 0
    beaten: int = 0
    seconds: float = 0.0
    memory_mb: float = 0.0

    def line(self) -> str:
        """Return the tally as one line."""
        worked = f", {self.seconds:,.0f} s of work, {self.memory_mb:,.0f} MB the most of a worker"
        return (
            f"this run: {self.searches:,} searches, {self.judged:,} candidates made, {self.looked_up:,} looked up, "
            f"{self.beaten:,} beaten before they were made{worked if self.seconds else ''}"
        )


@dataclass(slots=True)
class StudyRun:
    """A running study."""

    crossing: Crossing  # its candidates
    results: Results  # results folder
    judge: Callable[[LoadedTask, Result], Result] = judge_candidate  # makes and evaluates a candidate
    search: Callable[[LoadedTask], Result] = search_candidate  # searches the angles of a candidate
    tally: Tally = field(default_factory=Tally)  # work of this run
    fronts: list[Front] = field(init=False)  # front of each task
    _bounds: Array = field(init=False)
    _failures: dict[str, str] = field(default_factory=dict)
    _at_work: dict[str, list[int]] = field(default_factory=dict)  # address -> its candidates

    def __post_init__(self) -> None:
        columns = len(self.crossing.loaded.study.front)
        self.fronts = [Front(columns) for _ in self.crossing.loaded.tasks]
        self._bounds = np.full((len(self.crossing), columns), np.nan)

    def work(self, crew: Crew, progress: Progress) -> None:
        """Do the remaining work."""
        limit_s = self.crossing.loaded.study.time_limit_s
        watch = _Watch("searches", len(self.crossing), progress)
        for ended in finished(crew, self._searches(watch), self.results, limit_s, watch.report):
            self.tally.searches += self._end(ended, watch)
        self._bound()
        watch = _Watch("candidates", int((~np.isnan(self._bounds[:, 0])).sum()), progress)
        for ended in finished(crew, self._candidates(watch), self.results, limit_s, watch.report):
            numbers = self._at_work[ended.unit.address]
            worked = self._end(ended, watch)
            self.tally.judged += worked
            if ended.done is not None:
                self.tally.looked_up += len(numbers) - worked
                for number in numbers:
                    self._enter(number, ended.done.result)
        watch.report()

    def rows(self) -> Iterator[Row]:
        """Yield the row of every candidate in the order of the study."""
        for combination in self.crossing:
            yield self._row(combination)

    def winners(self) -> list[tuple[Combination, LoadedTask]]:
        """Return the winners of each task, by the columns of its front, as tasks with one mount."""
        winners = []
        for front in self.fronts:
            order = np.lexsort((front.numbers, *front.costs.T[::-1]))
            for number in map(int, front.numbers[order][: self.crossing.loaded.study.winners]):
                combination = self.crossing[number]
                assert combination.loaded is not None
                searched, built = (self.results.get(at) for at in addresses(combination.loaded))
                assert searched is not None and built is not None
                winners.append((combination, winner_task(combination.loaded, searched, built)))
        return winners

    def _searches(self, watch: _Watch) -> Iterator[Unit]:
        for combination in self.crossing:
            if combination.loaded is not None:
                at, _ = addresses(combination.loaded)
                if at not in self._failures and at not in self._at_work and not self.results.has(at):
                    self._at_work[at] = [combination.number]
                    yield Unit(at, self.search, (search_record(combination.loaded),))
                    continue
            watch.count()

    def _candidates(self, watch: _Watch) -> Iterator[Unit]:
        """Yield candidates, the most promising first; skips those that a finished one beats."""
        todo = np.flatnonzero(~np.isnan(self._bounds[:, 0]))
        for number in map(int, todo[np.argsort(_mean_rank(self._bounds[todo]), kind="stable")]):
            combination = self.crossing[number]
            assert combination.loaded is not None
            search, at = addresses(combination.loaded)
            if self.fronts[combination.group].beater(self._bounds[number]) is not None:
                self.tally.beaten += 1
            elif at in self._at_work:
                self._at_work[at].append(number)
            elif at not in self._failures:
                self._at_work[at] = [number]
                yield Unit(at, self.judge, (combination.loaded, self.results.get(search)))
                continue
            watch.count()

    def _bound(self) -> None:
        """Compute the bounds of all candidates, NaN if there is nothing to make; enters earlier results."""
        names = self.crossing.loaded.study.front
        for combination in self.crossing:
            if combination.loaded is None:
                continue
            search, at = addresses(combination.loaded)
            searched = self.results.get(search)
            if searched is not None and searched["status"] == "found":
                self._bounds[combination.number] = costs(bounds_of(combination.loaded, searched), names)
                self._enter(combination.number, self.results.get(at))

    def _enter(self, number: int, result: Result | None) -> None:
        if result is not None and result["status"] == "built":
            self.fronts[self.crossing[number].group].add(number, self._cost(number, result))

    def _cost(self, number: int, result: Result) -> Array:
        """Return the cost of a finished candidate, at least its bound."""
        return np.maximum(costs(result["values"], self.crossing.loaded.study.front), self._bounds[number])

    def _end(self, ended: Finished, watch: _Watch) -> bool:
        """Count a finished unit, and return whether a worker computed it in this run."""
        del self._at_work[ended.unit.address]
        seconds = None
        if ended.done is None:
            self._failures[ended.unit.address] = ended.failure
        else:
            seconds = ended.done.seconds
            self.tally.seconds += seconds or 0.0
            self.tally.memory_mb = max(self.tally.memory_mb, ended.done.memory_mb)
        watch.count()
        return seconds is not None

    def _row(self, combination: Combination) -> Row:
        row: Row = {"name": combination.name} | {axis: combination.choice[axis] for axis in AXES}
        loaded = combination.loaded
        if loaded is None:
            return row | {"status": "refused", "reason": combination.refused}
        row |= {"sensor": loaded.task.sensor, "servo": loaded.task.servo, "printer": loaded.task.printer}
        row |= {"slip_ring": loaded.task.slip_ring or ""}
        search, at = addresses(loaded)
        searched = self.results.get(search)
        if searched is None:
            return row | {"status": "failed", "reason": self._failures.get(search, "not searched")}
        if searched["status"] != "found":
            return row | {"status": "refused", "reason": searched["reason"]}
        front = self.fronts[combination.group]
        beater = front.beater(self._bounds[combination.number])
        if beater is not None:
            return row | {"status": "dominated", "reason": f"not made: {self.crossing[beater].name} beats its bound"}
        result = self.results.get(at)
        if result is None:
            return row | {"status": "failed", "reason": self._failures.get(at, "not made")}
        if result["status"] != "built":
            return row | {"status": "refused", "reason": result["reason"]}
        row |= {f"{name}_deg": angle for name, angle in zip(NAMES, result["angles_deg"], strict=True)}
        row |= {"J_error": result["J_error"], "weakest": result["weakest"]} | result["values"]
        beater = front.beater(self._cost(combination.number, result))
        if beater is None:
            return row | {"status": "front", "reason": ""}
        return row | {"status": "built", "reason": f"{self.crossing[beater].name} is as good or better in every column"}


def _mean_rank(bounds: Array) -> Array:
    """Return the mean rank over the columns, 0 to 1, shape (candidates,)."""
    shares = np.zeros(len(bounds))
    for column in bounds.T:
        _, ranks = np.unique(column, return_inverse=True)
        shares += ranks / max(1, len(column) - 1) / bounds.shape[1]
    return shares


@dataclass(slots=True)
class _Watch:
    """Progress of one stage, reported at most once a second."""

    what: str
    total: int
    progress: Progress
    over: int = 0
    reported_s: float = -math.inf

    def count(self) -> None:
        self.over += 1
        if time.monotonic() - self.reported_s > _REPORTED_S:
            self.report()

    def report(self, width: int | None = None) -> None:
        """Report the number of finished units, and that there is no worker if the width of the crew is 0."""
        self.reported_s = time.monotonic()
        waiting = "; waiting for a worker: none is there" if width == 0 else ""
        share = self.over / self.total if self.total else 1.0
        self.progress(f"{self.what}: {self.over:,} of {self.total:,} done{waiting}", share)
