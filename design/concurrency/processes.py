"""Processes beside this one, for work that does not wait for it. On one core all is done in this one.

The result is the same either way: what is called must depend on its arguments alone, and these are copied.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import forkserver, resource_tracker
from types import FrameType
from typing import Any, Generic, ParamSpec, Protocol, TypeVar

from scanwright.design.errors import BuildError

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # as Dask sets for its own workers

P = ParamSpec("P")
T = TypeVar("T")


class Begin(Protocol):
    """Begin some work, and get what waits for its result; an error of the work is raised there."""

    def __call__(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Callable[[], T]:
        """`work` and what it is called with."""
        ...


@dataclass(frozen=True, slots=True)
class Packed(Generic[T]):
    """What this process passes on from one to another, and cannot open without loading what that takes."""

    content: bytes

    @staticmethod
    def of(value: T) -> Packed[T]:
        """Pack it."""
        return Packed(pickle.dumps(value))

    def open(self) -> T:
        """A copy of what was packed."""
        value: T = pickle.loads(self.content)
        return value


@contextmanager
def worker_processes(count: int = 1, modules: Sequence[str] = ()) -> Iterator[Begin]:
    """What begins work in so many processes beside this one; they end with the block, their work done or not.

    Functions, arguments and results are pickled: functions of modules only. A process that has loaded `modules`, which
    it begins to do at once, is their mould; it stays for the next block unless this one fails, and loads nothing more.
    """
    can_mould = "forkserver" in multiprocessing.get_all_start_methods()  # Windows cannot
    if cores() < 2 or not can_mould or multiprocessing.current_process().daemon:
        yield in_turn
        return
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(modules))
    resource_tracker.ensure_running()  # first, for to start it lets Ctrl-C through
    with sigint_deferred(), one_thread_each():
        forkserver.ensure_running()
    pool = ProcessPoolExecutor(count, context, _attend)

    def beside(work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Callable[[], T]:
        future = pool.submit(work, *args, **kwargs)

        def result() -> T:
            try:
                return future.result()
            except BrokenExecutor as error:
                raise BuildError("a process of the build was killed: is there memory enough?") from error

        return result

    try:
        try:
            yield beside
        finally:
            kill(pool)
    except BaseException:  # the mould may still load, and whoever reads what this prints would wait for it
        _kill_mould()
        raise


def in_turn(work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Callable[[], T]:
    """Begin nothing: the work is done when its result is asked for, on a copy of what it is given.

    The copy is what a second process would get: a solid that was pickled differs in the last bit of a direction, and a
    drawing may round that up or down.
    """
    packed = pickle.dumps((args, kwargs))

    def result() -> T:
        given, named = pickle.loads(packed)
        return work(*given, **named)

    return result


def spawn_pool() -> ProcessPoolExecutor:
    """One process that stays, for calls of functions of modules; it is deaf to Ctrl-C, and ends with its owner."""
    # spawned and not forked: a fork of a process with threads may lock up
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _attend)


@contextmanager
def sigint_deferred() -> Iterator[None]:
    """Ctrl-C waits for the end of the block, and what is born in it cannot hear it before it turns a deaf ear.

    Blocked in this thread it would still come by another one, and Python would raise it here: in the middle of what a
    new process is to be told.
    """
    came: list[tuple[int, FrameType | None]] = []
    main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, lambda *told: came.append(told)) if main else None
    masks = hasattr(signal, "pthread_sigmask")  # Windows has none
    held = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masks else set()
    try:
        yield
    finally:
        if main:
            signal.signal(signal.SIGINT, before)
        if masks:
            signal.pthread_sigmask(signal.SIG_SETMASK, held)
        if came and callable(before):
            before(*came[0])


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Processes that are born in the block compute in one thread each: there is one of them for every core."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def kill(pool: ProcessPoolExecutor) -> None:
    """End the process at once, its work done or not."""
    for process in list((getattr(pool, "_processes", None) or {}).values()):
        process.kill()
    pool.shutdown(cancel_futures=True)


def _kill_mould() -> None:
    """At once; the next block begins another one. The library offers no public way to end it before its owner."""
    mould: Any = forkserver._forkserver
    if mould._forkserver_pid is not None:
        os.kill(mould._forkserver_pid, signal.SIGKILL)
        mould._stop()  # waits for its death


def cores() -> int:
    """That this process may use."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _attend() -> None:
    """Ctrl-C reaches both, and the owner ends this one; one that was killed tells nobody, so this one watches it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    owner = multiprocessing.parent_process()
    assert owner is not None

    def watch() -> None:
        owner.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
