"""Worker processes for work in the background. On one core the work runs in this process.

The result is the same in both cases: functions must depend on their arguments alone, which are copied.
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
    """Start work and return a function that waits for its result; errors of the work are raised there."""

    def __call__(self, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Callable[[], T]:
        """Start `work` with these arguments."""
        ...


@dataclass(frozen=True, slots=True)
class Packed(Generic[T]):
    """A pickled value that this process passes between workers without importing its modules."""

    content: bytes

    @staticmethod
    def of(value: T) -> Packed[T]:
        """Pack a value."""
        return Packed(pickle.dumps(value))

    def open(self) -> T:
        """Return a copy of the value."""
        value: T = pickle.loads(self.content)
        return value


@contextmanager
def worker_processes(count: int = 1, modules: Sequence[str] = ()) -> Iterator[Begin]:
    """Yield a function that starts work in `count` worker processes; they end with the block, finished or not.

    Functions, arguments and results are pickled: functions of modules only. Workers are forked from a server process
    that imports `modules` at once. It remains for the next block unless this one fails, and imports nothing more.
    """
    can_fork = "forkserver" in multiprocessing.get_all_start_methods()  # Windows cannot
    if cores() < 2 or not can_fork or multiprocessing.current_process().daemon:
        yield in_turn
        return
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(modules))
    resource_tracker.ensure_running()  # first: starting it unblocks Ctrl-C
    with sigint_deferred(), one_thread_each():
        forkserver.ensure_running()
    pool = ProcessPoolExecutor(count, context, _initialise_worker)

    def submit(work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Callable[[], T]:
        future = pool.submit(work, *args, **kwargs)

        def result() -> T:
            try:
                return future.result()
            except BrokenExecutor as error:
                raise BuildError("a process of the build was killed: is there memory enough?") from error

        return result

    try:
        try:
            yield submit
        finally:
            kill(pool)
    except BaseException:  # the server may still import, and readers of our output would wait for its end
        _kill_server()
        raise


def in_turn(work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> Callable[[], T]:
    """Do the work when its result is requested, on a copy of its arguments.

    A worker process gets such a copy: a pickled solid differs in the last bit of a direction, which a drawing can round
    up or down.
    """
    packed = pickle.dumps((args, kwargs))

    def result() -> T:
        args, kwargs = pickle.loads(packed)
        return work(*args, **kwargs)

    return result


def spawn_pool() -> ProcessPoolExecutor:
    """Return a pool of one persistent process for functions of modules; it ignores Ctrl-C and ends with its owner."""
    # spawned and not forked: a fork of a process with threads may lock up
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _initialise_worker)


@contextmanager
def sigint_deferred() -> Iterator[None]:
    """Defer Ctrl-C to the end of the block, also in processes that start in it, until they ignore it.

    Blocked in this thread only, it would arrive through another thread, and Python would raise KeyboardInterrupt here,
    while a new process is being set up.
    """
    received: list[tuple[int, FrameType | None]] = []
    main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, lambda *call: received.append(call)) if main else None
    masks = hasattr(signal, "pthread_sigmask")  # Windows has none
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if masks else set()
    try:
        yield
    finally:
        if main:
            signal.signal(signal.SIGINT, before)
        if masks:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        if received and callable(before):
            before(*received[0])


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Limit processes that start in the block to one thread each, since there is one process for each core."""
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
    """End the process at once, finished or not."""
    for process in list((getattr(pool, "_processes", None) or {}).values()):
        process.kill()
    pool.shutdown(cancel_futures=True)


def _kill_server() -> None:
    """Kill the server at once; the next block starts another one. The library has no public function for that."""
    server: Any = forkserver._forkserver
    if server._forkserver_pid is not None:
        os.kill(server._forkserver_pid, signal.SIGKILL)
        server._stop()  # waits for its death


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _initialise_worker() -> None:
    """Ignore Ctrl-C, which the owner handles, and exit if the owner ends, since a killed owner cannot stop workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    owner = multiprocessing.parent_process()
    assert owner is not None

    def watch() -> None:
        owner.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
