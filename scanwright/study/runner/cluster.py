"""Where the work is done: processes of this machine, or the workers of a running Dask scheduler, all of one version."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from design.errors import BuildError, TaskError
from scanwright.study.runner.identity import tools

if TYPE_CHECKING:
    from distributed import Client

LOCAL = "127.0.0.1:0"  # for its page, on any port
ADDRESS = re.compile(r"(tcp|tls|wss?)://[^\s/]+:\d{1,5}")
CONNECT_S = 10.0
JOIN_S = 20.0  # for the first worker of a scheduler to join
NOT_OURS = {"distributed.worker.memory.pause": False}  # a worker that pauses may never go on: end it, and start another


@contextmanager
def cluster(scheduler: str | None, processes: int | None = None, memory: str = "auto") -> Iterator[Client]:
    """A client of a running scheduler, or of a cluster of processes of this machine that ends with it.

    Args:
        scheduler: address such as tcp://HOST:PORT; None for this machine.
        processes: of this machine; as many as it has cores if not told.
        memory: that each of them may take, such as "2 GiB"; by default its share of the machine's.

    Raises:
        TaskError: the scheduler is not there, or no scheduler at all can be.
        BuildError: no worker has joined, or one has another version of what decides results.
    """
    try:
        import pyarrow  # noqa: F401  for the table, hours from now
        from distributed import Client
    except ImportError as error:
        raise TaskError(f"study: {error}: studies need an extra: pip install 'scanwright[cluster]'") from error
    for name in ("distributed", "distributed.client"):  # deaths are told in the table, or in one line
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if scheduler is None:
        with _local(processes, memory) as address, Client(address, set_as_default=False) as client:
            _compare(client)
            yield client
        return
    if not ADDRESS.fullmatch(scheduler):
        raise TaskError(f"--scheduler = '{scheduler}': an address is tcp://HOST:PORT, such as tcp://127.0.0.1:8786")
    try:
        client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        said = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise TaskError(
            f"--scheduler = '{scheduler}': no scheduler answers there ({said}): start one with `dask scheduler`, "
            "and give the tcp:// address that it prints"
        ) from error
    with client:
        _await_worker(client, scheduler)
        _compare(client)
        yield client


@contextmanager
def _local(processes: int | None, memory: str) -> Iterator[str]:
    import dask
    from distributed import LocalCluster, scheduler, worker

    # spans keep an entry for every task there ever was: a study of a million would fill this process
    of_scheduler, of_workers = (
        {name: kind for name, kind in module.DEFAULT_EXTENSIONS.items() if name != "spans"}
        for module in (scheduler, worker)
    )
    with (
        dask.config.set(NOT_OURS),
        LocalCluster(
            n_workers=processes,
            threads_per_worker=1,
            processes=True,
            memory_limit=memory,
            dashboard_address=LOCAL,
            silence_logs=50,
            scheduler_kwargs={"extensions": of_scheduler},
            extensions=of_workers,
        ) as local,
    ):
        number = len(local.workers)
        local.adapt(minimum=number, maximum=number)  # a nanny whose worker dies while it starts is lost: take another
        yield local.scheduler_address


def _await_worker(client: Client, scheduler: str) -> None:
    until = time.monotonic() + JOIN_S
    try:
        client.wait_for_workers(1, timeout=max(0.1, until - time.monotonic()))
    except TimeoutError as error:
        raise BuildError(
            f"--scheduler = '{scheduler}': no worker has joined it within {JOIN_S:g} s: start one with "
            f"`dask worker {scheduler} --nthreads 1`"
        ) from error


def _compare(client: Client) -> None:
    """Compare versions before any work.

    Raises:
        BuildError: a worker has others.
    """
    own = tools()
    for worker, other in client.run(tools, on_error="return").items():
        if isinstance(other, BaseException):
            said = f"{type(other).__name__}: {other}"
            raise BuildError(f"worker {worker} cannot take part ({said}): install the same scanwright there")
        differs = sorted(name for name in own.keys() | other.keys() if own.get(name) != other.get(name))
        if differs:
            name = differs[0]
            more = f" (and {len(differs) - 1} more)" if len(differs) > 1 else ""
            raise BuildError(
                f"worker {worker} has {name} {other.get(name, 'missing')}, this computer {own.get(name, 'missing')}"
                f"{more}: results would differ; install the same versions"
            )
