"""Two workers against one, on the same work; and what the machine itself allows."""

from __future__ import annotations

import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from benchmarks.scanwright.study.invented import invented_judge, invented_search, invented_study, spin
from scanwright.design.progress import no_progress
from scanwright.study.crossing import Crossing
from scanwright.study.results import open_results
from scanwright.study.run import StudyRun
from scanwright.study.workers import crew_of


def efficiency(units: int, seconds: float) -> None:
    """Two workers against one, and two bare processes against one."""
    with tempfile.TemporaryDirectory() as scratch:
        took = {}
        for workers in (1, 2):
            folder = Path(scratch) / str(workers)
            folder.mkdir()
            took[workers] = _of_a_study(folder, units, seconds, workers)
        bare = {processes: _bare(units, seconds, processes) for processes in (1, 2)}
    for what, times in (("workers", took), ("bare processes", bare)):
        share = times[1] / times[2] / 2
        print(f"{what}: {times[1]:.2f} s with one, {times[2]:.2f} s with two: {share:.1%} of twice one")
    print(f"overhead of a unit with one worker: {1000 * (took[1] - bare[1]) / units:.1f} ms")


def _of_a_study(folder: Path, units: int, seconds: float, workers: int) -> float:
    """Time of the candidates alone: the workers have been started, and have imported all they need."""
    with crew_of(None, workers) as crew:
        for size, work in ((2 * workers, seconds), (units, seconds)):
            results = open_results(folder / str(size))
            judge = partial(invented_judge, seconds=work)
            run = StudyRun(Crossing(invented_study(size)), results, judge, invented_search)
            start = time.monotonic()
            run.work(crew, no_progress)
        return time.monotonic() - start


def _bare(units: int, seconds: float, processes: int) -> float:
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        list(pool.map(spin, [0.0] * processes))
        start = time.monotonic()
        list(pool.map(spin, [seconds] * units))
        return time.monotonic() - start
