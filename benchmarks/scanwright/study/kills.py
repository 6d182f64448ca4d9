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
MOST_S = 300.0  # that a process may take to do anything, on a busy machine
TABLES = ("study.csv", "study.parquet")

Process = subprocess.Popen[bytes]


@dataclass(slots=True)
class Site:
    """A study at work: its client, and the scheduler and the workers of Dask's own commands where it has them.

    Attributes:
        folder: of the study; `client.log` is what its clients say.
        arguments: of the client, beside the folder.
        workers: of the scheduler; 0 for a study on processes of its own.
    """

    folder: Path
    arguments: list[str]
    workers: int
    port: int = 0
    client: Process = field(init=False)
    scheduler: Process = field(init=False)
    nannies: list[Process] = field(default_factory=list)

    def start_scheduler(self) -> None:
        """Start it, or start it again, with its workers; a client waits ten seconds for it and no more."""
        address = f"tcp://127.0.0.1:{self.port}"
        self.scheduler = self._dask("scheduler", "--host", "127.0.0.1", "--port", str(self.port))
        until = time.monotonic() + MOST_S
        while not self._listens():
            if time.monotonic() > until:
                raise RuntimeError(f"the scheduler does not start; see {self.folder / 'scheduler.log'}")
            time.sleep(0.1)
        self.nannies = [self._dask("worker", address, "--nthreads", "1") for _ in range(self.workers)]

    def start_client(self) -> None:
        """Start it, or start it again."""
        command = [sys.executable, "-m", "benchmarks.scanwright.study", "invented", str(self.folder), *self.arguments]
        if self.workers:
            command += ["--scheduler", f"tcp://127.0.0.1:{self.port}"]
        with (self.folder / "client.log").open("ab") as log:
            self.client = subprocess.Popen(command, cwd=HERE, stdout=log, stderr=log)

    def worker_pids(self) -> list[int]:
        """Of the processes that work; whoever made them notices their end."""
        found = []
        for parent in self.nannies or [self.client]:
            of_threads = Path(f"/proc/{parent.pid}/task").glob("*/children")
            children = [pid for text in of_threads for pid in text.read_text().split()]
            found += [int(pid) for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
        return found

    def stop_scheduler(self) -> None:
        """End it and its workers, which end with their nannies."""
        for process in [*self.nannies, self.scheduler]:
            process.kill()
            process.wait()

    def _listens(self) -> bool:
        with socket.socket() as trial:
            return trial.connect_ex(("127.0.0.1", self.port)) == 0

    def _dask(self, *words: str) -> Process:
        command = [str(Path(sys.executable).parent / "dask"), *words, "--no-dashboard"]
        environment = os.environ | {"PYTHONPATH": str(HERE), "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "20s"}
        with (self.folder / f"{words[0]}.log").open("ab") as log:
            return subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log, env=environment)


@contextmanager
def site(folder: Path, arguments: list[str], workers: int) -> Iterator[Site]:
    """A running site."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        found = Site(folder, arguments, workers, free.getsockname()[1])
    if workers:
        found.start_scheduler()
    found.start_client()
    try:
        yield found
    finally:
        found.client.kill()
        found.client.wait()
        if workers:
            found.stop_scheduler()


def disturbed(
    kills: Sequence[tuple[str, float]], units: int, seconds: float, folder: Path, workers: int = 0
) -> tuple[int, int]:
    """Run a study in which processes are killed; how often its client was started, and units computed twice.

    Args:
        kills: worker, scheduler or client, and the time after the next finished unit.
        units: of invented work.
        seconds: each.
        folder: of the study; `client.log` is what its clients say.
        workers: of a Dask scheduler; 0 for two processes of the client's own.

    Raises:
        RuntimeError: the study does not start, or does not end.
    """
    with site(folder, ["--units", str(units), "--seconds", str(seconds)], workers) as there:
        starts = 1
        for what, after_s in kills:
            _await_progress(folder / "ledger", there.client)
            time.sleep(after_s)
            if what == "worker":
                os.kill(random.choice(there.worker_pids()), signal.SIGKILL)
                continue
            if what == "scheduler":
                there.scheduler.kill()
                there.client.wait(MOST_S)
                there.stop_scheduler()
                there.start_scheduler()
            else:
                there.client.kill()
                there.client.wait()
            there.start_client()
            starts += 1
        if there.client.wait(MOST_S) != 0:
            raise RuntimeError(f"the study does not end well; see {folder / 'client.log'}")
    done = Counter((folder / "ledger").read_text().split())
    return starts, sum(done.values()) - len(done)


def _await_progress(ledger: Path, client: Process) -> None:
    """Until one more unit is done, or all are."""
    until = time.monotonic() + MOST_S
    before = _length(ledger)
    while _length(ledger) == before and client.poll() is None:
        if time.monotonic() > until:
            raise RuntimeError(f"the study does not go on; see {ledger.parent / 'client.log'}")
        time.sleep(0.02)


def _length(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def kills(what: list[str], each: int, units: int, seconds: float, seed: int, workers: int) -> bool:
    """Kill processes of every kind; whether every table was that of an undisturbed run, and nothing was done twice."""
    rng = random.Random(seed)
    well = True
    with tempfile.TemporaryDirectory() as scratch:
        reference = Path(scratch) / "reference"
        reference.mkdir()
        undisturbed_s = run_invented(reference, None, units, seconds, processes=1)
        tables = [(reference / name).read_bytes() for name in TABLES]
        for kind in what:
            same = twice = again = 0
            for trial in range(each):
                folder = Path(scratch) / f"{kind}-{trial}"
                folder.mkdir()
                after_s = rng.uniform(0.0, undisturbed_s / 2)
                starts, repeated = disturbed([(kind, after_s)], units, seconds, folder, workers)
                equal = tables == [(folder / name).read_bytes() for name in TABLES]
                same, twice, again = same + equal, twice + repeated, again + starts - 1
                print(f"  {kind} {trial + 1}: after {after_s:.2f} s, table {'the same' if equal else 'DIFFERS'}, "
                      f"{repeated} computed twice, client started {starts} times", flush=True)  # fmt: skip
            print(f"kill -9 of a {kind}: {same} of {each} tables the same, {twice} units computed twice, "
                  f"the client started again {again} times")  # fmt: skip
            well &= same == each and twice == 0
    return well
