"""Processes of a study that are killed, and what becomes of its table."""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.scanwright.study.invented import run_invented

HERE = Path(__file__).parents[3]
MOST_S = 120.0  # that a process may take to do anything


@dataclass(slots=True)
class Site:
    """A scheduler and its workers, started by Dask's own commands, over TCP."""

    folder: Path
    port: int
    workers: int
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
def site(folder: Path, workers: int) -> Iterator[Site]:
    """A running site."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        found = Site(folder, free.getsockname()[1], workers)
    found.start_scheduler()
    found.start_workers()
    try:
        yield found
    finally:
        found.stop()


def client_process(folder: Path, scheduler: str, units: int, seconds: float) -> subprocess.Popen[bytes]:
    """The client of an invented study as a process of its own."""
    command = [sys.executable, "-m", "benchmarks.scanwright.study", "invented", str(folder), "--scheduler", scheduler]
    command += ["--units", str(units), "--seconds", str(seconds)]
    with (folder / "client.log").open("ab") as log:
        return subprocess.Popen(command, cwd=HERE, stdout=log, stderr=log)


def disturbed(
    kills: Sequence[tuple[str, float]], units: int, seconds: float, folder: Path, workers: int = 2
) -> tuple[int, int]:
    """Run a study in which processes are killed; how often its client was started, and units computed twice.

    Args:
        kills: worker, scheduler or client, and the time after the next finished unit.
        units: of invented work.
        seconds: each.
        folder: of the study; `client.log` is what its clients say.
        workers: of the site.

    Raises:
        RuntimeError: the study does not start, or does not end.
    """
    with site(folder, workers) as there:
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
