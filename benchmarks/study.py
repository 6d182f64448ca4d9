"""What a study costs and what it survives, measured on one machine.

    uv run python -m benchmarks.study costs DIR     unit costs of real work, kept as design/study/costs.csv
    uv run python -m benchmarks.study kills [--each 20] [--what worker scheduler client] [--seed 1]
    uv run python -m benchmarks.study efficiency [--units 40] [--seconds 1.0]
    uv run python -m benchmarks.study memory [--units 100000]

`kills` ends a process with SIGKILL at a random moment of a study of synthetic work, brings back what does not come back
by itself, and compares the table with an undisturbed one; a ledger counts what was computed twice. `efficiency` sets
two workers against one, on the same work, and beside it two bare processes against one: what the machine itself
allows. `memory` tells the client's memory as the candidates go by; the work of each is nothing.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import random
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from design.study.answer import write_answer
from design.study.candidate import digest, search_of, search_record
from design.study.cluster import cluster
from design.study.columns import tidy
from design.study.crossing import Crossing
from design.study.plan import COSTS
from design.study.session import Session
from design.study.store import Result, open_store
from design.study.study import LoadedStudy, Mounting, Study, load_study
from design.task import Limits, LoadedTask, load_task

HERE = Path(__file__).parents[1]
LOOPS_PER_S = 28_000_000  # of the loop below, roughly: work of a fixed size, not of a fixed time
MOUNTINGS = 100  # of `memory`
MOST_S = 120.0  # that a process may take to do anything


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
    bounds = {"J": -math.log(period_s) - _dice(loaded, 0), "period_s": period_s}
    return {"status": "found", "motion": motion, "standard_J": 0.0, "families": [], "bounds": bounds}


def invented_judge(loaded: LoadedTask, found: Result, seconds: float = 0.0, ledger: str = "") -> Result:
    """A candidate of so much work, a little worse than its bound; a line in the ledger when it is done."""
    spin(seconds)
    if ledger:
        with Path(ledger).open("a") as file:
            file.write(f"{digest(loaded)}\n")
    values: dict[str, Any] = {"J": found["bounds"]["J"] + _dice(loaded, 1), "period_s": loaded.task.motion.duration_s}
    values = {name: tidy(value) for name, value in values.items()}
    return {"status": "built", "angles_deg": [0.0] * 4, "J_error": 0.0, "values": values, "weakest": ""}


def _dice(loaded: LoadedTask, throw: int) -> float:
    """A number between 0 and 0.1 that the record decides."""
    return int(digest(loaded)[6 * throw : 6 * throw + 6], 16) / 2**24 / 10


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
    session = Session(Crossing(invented_study(units)), open_store(folder / "results"), judge, invented_search)
    with cluster(scheduler, processes) as client:
        start = time.monotonic()
        session.run(client, lambda _: None)
        took = time.monotonic() - start
    write_answer(session, folder)
    return took


@dataclass(slots=True)
class Site:
    """A scheduler and its workers, started by Dask's own commands, over TCP."""

    folder: Path
    port: int
    workers: int = 2
    scheduler: subprocess.Popen[bytes] = field(init=False)
    crew: list[subprocess.Popen[bytes]] = field(default_factory=list)

    @property
    def address(self) -> str:
        """Of the scheduler."""
        return f"tcp://127.0.0.1:{self.port}"

    def start_scheduler(self) -> None:
        """Start it, or start it again."""
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", str(self.port))

    def start_workers(self) -> None:
        """Start workers, each with its nanny."""
        for _ in range(self.workers):
            self.crew.append(self._start("worker", self.address, "--nthreads", "1"))

    def worker_pids(self) -> list[int]:
        """Of the processes that work; their nannies are `crew`."""
        found = []
        for nanny in self.crew:
            of_threads = Path(f"/proc/{nanny.pid}/task").glob("*/children")
            children = [pid for text in of_threads for pid in text.read_text().split()]
            found += [int(pid) for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
        return found

    def stop(self) -> None:
        """End everything that still runs: a worker ends with its nanny, and asks no scheduler that may be gone."""
        for process in [*self.crew, self.scheduler]:
            process.kill()
            process.wait()
        self.crew = []

    def _start(self, *words: str) -> subprocess.Popen[bytes]:
        command = [str(Path(sys.executable).parent / "dask"), *words, "--no-dashboard"]
        environment = os.environ | {"PYTHONPATH": str(HERE), "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "20s"}
        with (self.folder / f"{words[0]}.log").open("ab") as log:
            return subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log, env=environment)


@contextmanager
def site(folder: Path) -> Iterator[Site]:
    """A running site."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        found = Site(folder, free.getsockname()[1])
    found.start_scheduler()
    found.start_workers()
    try:
        yield found
    finally:
        found.stop()


def client_process(folder: Path, scheduler: str, units: int, seconds: float) -> subprocess.Popen[bytes]:
    """The client of an invented study as a process of its own."""
    command = [sys.executable, "-m", "benchmarks.study", "invented", str(folder), "--scheduler", scheduler]
    command += ["--units", str(units), "--seconds", str(seconds)]
    with (folder / "client.log").open("ab") as log:
        return subprocess.Popen(command, cwd=HERE, stdout=log, stderr=log)


def disturbed(kills: Sequence[tuple[str, float]], units: int, seconds: float, folder: Path) -> tuple[int, int]:
    """Run a study in which processes are killed; how often its client was started, and units computed twice.

    Args:
        kills: worker, scheduler or client, and the time after the next finished unit.
        units: of invented work.
        seconds: each.
        folder: of the study.

    Raises:
        RuntimeError: the study does not start, or does not end.
    """
    with site(folder) as there:
        client = client_process(folder, there.address, units, seconds)
        starts = 1
        for what, after_s in kills:
            _await_progress(folder / "ledger", client)
            time.sleep(after_s)
            if what == "worker":
                os.kill(random.choice(there.worker_pids()), signal.SIGKILL)
                continue
            if what == "scheduler":
                there.scheduler.kill()
                client.wait(MOST_S)
                there.stop()
                there.start_scheduler()
                there.start_workers()
            else:
                client.kill()
                client.wait()
            client = client_process(folder, there.address, units, seconds)
            starts += 1
        if client.wait(MOST_S) != 0:
            raise RuntimeError(f"the study does not end well; see {folder / 'client.log'}")
    done = Counter((folder / "ledger").read_text().split())
    return starts, sum(done.values()) - len(done)


def _await_progress(ledger: Path, client: subprocess.Popen[bytes]) -> None:
    """Until one more unit is done, or all are."""
    until = time.monotonic() + MOST_S
    before = _length(ledger)
    while _length(ledger) == before and client.poll() is None:
        if time.monotonic() > until:
            raise RuntimeError(f"the study does not go on; see {ledger.parent / 'client.log'}")
        time.sleep(0.02)


def _length(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def kills(what: list[str], each: int, units: int, seconds: float, seed: int) -> bool:
    """Kill processes of every kind; whether every table was that of an undisturbed run, and nothing was done twice."""
    rng = random.Random(seed)
    well = True
    with tempfile.TemporaryDirectory() as scratch:
        reference = Path(scratch) / "reference"
        reference.mkdir()
        undisturbed_s = run_invented(reference, None, units, seconds, processes=1)
        tables = [(reference / name).read_bytes() for name in ("study.csv", "study.parquet")]
        for kind in what:
            same = twice = again = 0
            for trial in range(each):
                folder = Path(scratch) / f"{kind}-{trial}"
                folder.mkdir()
                after_s = rng.uniform(0.0, undisturbed_s / 2)
                starts, repeated = disturbed([(kind, after_s)], units, seconds, folder)
                equal = tables == [(folder / name).read_bytes() for name in ("study.csv", "study.parquet")]
                same, twice, again = same + equal, twice + repeated, again + starts - 1
                print(f"  {kind} {trial + 1}: after {after_s:.2f} s, table {'the same' if equal else 'DIFFERS'}, "
                      f"{repeated} computed twice, client started {starts} times", flush=True)  # fmt: skip
            print(f"kill -9 of a {kind}: {same} of {each} tables the same, {twice} units computed twice, "
                  f"the client started again {again} times")  # fmt: skip
            well &= same == each and twice == 0
    return well


def efficiency(units: int, seconds: float) -> None:
    """Two workers against one, and two bare processes against one."""
    with tempfile.TemporaryDirectory() as scratch:
        took = {}
        for workers in (1, 2):
            folder = Path(scratch) / str(workers)
            folder.mkdir()
            took[workers] = _through_dask(folder, units, seconds, workers)
        bare = {processes: _bare(units, seconds, processes) for processes in (1, 2)}
    for what, times in (("workers", took), ("bare processes", bare)):
        share = times[1] / times[2] / 2
        print(f"{what}: {times[1]:.2f} s with one, {times[2]:.2f} s with two: {share:.1%} of twice one")
    print(f"overhead of a unit with one worker: {1000 * (took[1] - bare[1]) / units:.1f} ms")


def _through_dask(folder: Path, units: int, seconds: float, workers: int) -> float:
    """Time of the candidates alone: the workers have been started, and have imported all they need."""
    with cluster(None, workers) as client:
        for size, work in ((2 * workers, seconds), (units, seconds)):
            results = open_store(folder / str(size))
            session = Session(
                Crossing(invented_study(size)), results, partial(invented_judge, seconds=work), invented_search
            )
            start = time.monotonic()
            session.run(client, lambda _: None)
        return time.monotonic() - start


def _bare(units: int, seconds: float, processes: int) -> float:
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        list(pool.map(spin, [0.0] * processes))
        start = time.monotonic()
        list(pool.map(spin, [seconds] * units))
        return time.monotonic() - start


def memory(units: int) -> None:
    """Memory of the client as candidates go by."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        # bounds of 0 that nothing reaches: no candidate is left out
        crossing = Crossing(invented_study(units, MOUNTINGS, ("period_s",)))
        session = Session(crossing, open_store(folder / "results"), _nothing, _nothing_found)
        start = time.monotonic()
        told: list[tuple[float, float]] = []

        def say(line: str) -> None:
            told.append((time.monotonic() - start, _now_mb()))
            if len(told) % 15 == 1:
                print(f"  {told[-1][0]:6.0f} s {told[-1][1]:7.1f} MB  {line}", flush=True)

        with cluster(None, 2) as client:
            session.run(client, say)
        took = time.monotonic() - start
        before = _now_mb()
        write_answer(session, folder)
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


def measure_costs(folder: Path, every: int) -> None:
    """Do searches and candidates of the shipped study in one process, and write the table that `--plan` reads."""
    from cad.candidate import judge

    crossing = Crossing(load_study(Path("fleet")))
    found: dict[str, Result] = {}
    seconds: dict[str, list[float]] = {"search": [], "candidate": []}
    memory_mb = {"search": 0.0, "candidate": 0.0}
    possible = [loaded for combination in crossing if (loaded := combination.loaded) is not None]
    for loaded in possible[::every]:
        record = search_record(loaded)
        key = digest(record)
        if key not in found:
            start = time.process_time()  # of all threads: core-seconds, whoever else is on the machine
            found[key] = search_of(record)
            seconds["search"].append(time.process_time() - start)
            memory_mb["search"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        if found[key]["status"] == "found":
            start = time.process_time()
            judge(loaded, found[key])
            seconds["candidate"].append(time.process_time() - start)
            memory_mb["candidate"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print({name: round(times[-1], 1) for name, times in seconds.items() if times}, loaded.task.name, flush=True)
    with (folder / COSTS.name).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["unit", "measured", "mean_s", "most_s", "memory_mb"])
        for name, times in seconds.items():
            writer.writerow(
                [name, len(times), f"{sum(times) / len(times):.2f}", f"{max(times):.2f}", f"{memory_mb[name]:.0f}"]
            )


def main() -> None:
    """Parse the command line, and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    costs = commands.add_parser("costs")
    costs.add_argument("folder", type=Path)
    costs.add_argument("--every", type=int, default=1, help="of the candidates: 1 for all, 4 for each fourth")
    killing = commands.add_parser("kills")
    killing.add_argument(
        "--what", nargs="+", choices=("worker", "scheduler", "client"), default=["worker", "scheduler", "client"]
    )
    killing.add_argument("--each", type=int, default=20)
    killing.add_argument("--units", type=int, default=40)
    killing.add_argument("--seconds", type=float, default=0.2)
    killing.add_argument("--seed", type=int, default=1)
    efficient = commands.add_parser("efficiency")
    efficient.add_argument("--units", type=int, default=40)
    efficient.add_argument("--seconds", type=float, default=1.0)
    commands.add_parser("memory").add_argument("--units", type=int, default=100_000)
    invented = commands.add_parser("invented")
    invented.add_argument("folder", type=Path)
    invented.add_argument("--scheduler")
    invented.add_argument("--units", type=int, default=40)
    invented.add_argument("--seconds", type=float, default=0.2)
    given = parser.parse_args()
    if given.command == "costs":
        measure_costs(given.folder, given.every)
    elif given.command == "kills":
        sys.exit(0 if kills(given.what, given.each, given.units, given.seconds, given.seed) else 1)
    elif given.command == "efficiency":
        efficiency(given.units, given.seconds)
    elif given.command == "memory":
        memory(given.units)
    else:
        run_invented(given.folder, given.scheduler, given.units, given.seconds)


if __name__ == "__main__":
    main()
