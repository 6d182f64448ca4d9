"""The workers of a study: processes of this computer, or of a running Dask scheduler."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import AbstractContextManager, contextmanager
from queue import SimpleQueue
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from scanwright.design.concurrency.processes import cores, kill, one_thread_each, sigint_deferred, spawn_pool
from scanwright.design.errors import BuildError, TaskError, require
from scanwright.study.units import Crew

if TYPE_CHECKING:
    from distributed import Client

P = ParamSpec("P")
T = TypeVar("T")

ADDRESS = re.compile(r"(tcp|tls|wss?)://[^\s/]+:\d{1,5}")
CONNECT_S = 10.0  # for a scheduler to answer
ALONE_S = 60.0  # without any worker, before the run ends
COUNT_S = 5.0  # between two counts of the workers


def crew_of(scheduler: str | None, processes: int | None = None) -> AbstractContextManager[Crew]:
    """Return the crew of a scheduler at tcp://HOST:PORT, or of processes, one for each core by default.

    Raises:
        InstallError: Dask is not installed.
        TaskError: the scheduler does not answer, or its address is invalid.
        BuildError: during the work: the scheduler has stopped, or there was no worker for a minute.
    """
    return _local_crew(processes or cores()) if scheduler is None else _scheduler_crew(scheduler)


class SingleProcesses(Executor):
    """Processes in separate pools: in one pool the death of a worker would end all others, with an unknown culprit."""

    def __init__(self, processes: int) -> None:
        self._pools = [spawn_pool() for _ in range(processes)]
        self._idle: SimpleQueue[int] = SimpleQueue()
        for number in range(processes):
            self._idle.put(number)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """See `Executor`; waits for an idle process, and replaces a dead one."""
        number = self._idle.get()
        with sigint_deferred():
            try:
                future = self._pools[number].submit(fn, *args, **kwargs)
            except BrokenExecutor:
                self._pools[number] = spawn_pool()
                future = self._pools[number].submit(fn, *args, **kwargs)
        future.add_done_callback(lambda _: self._idle.put(number))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002  one way to end
        """End all processes, at work or not."""
        for pool in self._pools:
            kill(pool)


@contextmanager
def _local_crew(processes: int) -> Iterator[Crew]:
    with one_thread_each(), SingleProcesses(processes) as executor:
        yield Crew(executor, lambda: processes)


@contextmanager
def _scheduler_crew(address: str) -> Iterator[Crew]:
    require("cluster", "a scheduler needs Dask", "dask", "distributed")
    from distributed import Client

    if not ADDRESS.fullmatch(address):
        raise TaskError(f"scheduler = '{address}': must be tcp://HOST:PORT, such as tcp://127.0.0.1:8786")
    for name in ("distributed", "distributed.client"):  # deaths of workers are in the table
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise TaskError(
            f"scheduler = '{address}': no scheduler answers there ({reason}): start one with `dask scheduler`, "
            "and give the tcp:// address that it prints"
        ) from error
    with client:
        try:
            # not pure: a repeated unit would get the future of its failure
            yield Crew(client.get_executor(pure=False), _Threads(client, address))
        except Exception as error:  # errors of the transport, and futures that it has cancelled
            if client.status == "running":
                raise
            raise BuildError(f"the scheduler at {address} has stopped: run the study again, it continues") from error


class _Threads:
    """The number of worker threads of a scheduler, updated at intervals."""

    def __init__(self, client: Client, address: str) -> None:
        self._client, self._address = client, address
        self._counted = self._present = time.monotonic()
        self._number = self._now()

    def __call__(self) -> int:
        if time.monotonic() - self._counted > (COUNT_S if self._number else 0.1):
            self._number = self._now()
        if self._present < self._counted - ALONE_S:
            raise BuildError(
                f"no worker has been there for {ALONE_S:g} s: start `dask worker {self._address} --nthreads 1`, "
                "and run the study again: it continues"
            )
        return self._number

    def _now(self) -> int:
        number = sum(self._client.nthreads().values())
        self._counted = time.monotonic()
        self._present = self._counted if number else self._present
        return number
