"""What was done in the studio, step by step, so that it can be undone and done again."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from threading import Lock

from scanwright.design.task.angle_ranges import NAMES
from scanwright.studio.state import Canvas, Setting

JOINED_S = 1.0  # changes of one thing that follow each other this closely are one step: a slider that is dragged
MOST_STEPS = 500  # more than a person takes back


@dataclass(frozen=True, slots=True)
class PageState:
    """All that a person changes on the page, as it stood at one time.

    Attributes:
        canvas: the task, and the paint on it.
        setting: the angles.
        kept: the settings under Compare, by name.
        fields: what stands in the other controls, by label.
    """

    canvas: Canvas
    setting: Setting
    kept: tuple[tuple[str, Setting], ...]
    fields: tuple[tuple[str, object], ...]


def difference(before: PageState, after: PageState) -> str:
    """What was done between two moments, in words."""
    if after.canvas.base is not before.canvas.base:
        return f"task {before.canvas.base.task.name} to {after.canvas.base.task.name}"
    angles = [
        f"{name} {old:g} to {new:g}"
        for name, old, new in zip(NAMES, before.setting.angles_deg, after.setting.angles_deg, strict=True)
        if old != new
    ]
    if len(angles) > 1:
        angles = [f"angles to {', '.join(f'{angle:g}' for angle in after.setting.angles_deg)} deg"]
    kept, were = dict(after.kept), dict(before.kept)
    fields, stood = dict(after.fields), dict(before.fields)
    return "; ".join(
        [
            *angles,
            *_painted(len(after.canvas.dabs) - len(before.canvas.dabs), len(after.canvas.dabs)),
            *(f"keep {name}" for name in kept if name not in were),
            *(f"remove {name}" for name in were if name not in kept),
            *(f"{name} {_text(stood[name])} to {_text(new)}" for name, new in fields.items() if new != stood[name]),
        ]
    )


def _painted(more: int, left: int) -> list[str]:
    if more < 0:
        return ["clear paint" if left == 0 else f"{-more} dabs less"]
    return [f"paint {more} dab{'s' if more > 1 else ''}"] if more else []


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)


class History:
    """Steps that were done, and those that were undone; told of every change, in the order in which they come."""

    def __init__(self, first: PageState, clock_s: Callable[[], float] = time.monotonic) -> None:
        """`first` is where it begins, `clock_s` a time in seconds that never runs back."""
        self._clock_s = clock_s
        self._done, self._undone = [first], list[PageState]()
        self._of: Hashable = None
        self._noted_s = 0.0
        self._lock = Lock()

    def note(self, moment: PageState, of: Hashable, joined_s: float = JOINED_S) -> None:
        """Something was changed, and this is how it stands now.

        Args:
            moment: how it stands.
            of: what was changed: one step with the last one, if that was of the same and not long ago; None never is.
            joined_s: how long ago that may be.
        """
        with self._lock:
            now_s = self._clock_s()
            same = of is not None and of == self._of
            joins = same and now_s - self._noted_s <= joined_s and len(self._done) > 1
            if moment == self._done[-1]:
                return
            self._of, self._noted_s = of, now_s
            if joins:
                self._done.pop()
            self._undone.clear()
            if moment != self._done[-1]:  # a slider that is back where it was has done nothing
                self._done.append(moment)
            del self._done[:-MOST_STEPS]

    def undo(self) -> PageState | None:
        """How it stood before the last step; None where there is none."""
        return self._step(self._done, self._undone, 1)

    def redo(self) -> PageState | None:
        """How it stood after the step that was undone last; None where none was."""
        return self._step(self._undone, self._done, 0)

    @property
    def undoes(self) -> str:
        """What `undo` would take back, in words; empty where there is nothing."""
        with self._lock:
            return difference(*self._done[-2:]) if len(self._done) > 1 else ""

    @property
    def redoes(self) -> str:
        """What `redo` would do again, in words; empty where there is nothing."""
        with self._lock:
            return difference(self._done[-1], self._undone[-1]) if self._undone else ""

    def _step(self, steps: list[PageState], to: list[PageState], stays: int) -> PageState | None:
        with self._lock:
            if len(steps) <= stays:
                return None
            self._of = None  # what follows is a step of its own
            to.append(steps.pop())
            return self._done[-1]
