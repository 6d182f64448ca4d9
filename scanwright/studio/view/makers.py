"""The processes that make parts and scans for the page: newest wish first, and none of it in the page's own process.

Three lanes run side by side, each with a process that stays: what turns with the horn, what stands still, and scans.
None waits for another, and in each only the newest order counts.
"""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, TypeVar

from design.errors import ScanwrightError
from design.frames import Array
from design.objective.problem import Problem
from design.scanner import Scanner
from design.task.task import LoadedTask
from scanwright.studio.state import Setting
from scanwright.studio.view.latest_only import Newest
from scanwright.studio.view.workbench import Body, Workbench, scanner_at, view_of

T = TypeVar("T")


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
    """Where what was made goes, and what is said of it: called from the makers' threads."""

    bodies: Callable[[Setting, bool, tuple[Body, ...]], None]
    points: Callable[[Setting, Array], None]
    note: Callable[[str, bool], None]


class Makers:
    """Orders in, bodies and points out."""

    def __init__(self, bench: Workbench, shows: Shows) -> None:
        self._bench, self._shows = bench, shows
        self._stands: dict[bool, Scanner] = {}
        told = _Told(shows.note)
        self._lanes = (
            _Lane("what turns", lambda lane, order: self._half(lane, order, turning=True), told),
            _Lane("what stands", lambda lane, order: self._half(lane, order, turning=False), told),
            _Lane("scan", self._scan, told),
        )

    def order(self, order: Order) -> None:
        """Make this, and nothing that was ordered before and has not begun."""
        for lane in self._lanes:
            lane.newest.wish(order)

    def settled(self, timeout_s: float) -> bool:
        """Wait until all is made; False where that takes longer."""
        end = time.monotonic() + timeout_s
        return all(lane.newest.settled(max(0.0, end - time.monotonic())) for lane in self._lanes)

    def close(self) -> None:
        """End the processes at once: nobody waits for what they make."""
        for lane in self._lanes:
            lane.close()

    def _half(self, lane: _Lane, order: Order, *, turning: bool) -> None:
        try:
            scanner = scanner_at(order.loaded, order.setting)
            if not order.scanner or self._stands.get(turning) == scanner:
                return
            bodies = lane.ask("making the parts ...", self._bench.parts, scanner, turning)
        except ScanwrightError:
            self._stands.pop(turning, None)
            self._shows.bodies(order.setting, turning, ())  # what stood there was another setting's
            raise
        self._shows.bodies(order.setting, turning, bodies)
        self._stands[turning] = scanner

    def _scan(self, lane: _Lane, order: Order) -> None:
        if order.scene:
            view = view_of(order.loaded, order.problem, order.setting, in_task_scene=order.scene == "task")
            self._shows.points(order.setting, lane.ask("casting the scan ...", self._bench.look, view))


class _Lane:
    """A process that stays, and the thread that hands it the newest order."""

    def __init__(self, name: str, work: Callable[[_Lane, Order], None], told: _Told) -> None:
        self._name, self._work, self._told = name, work, told
        self._pool, self._open = _pool(), True
        self.newest: Newest[Order] = Newest(name, self._follow)

    def ask(self, word: str, function: Callable[..., T], *arguments: Any) -> T:
        """Have the process call a function, and say so meanwhile."""
        self._told.tell(self._name, word)
        return self._pool.submit(function, *arguments).result()

    def close(self) -> None:
        """Kill the process, and end the thread."""
        self._open = False
        for process in list(getattr(self._pool, "_processes", {}).values()):
            process.kill()
        self._pool.shutdown(wait=False, cancel_futures=True)
        self.newest.close()

    def _follow(self, order: Order) -> None:
        if not self._open:
            return
        try:
            self._work(self, order)
            self._told.tell(self._name, "")
        except ScanwrightError as error:
            self._told.tell(self._name, str(error), bad=True)
        except BrokenExecutor:
            if self._open:
                self._told.tell(self._name, f"{self._name}: its process ended; the next one begins", bad=True)
                self._pool = _pool()
        except Exception:
            self._told.tell(self._name, f"{self._name}: a fault of the program: see the terminal", bad=True)
            raise


@dataclass(slots=True)
class _Told:
    """What the lanes say, as one line: refusals before what is being done, the same words once."""

    note: Callable[[str, bool], None]
    _lines: dict[str, tuple[str, bool]] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)

    def tell(self, lane: str, text: str, *, bad: bool = False) -> None:
        """What one lane has to say now in place of what it said; nothing where that is empty."""
        with self._lock:
            self._lines[lane] = (text, bad)
            said = [text for text, bad in self._lines.values() if bad]
            said = said or [text for text, _ in self._lines.values() if text]
            self.note("; ".join(dict.fromkeys(said)), any(bad for _, bad in self._lines.values()))


def _pool() -> ProcessPoolExecutor:
    # spawned and not forked: a fork of a process with threads may lock up
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _deaf)


def _deaf() -> None:
    """Ctrl-C ends the page, and the page ends these."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
