"""Three processes that make parts and scans for the page, each the newest order only.

They are processes because the CAD kernel holds the interpreter.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass, field
from threading import Lock
from typing import ParamSpec, TypeVar

from scanwright.design.concurrency.processes import kill, spawn_pool
from scanwright.design.errors import ScanwrightError
from scanwright.design.objective.problem import Problem
from scanwright.design.scanner import Scanner
from scanwright.design.task.task import LoadedTask
from scanwright.report.room import one_scan
from scanwright.studio.state import Setting
from scanwright.studio.view.latest_only import LatestOnly
from scanwright.studio.view.scanner_bodies import make_bodies
from scanwright.studio.view.view_3d import View3D

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Order:
    """What is to be made."""

    loaded: LoadedTask
    problem: Problem
    setting: Setting
    bodies: bool
    scene: str

    def scanner(self) -> Scanner:
        """Return the scanner with its optical centre at the origin of the world."""
        return self.loaded.scanner(self.loaded.angle_set(self.setting.angles_deg))


class Workers:
    """Workers for both halves of the scanner and for scans; `show` gets a message and whether it is an error."""

    def __init__(self, view: View3D, show: Callable[[str, bool], None]) -> None:
        self._view = view
        self._shown: dict[bool, Scanner] = {}
        status = _StatusLine(show)
        self._workers = (
            _Worker("turning half", lambda worker, order: self._half(worker, order, turning=True), status),
            _Worker("fixed half", lambda worker, order: self._half(worker, order, turning=False), status),
            _Worker("scan", self._scan, status),
        )

    def order(self, order: Order) -> None:
        """Make this, in place of an order that has not begun."""
        for worker in self._workers:
            worker.orders.request(order)

    def settled(self, timeout_s: float) -> bool:
        """Wait until all is made; return False if it takes longer."""
        end = time.monotonic() + timeout_s
        return all(worker.orders.settled(max(0.0, end - time.monotonic())) for worker in self._workers)

    def close(self) -> None:
        """End the processes at once."""
        for worker in self._workers:
            worker.close()

    def _half(self, worker: _Worker, order: Order, *, turning: bool) -> None:
        try:
            scanner = order.scanner()
            if not order.bodies or self._shown.get(turning) == scanner:
                return
            self._view.fade_bodies(turning)
            bodies = worker.ask("making the parts ...", make_bodies, scanner, turning)
        except ScanwrightError:
            self._shown.pop(turning, None)
            self._view.show_bodies(order.setting, turning, ())  # of another setting
            raise
        self._view.show_bodies(order.setting, turning, bodies)
        self._shown[turning] = scanner

    def _scan(self, worker: _Worker, order: Order) -> None:
        if not order.scene:
            return
        problem, placed = order.problem, order.loaded.task.scene if order.scene == "task" else None
        joint_rad = problem.joint_rad()
        folder = order.loaded.source.parent
        self._view.show_points(worker.ask("casting the scan ...", one_scan, order.scanner(), joint_rad, placed, folder))


class _Worker:
    """A process, and the thread that gives it the newest order."""

    def __init__(self, name: str, work: Callable[[_Worker, Order], None], status: _StatusLine) -> None:
        self._name, self._work, self._status = name, work, status
        self._pool, self._open = spawn_pool(), True
        self.orders: LatestOnly[Order] = LatestOnly(name, self._follow)

    def ask(self, word: str, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Call a function in the process, and show a message meanwhile."""
        self._status.show(self._name, word)
        return self._pool.submit(function, *args, **kwargs).result()

    def close(self) -> None:
        """End the process and the thread."""
        self._open = False
        kill(self._pool)
        self.orders.close()

    def _follow(self, order: Order) -> None:
        if not self._open:
            return
        try:
            self._work(self, order)
            self._status.show(self._name, "")
        except ScanwrightError as error:
            self._status.show(self._name, str(error), bad=True)
        except BrokenExecutor:
            if self._open:
                self._status.show(self._name, f"{self._name}: its process ended; a new one was started", bad=True)
                self._pool = spawn_pool()
        except Exception:
            self._status.show(self._name, f"{self._name}: internal error, see the terminal", bad=True)
            raise


@dataclass(slots=True)
class _StatusLine:
    """The messages of the workers as one line: errors before work, the same text once."""

    print: Callable[[str, bool], None]
    _lines: dict[str, tuple[str, bool]] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)

    def show(self, worker: str, text: str, *, bad: bool = False) -> None:
        """Replace the message of one worker; an empty one removes it."""
        with self._lock:
            self._lines[worker] = (text, bad)
            texts = [text for text, bad in self._lines.values() if bad]
            texts = texts or [text for text, _ in self._lines.values() if text]
            self.print("; ".join(dict.fromkeys(texts)), any(bad for _, bad in self._lines.values()))
