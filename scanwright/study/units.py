"""Units of work over an executor, a window at a time, so that the client's memory stays small.

A unit is looked up, or else computed under a time limit and stored by its worker. If it fails or its worker dies, it is
tried again, `TRIES` times in all, and then reported as failed.
"""

from __future__ import annotations

import multiprocessing
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from scanwright.design.errors import BuildError, ScanwrightError
from scanwright.study.results import Result, Results, program

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

TRIES = 3  # of a unit, since workers can be killed by chance
TICK_S = 5.0  # between two calls of `tick` while no unit finishes
DEATHS = ("BrokenProcessPool", "KilledWorker")  # by name, since Dask need not be installed


@dataclass(frozen=True, slots=True)
class Unit:
    """A pure function and its arguments; `address` is that of its result."""

    address: str
    function: Callable[..., Result]
    arguments: tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Done:
    """The result of a worker."""

    result: Result  # of the unit
    seconds: float | None  # computing time; None if the result existed
    memory_mb: float  # peak memory of the worker; 0 if unknown
    stored: bool  # whether the result is in the results folder


@dataclass(frozen=True, slots=True)
class Finished:
    """A finished unit: its result, or the reason why there is none."""

    unit: Unit
    done: Done | None
    failure: str = ""


@dataclass(frozen=True, slots=True)
class Crew:
    """An executor, and a function that returns the number of units that can run now.

    The function raises BuildError if there will be no worker.
    """

    executor: Executor
    width: Callable[[], int]


def finished(
    crew: Crew,
    units: Iterable[Unit],
    results: Results,
    limit_s: float,
    tick: Callable[[int], None] = lambda _: None,
) -> Iterator[Finished]:
    """Do units, and yield them in the order in which they finish; those in the results folder are looked up.

    The next unit is taken from `units` only when a worker is free, so it can depend on finished results. `tick` is
    called with the width of the crew while no unit finishes.

    Raises:
        BuildError: no worker is left, or the results of one would differ.
    """
    waiting = ((unit, 1) for unit in units)
    again: list[tuple[Unit, int]] = []
    at_work: dict[Future[Done], tuple[Unit, int]] = {}
    more = True
    while more or again or at_work:
        while (more or again) and len(at_work) < max(1, crew.width()):
            tried = again.pop() if again else next(waiting, None)
            if tried is None:
                more = False
                continue
            known = results.get(tried[0].address)
            if known is None:
                at_work[crew.executor.submit(do, tried[0], results, program(), limit_s)] = tried
            else:
                yield Finished(tried[0], Done(known, None, 0.0, True))
        ended, _ = wait(at_work, TICK_S, FIRST_COMPLETED)
        if at_work and not ended:
            tick(crew.width())
        for future in ended:
            unit, tries = at_work.pop(future)
            try:
                done = future.result()
            except (ScanwrightError, CancelledError):  # not a fault of the unit, which returns rejections as results
                raise
            except ImportError as error:
                raise BuildError(f"a worker lacks a package ({error}): install the same scanwright there") from error
            except Exception as error:
                if tries < TRIES:
                    again.append((unit, tries + 1))
                else:
                    yield Finished(unit, None, _reason(error, limit_s))
                continue
            if not done.stored:
                results.put(unit.address, done.result)
            yield Finished(unit, done)


def do(unit: Unit, results: Results, client: dict[str, str], limit_s: float) -> Done:
    """Do a unit, as a worker, with the results folder of the client if this worker has access to it.

    `client` is the `program` of the client; the process ends after `limit_s`.

    Raises:
        BuildError: the program of this worker differs.
    """
    own = program()
    differs = sorted(name for name in own.keys() | client.keys() if own.get(name) != client.get(name))
    if differs:
        name = differs[0]
        more = f" (and {len(differs) - 1} more)" if len(differs) > 1 else ""
        raise BuildError(
            f"a worker has {name} {own.get(name, 'missing')}, this computer {client.get(name, 'missing')}{more}: "
            "results would differ; install the same versions and run the study again: it continues"
        )
    here = results.is_here()
    known = results.get(unit.address) if here else None
    if known is not None:
        return Done(known, None, _memory_mb(), True)
    start = time.monotonic()
    with _limited(limit_s):
        result = unit.function(*unit.arguments)
        if here:
            results.put(unit.address, result)
    return Done(result, time.monotonic() - start, _memory_mb(), here)


_deadlines: dict[int, float] = {}  # of the threads of this process, which has only one alarm
_lock = threading.Lock()


@contextmanager
def _limited(limit_s: float) -> Iterator[None]:
    """End the process by an alarm of the system if the block takes longer.

    There is no limit in a process without a parent: the client, or a worker that would not be restarted.
    """
    if multiprocessing.parent_process() is None:
        yield
        return
    me = threading.get_ident()
    try:
        with _lock:
            _deadlines[me] = time.monotonic() + limit_s
            _set_alarm()
        yield
    finally:
        with _lock:
            del _deadlines[me]
            _set_alarm()


def _set_alarm() -> None:
    left_s = max(1e-3, min(_deadlines.values()) - time.monotonic()) if _deadlines else 0.0  # 0: no alarm
    if hasattr(signal, "setitimer"):  # Windows has no alarms, and so no limit
        signal.setitimer(signal.ITIMER_REAL, left_s)


def _memory_mb() -> float:
    return 0.0 if resource is None else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _reason(error: Exception, limit_s: float) -> str:
    """Return why a unit has no result, in a text that does not depend on the worker."""
    if type(error).__name__ in DEATHS:
        return f"every worker that tried died: killed, out of memory, or longer than time_limit_s = {limit_s:g}"
    lines = str(error).splitlines()
    return f"{type(error).__name__}: {lines[0] if lines else 'no message'}"
