"""Memory of the client of a study as its candidates go by; the work of each is nothing."""

from __future__ import annotations

import resource
import tempfile
import time
from pathlib import Path

from benchmarks.scanwright.study.invented import invented_judge, invented_search, invented_study
from scanwright.design.task.task import LoadedTask
from scanwright.study.crossing import Crossing
from scanwright.study.results import Result, open_results
from scanwright.study.run import StudyRun
from scanwright.study.table import write_answer
from scanwright.study.workers import crew_of

MOUNTINGS = 100


def memory(units: int) -> None:
    """Memory of the client as candidates go by."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        # bounds of 0 that nothing reaches: no candidate is left out
        crossing = Crossing(invented_study(units, MOUNTINGS, ("period_s",)))
        run = StudyRun(crossing, open_results(folder / "results"), _nothing, _nothing_found)
        start = time.monotonic()
        told: list[tuple[float, float]] = []

        def progress(line: str, _fraction: float | None = None, /) -> None:
            told.append((time.monotonic() - start, _now_mb()))
            if len(told) % 15 == 1:
                print(f"  {told[-1][0]:6.0f} s {told[-1][1]:7.1f} MB  {line}", flush=True)

        with crew_of(None, 2) as crew:
            run.work(crew, progress)
        took = time.monotonic() - start
        before = _now_mb()
        write_answer(crossing.loaded.study, run.rows(), folder)
        quarter, end = told[len(told) // 4][1], told[-1][1]
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{units:,} candidates in {took:.0f} s, {1e3 * took / units:.2f} ms each")
        print(
            f"client: {quarter:.0f} MB after a quarter of the time, {end:.0f} MB at the end, {before:.0f} MB before the"
        )
        print(f"table is written, {_now_mb():.0f} MB after, {most:.0f} MB at most")


def _nothing_found(loaded: LoadedTask) -> Result:
    return invented_search(loaded) | {"bounds": {"period_s": 0.0}}


def _nothing(loaded: LoadedTask, found: Result) -> Result:
    return invented_judge(loaded, found | {"bounds": {"J": 0.0}})


def _now_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20
