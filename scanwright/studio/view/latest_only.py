"""Work that follows a hand: of all wishes only the newest is worth doing."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from threading import Condition, Thread
from typing import Generic, TypeVar

T = TypeVar("T")

REST_S = 0.25  # without a wish: the hand has let go


class LatestOnly(Generic[T]):
    """A thread that does the newest wish, and once no other has come for a while, what belongs to the rest.

    A wish that comes while another is being done waits; one that waits is replaced by the next.
    """

    def __init__(
        self, name: str, work: Callable[[T], None], rest: Callable[[T], None] | None = None, rest_s: float = REST_S
    ) -> None:
        self._work, self._rest, self._rest_s = work, rest, rest_s
        self._changed = Condition()
        self._wishes: list[T] = []
        self._open, self._idle = True, True
        self.replaced = 0
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def wish(self, wish: T) -> None:
        """Ask for this and for nothing that was asked before."""
        with self._changed:
            self.replaced += len(self._wishes)
            self._wishes = [wish]
            self._changed.notify_all()

    def settled(self, timeout_s: float) -> bool:
        """Wait until all is done; False where that takes longer."""
        with self._changed:
            return self._changed.wait_for(lambda: self._idle and not self._wishes, timeout_s)

    def close(self) -> None:
        """Finish what is being done, and end."""
        with self._changed:
            self._open = False
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                if not self._wishes:
                    self._idle = True
                    self._changed.notify_all()
                self._changed.wait_for(lambda: self._wishes or not self._open)
                if not self._open:
                    return
                self._idle = False
                wish = self._wishes.pop()
            _guarded(self._work, wish)
            if self._rest is None:
                continue
            with self._changed:
                if self._changed.wait_for(lambda: self._wishes or not self._open, self._rest_s):
                    continue
            _guarded(self._rest, wish)


def _guarded(work: Callable[[T], None], wish: T) -> None:
    """A fault of one wish is told, and is not the end of the thread."""
    try:
        work(wish)
    except Exception:
        traceback.print_exc()
