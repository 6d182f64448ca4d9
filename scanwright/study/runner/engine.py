"""Units of work through Dask: a window of them at a time, so that the client stays small however many there are.

Queue, retries and deaths are Dask's: an exception is tried `RETRIES` times more, a unit whose worker dies goes to
another one until Dask's own `allowed-failures` are used up. Dask blames all that a dying worker held, also what only
waited there: so what it gives up is asked for once more at the end, alone, and what fails then is told as a failure.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from design.errors import BuildError
from scanwright.study.runner.identity import identity
from scanwright.study.runner.store import Result, Store
from scanwright.study.runner.work import Done, OtherVersionError, Unit, do

if TYPE_CHECKING:
    from distributed import Client, Future

RETRIES = 1  # of an exception: our own errors are results, what is left may be the machine's
AHEAD = 3  # units sent for each thread once the first is back: none waits for the client
POLL_S = 0.02
ALONE_S = 120.0  # without any worker: a nanny whose worker dies while it starts gives up
AGAIN = "-again"
TICK_S = 5.0  # between two words on a long silence


@dataclass(frozen=True, slots=True)
class Finished:
    """A unit that is over: its result, or why there is none.

    Attributes:
        unit: what was to be done.
        result: None where there is none.
        failure: why.
        seconds: None where it was looked up.
        memory_mb: the most that its worker has ever had.
        died: its workers did.
    """

    unit: Unit
    result: Result | None
    failure: str
    seconds: float | None
    memory_mb: float
    died: bool = False


def run(
    client: Client,
    units: Iterable[Unit],
    store: Store,
    limit_s: float,
    ticked: Callable[[int], None] = lambda _: None,
) -> Iterator[Finished]:
    """Do units on a cluster; they come back in the order they end.

    `units` is asked for the next one only when there is room, so it may look at what has come back so far.

    Args:
        client: of the cluster.
        units: what to do; those in the store are looked up and not sent.
        store: where results are kept.
        limit_s: that a unit may take on a worker.
        ticked: called every few seconds with the number of threads at work.

    Raises:
        BuildError: the scheduler is gone, or a worker of another version has joined.
    """
    suspects: dict[str, list[Finished]] = {}
    for done in _run(client, units, store, limit_s, ticked):
        if done.died:
            suspects.setdefault(done.unit.address, []).append(done)
        else:
            yield done
    for same in suspects.values():
        (again,) = _run(client, [same[0].unit], store, limit_s, ticked, AGAIN)
        yield again
        for _ in same[1:]:
            yield replace(again, seconds=None)


def _run(
    client: Client,
    units: Iterable[Unit],
    store: Store,
    limit_s: float,
    ticked: Callable[[int], None],
    attempt: str = "",
) -> Iterator[Finished]:
    """All units once; `attempt` ends their keys: the client may not have forgotten yet how those of another ended."""
    from distributed import CancelledError, as_completed
    from distributed.comm import CommClosedError

    waiting = iter(units)
    at_work: dict[str, Unit] = {}
    twins: Counter[str] = Counter()  # of units at work: the same record came again
    ended = as_completed(loop=client.loop)
    last = seen = time.monotonic()
    threads = _threads(client)
    more, ahead = True, 1
    while more or at_work:
        while more and len(at_work) < ahead * max(1, threads):
            unit = next(waiting, None)
            if unit is None:
                more = False
                break
            known = store.get(unit.address)
            if known is not None:
                yield Finished(unit, known, "", None, 0.0)
                continue
            key = f"scanwright_{unit.kind}-{unit.address}{attempt}"
            if key in at_work:
                twins[unit.address] += 1
                continue
            future = _submit(client, key, unit, store, limit_s)
            at_work[future.key] = unit
            ended.add(future)
        if not at_work:
            continue
        for future in ended.next_batch(block=False) if ended.has_ready() else ():
            if future.status in ("pending", "lost") and client.status == "running":
                ended.add(future)  # its worker died with the result, and another one does it again
                continue
            try:
                done = _taken(at_work.pop(future.key), future, store, limit_s)
            except (CommClosedError, CancelledError) as error:
                raise BuildError(_gone(client)) from error
            ahead = AHEAD  # not before: what the first have come to may rule out the next
            del future  # the cluster forgets the result
            yield done
            for _ in range(twins.pop(done.unit.address, 0)):
                yield replace(done, seconds=None)
        if client.status != "running":
            raise BuildError(_gone(client))
        if not ended.has_ready():
            time.sleep(POLL_S)
        if time.monotonic() - last > TICK_S:
            last, threads = time.monotonic(), _threads(client)
            ticked(threads)
            seen = last if threads else seen
            if last - seen > ALONE_S:
                raise BuildError(
                    f"no worker has been there for {ALONE_S:g} s: start workers, and run the study again: it goes on"
                )


def _submit(client: Client, key: str, unit: Unit, store: Store, limit_s: float) -> Future:
    try:
        return client.submit(
            do,
            unit,
            str(store.folder),
            store.mark,
            identity(),
            limit_s,
            key=key,
            pure=True,
            retries=RETRIES,
        )
    except Exception as error:  # whatever the transport raises on a scheduler that is gone
        if client.status == "running":
            raise
        raise BuildError(_gone(client)) from error


def _taken(unit: Unit, future: Future, store: Store, limit_s: float) -> Finished:
    """The end of a unit; its result is kept here where the worker could not."""
    from distributed.scheduler import KilledWorker

    status = future.status
    if status == "finished":
        done: Done = future.result()
        if not done.kept:
            store.put(unit.address, done.result)
        return Finished(unit, done.result, "", done.seconds, done.memory_mb)
    if status == "error":
        error = future.exception()
        return Finished(unit, None, _reason(error, limit_s), None, 0.0, isinstance(error, KilledWorker))
    raise BuildError(_gone(future.client))


def _reason(error: Any, limit_s: float) -> str:
    """Why a unit has no result, the same words whichever worker it was.

    Raises:
        BuildError: it is not the unit's fault.
    """
    from distributed.scheduler import KilledWorker

    if isinstance(error, OtherVersionError):
        raise BuildError(f"study: {error}; install the same versions, and run the study again: it goes on")
    if isinstance(error, KilledWorker):
        return f"every worker that tried died: killed, out of memory, or longer than time_limit_s = {limit_s:g}"
    said = str(error).splitlines()
    return f"{type(error).__name__}: {said[0] if said else 'no message'}"


def _threads(client: Client) -> int:
    return int(sum(worker["nthreads"] for worker in client.scheduler_info(n_workers=-1)["workers"].values()))


def _gone(client: Client) -> str:
    where = client.scheduler.address if client.scheduler else "?"
    return f"the scheduler at {where} is gone: run the study again, it goes on where it was"
