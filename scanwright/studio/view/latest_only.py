"""A worker thread that does the newest request only."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from threading import Condition, Thread
from typing import Generic, TypeVar

T = TypeVar("T")

REST_S = 0.25  # without a request: the slider is at rest


class LatestOnly(Generic[T]):
    """A thread that does the newest request, and `rest` once none has come for `rest_s`."""

    def __init__(
        self, name: str, work: Callable[[T], None], rest: Callable[[T], None] | None = None, rest_s: float = REST_S
    ) -> None:
        self._work, self._rest, self._rest_s = work, rest, rest_s
        self._changed = Condition()
        self._waiting: list[T] = []
        self._open, self._idle = True, True
        self.replaced = 0
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def request(self, request: T) -> None:
        """Do this next, in place of a request that waits."""
        with self._changed:
            self.replaced += len(self._waiting)
            self._waiting = [request]
            self._changed.notify_all()

    def settled(self, timeout_s: float) -> bool:
        """Wait until all is done; return False if it takes longer."""
        with self._changed:
            return self._changed.wait_for(lambda: self._idle and not self._waiting, timeout_s)

    def close(self) -> None:
        """Finish the present request, and end."""
        with self._changed:
            self._open = False
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                if not self._waiting:
                    self._idle = True
                    self._changed.notify_all()
                self._changed.wait_for(lambda: self._waiting or not self._open)
                if not self._open:
                    return
                self._idle = False
                request = self._waiting.pop()
            _guarded(self._work, request)
            if self._rest is None:
                continue
            with self._changed:
                if self._changed.wait_for(lambda: self._waiting or not self._open, self._rest_s):
                    continue
            _guarded(self._rest, request)


def _guarded(work: Callable[[T], None], request: T) -> None:
    """Print the error of a request, and continue."""
    try:
        work(request)
    except Exception:
        traceback.print_exc()
