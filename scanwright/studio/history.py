"""Undo and redo of the studio."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from threading import Lock

from scanwright.design.task.angle_ranges import NAMES
from scanwright.studio.state import Dab, Setting

JOINED_S = 1.0  # changes of one control within this time are one step: a slider that is dragged
MOST_STEPS = 500


@dataclass(frozen=True, slots=True)
class PageState:
    """All that a person changes on the page: paint, angles, kept settings by name, other controls."""

    dabs: tuple[Dab, ...]
    setting: Setting
    kept: tuple[tuple[str, Setting], ...]
    fields: tuple[tuple[str, object], ...]


def difference(before: PageState, after: PageState) -> str:
    """Return the change between two states, in words."""
    angles = [
        f"{name} {old:g} to {new:g}"
        for name, old, new in zip(NAMES, before.setting.angles_deg, after.setting.angles_deg, strict=True)
        if old != new
    ]
    if len(angles) > 1:
        angles = [f"angles to {', '.join(f'{angle:g}' for angle in after.setting.angles_deg)} deg"]
    kept, were = dict(after.kept), dict(before.kept)
    fields, previous = dict(after.fields), dict(before.fields)
    return "; ".join(
        [
            *angles,
            *_painted(len(after.dabs) - len(before.dabs), len(after.dabs)),
            *(f"keep {name}" for name in kept if name not in were),
            *(f"remove {name}" for name in were if name not in kept),
            *(
                f"{name} {_text(previous[name])} to {_text(new)}"
                for name, new in fields.items()
                if new != previous[name]
            ),
        ]
    )


def _painted(more: int, left: int) -> list[str]:
    if more < 0:
        return ["clear paint" if left == 0 else f"{-more} dabs fewer"]
    return [f"paint {more} dab{'s' if more > 1 else ''}"] if more else []


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)


class History:
    """Steps that were done, and those that were undone."""

    def __init__(self, first: PageState, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._done, self._undone = [first], list[PageState]()
        self._of: Hashable = None
        self._noted_s = 0.0
        self._lock = Lock()

    def note(self, state: PageState, of: Hashable, joined_s: float = JOINED_S) -> None:
        """Add a step; it joins the last one if both are `of` the same thing, not None, within `joined_s`."""
        with self._lock:
            now_s = self._clock_s()
            same = of is not None and of == self._of
            joins = same and now_s - self._noted_s <= joined_s and len(self._done) > 1
            if state == self._done[-1]:
                return
            self._of, self._noted_s = of, now_s
            if joins:
                self._done.pop()
            self._undone.clear()
            if state != self._done[-1]:  # a slider that is back at its start changes nothing
                self._done.append(state)
            del self._done[:-MOST_STEPS]

    def undo(self) -> PageState | None:
        """Return the state before the last step; None if there is none."""
        return self._step(self._done, self._undone, 1)

    def redo(self) -> PageState | None:
        """Return the state after the step that was undone last; None if there is none."""
        return self._step(self._undone, self._done, 0)

    @property
    def undoes(self) -> str:
        """The step that `undo` takes back, in words; empty if there is none."""
        with self._lock:
            return difference(*self._done[-2:]) if len(self._done) > 1 else ""

    @property
    def redoes(self) -> str:
        """The step that `redo` repeats, in words; empty if there is none."""
        with self._lock:
            return difference(self._done[-1], self._undone[-1]) if self._undone else ""

    def _step(self, steps: list[PageState], to: list[PageState], stays: int) -> PageState | None:
        with self._lock:
            if len(steps) <= stays:
                return None
            self._of = None
            to.append(steps.pop())
            return self._done[-1]
