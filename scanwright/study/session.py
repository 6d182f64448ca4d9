"""A study from first to last: search, bound, judge what no bound rules out, and tell every candidate's fate.

The answer does not depend on who finished first. A candidate is left out where its bound is beaten by a finished one;
what beats it is itself on the final front, or beaten by one that is. So a candidate counts as `dominated` where the
final front beats its bound, also if it happened to be made before that was known, and every other one has been made.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from design.frames import Array
from design.task.task import NAMES, LoadedTask
from scanwright.study.answer.columns import costs
from scanwright.study.answer.pareto import Front
from scanwright.study.candidate import bounds_of, digest, search_of, search_record, winner_task
from scanwright.study.crossing import AXES, Combination, Crossing
from scanwright.study.runner.engine import Finished, run
from scanwright.study.runner.identity import address
from scanwright.study.runner.store import Result, Store
from scanwright.study.runner.work import Unit

if TYPE_CHECKING:
    from distributed import Client

Judge = Callable[[LoadedTask, Result], Result]
Say = Callable[[str], None]
Row = dict[str, Any]
"""One line of the table: see `tables.FIELDS`."""


@dataclass(slots=True)
class Counts:
    """What was done in one run, and what it was worth."""

    searches: int = 0
    judged: int = 0
    looked_up: int = 0
    beaten: int = 0
    seconds: float = 0.0
    memory_mb: float = 0.0


@dataclass(slots=True)
class Session:
    """A study on a cluster.

    Attributes:
        crossing: its candidates.
        store: results so far.
        judge: what makes a candidate; `cad` has it, and `design` never imports it.
        search: what searches one.
        counts: of this run.
        fronts: of each task.
    """

    crossing: Crossing
    store: Store
    judge: Judge
    search: Callable[[LoadedTask], Result] = search_of
    counts: Counts = field(default_factory=Counts)
    fronts: list[Front] = field(default_factory=list)
    _bounds: Array = field(init=False)
    _failures: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        columns = len(self.crossing.loaded.study.front)
        self.fronts = [Front(columns) for _ in self.crossing.loaded.tasks]
        self._bounds = np.full((len(self.crossing), columns), np.nan)

    def run(self, client: Client, say: Say) -> None:
        """Do what is not yet done."""
        limit_s = self.crossing.loaded.study.time_limit_s
        watch = _Watch("searches", len(self.crossing), say)
        for done in run(client, self._searches(watch), self.store, limit_s, watch.tell):
            self._count(done, watch)
            self.counts.searches += done.seconds is not None
        self._bound()
        watch = _Watch("candidates", int((~np.isnan(self._bounds[:, 0])).sum()), say)
        places: dict[str, list[int]] = {}
        for done in run(client, self._candidates(watch, places), self.store, limit_s, watch.tell):
            self._count(done, watch)
            self.counts.judged += done.seconds is not None
            self.counts.looked_up += done.seconds is None and done.result is not None
            for number in places.pop(done.unit.address, ()):
                self._enter(number, done.result)
        watch.tell()

    def rows(self) -> Iterator[Row]:
        """The fate of every candidate, in the order of the study."""
        for combination in self.crossing:
            yield self._row(combination)

    def winners(self) -> list[tuple[Combination, LoadedTask]]:
        """What is to be built: of each task the first of its front, by its columns, as tasks of one setting."""
        study = self.crossing.loaded.study
        found = []
        for front in self.fronts:
            for place in np.lexsort((front.numbers, *front.costs.T[::-1]))[: study.winners]:
                combination = self.crossing[int(front.numbers[place])]
                assert combination.loaded is not None
                search, built = (self.store.get(at) for at in addresses(combination.loaded))
                assert search is not None and built is not None
                found.append((combination, winner_task(combination.loaded, search, built)))
        return found

    def _searches(self, watch: _Watch) -> Iterator[Unit]:
        for combination in self.crossing:
            loaded = combination.loaded
            if loaded is None:
                watch.skip()
                continue
            record = search_record(loaded)
            at = address("search", digest(record))
            if at in self._failures or self.store.has(at):
                watch.skip()
                continue
            yield Unit(at, f"search of {combination.name}", self.search, (record,), "search")

    def _candidates(self, watch: _Watch, places: dict[str, list[int]]) -> Iterator[Unit]:
        """Those first that are likely to beat others; those that what is finished beats are left out."""
        bounds = self._bounds
        todo = np.flatnonzero(~np.isnan(bounds[:, 0]))
        for number in map(int, todo[np.argsort(_mean_rank(bounds[todo]), kind="stable")]):
            combination = self.crossing[number]
            if self.fronts[combination.group].beater(bounds[number]) is not None:
                self.counts.beaten += 1
                watch.skip()
                continue
            assert combination.loaded is not None
            search, at = addresses(combination.loaded)
            found = self.store.get(search)
            assert found is not None
            places.setdefault(at, []).append(number)
            yield Unit(at, combination.name, self.judge, (combination.loaded, found), "candidate")

    def _bound(self) -> None:
        """What no candidate can be better than, NaN where there is nothing to make; enters what was made before."""
        names = self.crossing.loaded.study.front
        for combination in self.crossing:
            if combination.loaded is None:
                continue
            search, at = addresses(combination.loaded)
            found = self.store.get(search)
            if found is not None and found["status"] == "found":
                self._bounds[combination.number] = costs(bounds_of(combination.loaded, found), names)
                self._enter(combination.number, self.store.get(at))

    def _enter(self, number: int, result: Result | None) -> None:
        if result is None or result["status"] != "built":
            return
        self.fronts[self.crossing[number].group].add(number, self._cost(number, result))

    def _cost(self, number: int, result: Result) -> Array:
        """Of a finished candidate; never below its bound, not even within the error of its numbers."""
        return np.maximum(costs(result["values"], self.crossing.loaded.study.front), self._bounds[number])

    def _count(self, done: Finished, watch: _Watch) -> None:
        if done.failure:
            self._failures[done.unit.address] = done.failure
        self.counts.seconds += done.seconds or 0.0
        self.counts.memory_mb = max(self.counts.memory_mb, done.memory_mb)
        watch.did(done.seconds)

    def _row(self, combination: Combination) -> Row:
        row: Row = {"name": combination.name} | {axis: combination.choice[axis] for axis in AXES}
        loaded = combination.loaded
        if loaded is None:
            return row | {"status": "refused", "reason": combination.refused}
        row |= {"sensor": loaded.task.sensor, "servo": loaded.task.servo, "printer": loaded.task.printer}
        row |= {"slip_ring": loaded.task.slip_ring or ""}
        search, at = addresses(loaded)
        found = self.store.get(search)
        if found is None:
            return row | {"status": "failed", "reason": self._failures.get(search, "not searched")}
        if found["status"] != "found":
            return row | {"status": "refused", "reason": found["reason"]}
        front = self.fronts[combination.group]
        beater = front.beater(self._bounds[combination.number])
        if beater is not None:
            return row | {"status": "dominated", "reason": f"not made: {self.crossing[beater].name} beats its bound"}
        result = self.store.get(at)
        if result is None:
            return row | {"status": "failed", "reason": self._failures.get(at, "not made")}
        if result["status"] != "built":
            return row | {"status": "refused", "reason": result["reason"]}
        row |= {f"{name}_deg": angle for name, angle in zip(NAMES, result["angles_deg"], strict=True)}
        row |= {"J_error": result["J_error"], "weakest": result["weakest"]} | result["values"]
        beater = front.beater(self._cost(combination.number, result))
        if beater is None:
            return row | {"status": "front", "reason": ""}
        return row | {"status": "built", "reason": f"{self.crossing[beater].name} is as good or better in every way"}


def _mean_rank(bounds: Array) -> Array:
    """Mean over the columns of the share of candidates that are better there, shape (candidates,)."""
    shares = np.zeros(len(bounds))
    for column in bounds.T:
        _, ranks = np.unique(column, return_inverse=True)
        shares += ranks / max(1, len(column) - 1) / bounds.shape[1]
    return shares


def addresses(loaded: LoadedTask) -> tuple[str, str]:
    """Where the search and the result of a candidate are kept."""
    return address("search", digest(search_record(loaded))), address("candidate", digest(loaded))


@dataclass(slots=True)
class _Watch:
    """Progress of one stage, told at most once a second, with an estimate of what is left."""

    what: str
    total: int
    say: Say
    over: int = 0
    timed: int = 0
    start: float = field(default_factory=time.monotonic)
    told: float = 0.0

    def skip(self) -> None:
        self.over += 1
        self._perhaps()

    def did(self, seconds: float | None) -> None:
        self.over += 1
        if seconds is not None:
            self.timed += 1
        self._perhaps()

    def tell(self, threads: int | None = None) -> None:
        """Say where the study stands; where the number of threads at work is told and is none, that too."""
        self.told = time.monotonic()
        share = self.over / self.total if self.total else 1.0
        line = f"{self.what}: {self.over:,} of {self.total:,} over ({share:.0%})"
        if self.over < self.total:
            line += f"; {_about(self._left_s())} left" if self.timed else "; the first ones are at work"
        self.say(line + ("; no worker is there, waiting for one" if threads == 0 else ""))

    def _perhaps(self) -> None:
        if time.monotonic() - self.told > 1.0:
            self.tell()

    def _left_s(self) -> float:
        return (self.total - self.over) * (time.monotonic() - self.start) / self.timed


def _about(seconds: float) -> str:
    if seconds < 90:
        return f"about {seconds:.0f} s"
    return f"about {seconds / 60:.0f} min" if seconds < 5400 else f"about {seconds / 3600:.1f} h"
