"""Table of the kept settings and of the reference mounts that all are compared with."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

from scanwright.design.errors import TaskError
from scanwright.studio.panel import panel_html
from scanwright.studio.panel.controls import Controls, put
from scanwright.studio.panel.facts import Facts, Judge
from scanwright.studio.state import Setting

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


class KeptSettings:
    """The table under Compare; the lock makes sure that all rows are judged by the same task."""

    def __init__(self, controls: Controls, move: Callable[[Setting], None], judge: Judge) -> None:
        self._controls, self._move = controls, move
        self._facts: dict[str, Facts] = {}
        self._table = Lock()
        self.rejudge(judge)

    def keep(self, setting: Setting) -> str:
        """Add a setting to the table, and return its name there; raise TaskError if the table is full."""
        with self._table:
            name = next((letter for letter in LETTERS if letter not in self._facts), None)
            if name is None:
                raise TaskError(f"compare: {len(LETTERS)} settings are kept: remove some first")
            self._facts[name] = self._judge.settled(self._judge.exact(setting))
            self._show()
        put(self._controls.kept, name)
        return name

    def restore(self) -> None:
        """Move the sliders to the selected setting."""
        if facts := self._facts.get(self._controls.kept.value):
            self._move(facts.setting)

    def remove(self) -> None:
        """Remove the selected setting; raise TaskError if it is a reference mount."""
        name = self._controls.kept.value
        if name in self._judge.references():
            raise TaskError(f"compare: {name} cannot be removed: others are compared with it")
        with self._table:
            self._facts.pop(name, None)
            self._show()

    @property
    def settings(self) -> tuple[tuple[str, Setting], ...]:
        """The kept settings by name, without the reference mounts."""
        return tuple((name, facts.setting) for name, facts in self._facts.items() if name in LETTERS)

    def take(self, settings: tuple[tuple[str, Setting], ...]) -> None:
        """Replace the kept settings."""
        with self._table:
            self._judge_all(dict(settings))

    def rejudge(self, judge: Judge) -> None:
        """Judge all by a changed task."""
        with self._table:
            self._judge = judge
            self._judge_all(dict(self.settings))

    def _judge_all(self, kept: dict[str, Setting]) -> None:
        settings = self._judge.references() | kept
        self._facts = {name: self._judge.settled(self._judge.exact(setting)) for name, setting in settings.items()}
        self._show()

    def _show(self) -> None:
        self._controls.table.content = panel_html.kept_html(self._facts)
        self._controls.kept.options = tuple(self._facts)
