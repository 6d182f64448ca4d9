"""The processes that make parts and scans for the page: newest wish first, and none of it in the page's own process."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass

from design.errors import ScanwrightError
from design.frames import Array
from design.problem import Problem
from design.scanner import Scanner
from design.studio.newest import Newest
from design.studio.state import Setting
from design.studio.workbench import Body, Workbench, scanner_at, view_of
from design.task import LoadedTask


@dataclass(frozen=True, slots=True)
class Order:
    """What is to be made.

    Attributes:
        loaded: the task.
        problem: its numbers.
        setting: the angles.
        scanner: whether its bodies are wanted.
        scene: whose scan is wanted: "" none, "task" the task's, else the furnished room.
    """

    loaded: LoadedTask
    problem: Problem
    setting: Setting
    scanner: bool
    scene: str


@dataclass(frozen=True, slots=True)
class Shows:
    """Where what was made goes: called from the makers' thread."""

    bodies: Callable[[Setting, bool, tuple[Body, ...]], None]
    points: Callable[[Setting, Array], None]
    note: Callable[[str, bool], None]


class Makers:
    """Orders in, bodies and points out."""

    def __init__(self, bench: Workbench, shows: Shows) -> None:
        self._bench, self._shows = bench, shows
        self._pool = _pool()
        self._newest: Newest[Order] = Newest("makers", self._make)
        self._stands: Scanner | None = None

    def order(self, order: Order) -> None:
        """Make this, and nothing that was ordered before and has not begun."""
        self._newest.wish(order)

    def settled(self, timeout_s: float) -> bool:
        """Wait until all is made; False where that takes longer."""
        return self._newest.settled(timeout_s)

    def close(self) -> None:
        """End the processes at once: nobody waits for what they make."""
        for process in list(getattr(self._pool, "_processes", {}).values()):
            process.kill()
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._newest.close()

    def _make(self, order: Order) -> None:
        try:
            self._scan(order)
            self._parts(order)
        except ScanwrightError as error:
            self._shows.note(str(error), True)
        except BrokenExecutor:
            if not self._newest.outdated():
                self._shows.note("the process that makes the parts ended; the next one begins", True)
            self._pool = _pool()

    def _scan(self, order: Order) -> None:
        if not order.scene:
            return
        view = view_of(order.loaded, order.problem, order.setting, in_task_scene=order.scene == "task")
        points_m = self._pool.submit(self._bench.look, view).result()
        self._shows.points(order.setting, points_m)

    def _parts(self, order: Order) -> None:
        scanner = scanner_at(order.loaded, order.setting)
        if not order.scanner or self._stands == scanner or self._newest.outdated():
            return
        self._shows.note("making the parts ...", False)
        halves: dict[Future[tuple[Body, ...]], bool] = {
            self._pool.submit(self._bench.parts, scanner, turning): turning for turning in (True, False)
        }
        for done in as_completed(halves):
            self._shows.bodies(order.setting, halves[done], done.result())
        self._stands = scanner
        self._shows.note("", False)


def _pool() -> ProcessPoolExecutor:
    # spawned and not forked: a fork of a process with threads may lock up
    return ProcessPoolExecutor(2, multiprocessing.get_context("spawn"), _deaf)


def _deaf() -> None:
    """Ctrl-C ends the page, and the page ends these."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
