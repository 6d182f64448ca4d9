"""One unit of work as a worker does it: looked up, else computed under a time limit, and kept at once."""

from __future__ import annotations

import faulthandler
import os
import resource
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TextIO

from scanwright.study.runner.identity import identity
from scanwright.study.runner.store import Result, shared_store


@dataclass(frozen=True, slots=True)
class Unit:
    """A pure function and its arguments; `address` is that of its result, `name` is for people.

    Dask learns how long units of a `kind` take, and shares them out by that: long ones must not go by short ones' name.
    """

    address: str
    name: str
    function: Callable[..., Result]
    arguments: tuple[Any, ...]
    kind: str = "unit"


@dataclass(frozen=True, slots=True)
class Done:
    """What a worker hands back.

    Attributes:
        result: of the unit.
        seconds: it took, None where the result was there.
        memory_mb: the most that the worker has ever had.
        kept: whether the worker has kept the result in the folder of the client.
    """

    result: Result
    seconds: float | None
    memory_mb: float
    kept: bool


class OtherVersionError(Exception):
    """A worker that joined later has other versions."""


def do(unit: Unit, folder: str, mark: str, program: dict[str, str], limit_s: float) -> Done:
    """Do a unit.

    Args:
        unit: what to do.
        folder: results folder of the client; used if this worker sees it.
        mark: of that folder.
        program: `identity` of the client.
        limit_s: after which the worker ends itself, for its nanny to start another.

    Raises:
        OtherVersionError: this worker's program is another one.
    """
    if identity() != program:
        raise OtherVersionError("a worker of another version has joined: results would differ")
    store = shared_store(folder, mark)
    found = store.get(unit.address) if store else None
    if found is not None:
        return Done(found, None, _memory_mb(), True)
    start = time.monotonic()
    with _limited(limit_s):
        result = unit.function(*unit.arguments)
        if store:
            store.put(unit.address, result)
    return Done(result, time.monotonic() - start, _memory_mb(), store is not None)


_deadlines: dict[int, float] = {}
_lock = threading.Lock()


@contextmanager
def _limited(limit_s: float) -> Iterator[None]:
    """End the process when the block takes longer: a thread of the interpreter's own, that no held lock can stop.

    A worker without a nanny would be lost, and one that is the client itself would end the study: none there.
    """
    if not _has_nanny():
        yield
        return
    me = threading.get_ident()
    try:
        with _lock:
            _deadlines[me] = time.monotonic() + limit_s
            _arm()
        yield
    finally:
        with _lock:
            del _deadlines[me]
            _arm()


def _arm() -> None:
    faulthandler.cancel_dump_traceback_later()
    if _deadlines:
        left = max(0.001, min(_deadlines.values()) - time.monotonic())
        faulthandler.dump_traceback_later(left, exit=True, file=_nowhere())


@cache
def _nowhere() -> TextIO:
    """For the traceback that comes with it: the table tells of the unit, and a terminal is no place for it."""
    return Path(os.devnull).open("w")


def _has_nanny() -> bool:
    from distributed import get_worker

    try:
        return get_worker().nanny is not None
    except ValueError:  # not on a worker
        return False


def _memory_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
