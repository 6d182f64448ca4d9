"""Settings side by side: those that were kept, and the standard alignments that all are compared with."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

import numpy as np

from design.angles import standard_settings
from design.errors import TaskError
from scanwright.studio.panel import panel_html
from scanwright.studio.panel.controls import Controls, put
from scanwright.studio.panel.facts import Facts, Judge
from scanwright.studio.state import Setting, setting_of

NAMES = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


class Kept:
    """The table under Compare."""

    def __init__(self, controls: Controls, move: Callable[[Setting], None]) -> None:
        self._controls, self._move = controls, move
        self._facts: dict[str, Facts] = {}
        self._lock = Lock()

    def keep(self, judge: Judge, setting: Setting) -> str:
        """Put a setting into the table; its name there.

        Raises:
            TaskError: the table is full.
        """
        facts = judge.settled(judge.exact(setting))
        with self._lock:
            name = next((letter for letter in NAMES if letter not in self._facts), None)
            if name is None:
                raise TaskError(f"compare: {len(NAMES)} settings are kept: remove some first")
            self._facts[name] = facts
        self._show()
        put(self._controls.kept, name)
        return name

    def restore(self) -> None:
        """Move the sliders to the setting that is chosen."""
        if facts := self._facts.get(self._controls.kept.value):
            self._move(facts.setting)

    def remove(self) -> None:
        """Take the one that is chosen out of the table.

        Raises:
            TaskError: it is a standard alignment.
        """
        name = self._controls.kept.value
        if name in standard_settings():
            raise TaskError(f"compare: {name} stays: it is what others are compared with")
        with self._lock:
            self._facts.pop(name, None)
        self._show()

    def clear(self) -> None:
        """Forget all: another task asks for other angles."""
        with self._lock:
            self._facts = {}

    def judge(self, judge: Judge) -> None:
        """Judge all again, by a task that has changed."""
        settings = {name: facts.setting for name, facts in self._facts.items()}
        settings |= {name: setting_of(np.degrees(angles)) for name, angles in standard_settings().items()}
        facts = {name: judge.exact(setting) for name, setting in settings.items()}
        with self._lock:
            self._facts = facts
        self._show()

    def _show(self) -> None:
        self._controls.table.content = panel_html.kept_html(self._facts)
        self._controls.kept.options = tuple(self._facts)
