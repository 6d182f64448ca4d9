"""The page of the studio.

Threads do the newest request only: one judges the setting, one adds paint to the task, the workers make parts and scans
in other processes. All visitors see and move the same setting.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Hashable
from dataclasses import replace
from functools import partial, wraps
from pathlib import Path
from typing import Any

import numpy as np
import viser

from scanwright.design.angles import STANDARD_DEG
from scanwright.design.errors import ScanwrightError, TaskError
from scanwright.design.progress import Progress
from scanwright.design.search.optimum import Optimum
from scanwright.design.task.task import LoadedTask
from scanwright.report.colours import bands_to
from scanwright.serving.page_server import guarded_server, wait_until_alone
from scanwright.serving.style import key_html, note_html
from scanwright.studio.brush import PaintBrush
from scanwright.studio.history import JOINED_S, History, PageState
from scanwright.studio.panel import panel_html
from scanwright.studio.panel.controls import NO_SCENE, TASK_SCENE, Controls, put
from scanwright.studio.panel.facts import Facts, Judge
from scanwright.studio.panel.kept_settings import KeptSettings
from scanwright.studio.panel.pads import pads_html
from scanwright.studio.panel.saving import Saving
from scanwright.studio.searching import Searching
from scanwright.studio.state import Dab, Setting, painted
from scanwright.studio.view.latest_only import LatestOnly
from scanwright.studio.view.outlines import highest_density
from scanwright.studio.view.view_3d import View3D
from scanwright.studio.view.workers import Order, Workers

_LOG = logging.getLogger(__name__)
ALONE_S = 300.0  # without a visitor; a browser that restarts returns sooner
FIRST_S = 30.0  # at most, for the first colours


class Studio:
    """One page. `saved_to` is the only folder it writes task files to, `out` holds the builds."""

    def __init__(self, server: viser.ViserServer, loaded: LoadedTask, saved_to: Path, out: Path) -> None:
        self._server = server
        self._loaded, self._dabs = loaded, tuple[Dab, ...]()
        self.judge = Judge.for_task(loaded)
        self.facts: Facts | None = None
        self._message_of: tuple[tuple[Dab, ...], Setting] | None = None
        self._searched: dict[tuple[Dab, ...], Optimum] = {}
        self.view = View3D(server, loaded.task)
        self.controls = Controls(server.gui, loaded, Setting(STANDARD_DEG["rolling"]))
        self.brush = PaintBrush(self.view, self.controls, lambda: self._dabs, self._paint)
        self.kept = KeptSettings(self.controls, self.move, self.judge)
        self.saving = Saving(self.controls, saved_to, out)
        self.judging: LatestOnly[Setting] = LatestOnly("judge", self._follow, self._rest)
        self.painting: LatestOnly[tuple[Dab, ...]] = LatestOnly(
            "paint", self._take, lambda _: self.kept.rejudge(self.judge)
        )
        self.workers = Workers(
            self.view, lambda text, bad: setattr(self.controls.making, "content", note_html(text, bad=bad))
        )
        self.history = History(self._state())
        self.searching = Searching(self.controls, self.show, self._now, self._use_optimum, self.move)
        self._connect()
        self._task_changed()
        self.judging.settled(FIRST_S)  # the first picture has its colours

    def close(self) -> None:
        """End the threads, the processes and a build that runs."""
        self.saving.close()
        for worker in (self.painting, self.judging, self.workers):
            worker.close()

    @property
    def setting(self) -> Setting:
        """The angles of the sliders."""
        return Setting.within_bounds(slider.value for slider in self.controls.angles)

    def show(self, text: str, bad: bool = False) -> None:
        """Show a message, until the state of the page changes."""
        self._message_of = (self._dabs, self.setting)
        self.controls.note.content = note_html(text, bad=bad)

    def _update_text(self) -> None:
        """Show the angles as text, and remove a message of another state."""
        put(self.controls.typed, self.setting.text)
        self.controls.typed_error.content = ""
        if self.controls.note.content and self._message_of != (self._dabs, self.setting):
            self.controls.note.content = ""

    def move(self, setting: Setting, of: Hashable = None, joined_s: float = math.inf) -> None:
        """Move the sliders; moves `of` the same thing within `joined_s` of each other are one step of undo."""
        for slider, angle in zip(self.controls.angles, setting.angles_deg, strict=True):
            put(slider, angle)
        self._update_text()
        self.judging.request(setting)
        self._note(of, joined_s)

    def _now(self) -> tuple[LoadedTask, tuple[Dab, ...], Setting]:
        return painted(self._loaded, self._dabs), self._dabs, self.setting

    def _state(self) -> PageState:
        fields = tuple((name, control.value) for name, control in self.controls.fields.items())
        return PageState(self._dabs, self.setting, self.kept.settings, fields)

    def _note(self, of: Hashable = None, joined_s: float = JOINED_S) -> None:
        self.history.note(self._state(), of, joined_s)
        self.controls.show_steps(self.history.undoes, self.history.redoes)

    def _go_to(self, step: Callable[[], PageState | None]) -> None:
        """Undo or redo."""
        if (moment := step()) is None:
            return
        before, self._dabs = self._dabs, moment.dabs
        for name, value in moment.fields:
            put(self.controls.fields[name], value)
        for slider, angle in zip(self.controls.angles, moment.setting.angles_deg, strict=True):
            put(slider, angle)
        self._update_text()
        if moment.kept != self.kept.settings:
            self.kept.take(moment.kept)
        if moment.dabs == before:
            self.judging.request(moment.setting)
        else:
            self.painting.request(moment.dabs)
        self.controls.show_steps(self.history.undoes, self.history.redoes)

    def _keep(self) -> None:
        self.show(f"saved as {self.kept.keep(self.setting)}: see Compare")
        self._note()

    def _remove(self) -> None:
        self.kept.remove()
        self._note()

    def _connect(self) -> None:
        c = self.controls

        undo, redo = partial(self._go_to, self.history.undo), partial(self._go_to, self.history.redo)

        async def moved(event: viser.GuiEvent[Any]) -> None:
            self.judging.request(self.setting)
            noted(event)
            if event.client is not None:
                self._update_text()

        async def typed(event: viser.GuiEvent[Any]) -> None:
            if event.client is None:
                return
            try:
                self.move(Setting.read(c.typed.value), c.typed, JOINED_S)
            except TaskError as error:
                c.typed_error.content = note_html(str(error), bad=True)

        def noted(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:  # otherwise the program moves it
                self._note(event.target.label)

        for slider in c.angles:
            slider.on_update(moved)
        c.typed.on_update(typed)
        for field in c.fields.values():
            field.on_update(noted)
        for field in (c.brush, c.radius):
            field.on_update(lambda _: self.brush.show())
        c.painting.on_update(self._guarded(self._arm))
        c.undo_key.on_trigger(self._guarded(undo))
        c.redo_key.on_trigger(self._guarded(redo))
        c.brush_key.on_trigger(lambda _: put(c.painting, not c.painting.value))
        c.density.on_update(self._guarded(self._show_density))
        c.scanner.on_update(self._guarded(self._show_scanner))
        c.scene.on_update(self._guarded(self._change_scene))
        for button, act in (
            (c.optimise, self.searching.begin),
            (c.keep, self._keep),
            (c.undo, undo),
            (c.redo, redo),
            (c.clear, lambda: self._paint(())),
            (c.restore, self.kept.restore),
            (c.remove, self._remove),
        ):
            button.on_click(self._guarded(act))
        for button, write in ((c.save, self.saving.save), (c.build, self.saving.build)):
            button.on_click(self._guarded(partial(self._write, write), self.saving.refuse))

    def _write(self, write: Callable[[LoadedTask, Setting], object]) -> None:
        self.saving.refuse("")
        write(painted(self._loaded, self._dabs), self.setting)

    def _guarded(self, act: Callable[[], Any], refuse: Callable[[str], None] | None = None) -> Callable[[Any], None]:
        """Return an event handler that shows errors, at their field if `refuse` does."""

        @wraps(act)
        def guarded(_: Any) -> None:
            try:
                act()
            except ScanwrightError as error:
                (refuse or partial(self.show, bad=True))(str(error))

        return guarded

    def _follow(self, setting: Setting) -> None:
        judge = self.judge
        self._show_facts(judge.quick(setting))
        self.view.colour(judge.problem, setting, self._bands)
        self._server.flush()  # at once, not at the next interval

    def _rest(self, setting: Setting) -> None:
        self._order()
        exact = self.judge.exact(setting)
        self._show_facts(exact)
        self._show_facts(self.judge.settled(exact))

    def _show_facts(self, facts: Facts) -> None:
        self.facts = facts
        self.controls.facts.content = panel_html.facts_html(facts, self.controls.typed._impl.uuid)
        self._server.flush()

    def _use_optimum(self, optimum: Optimum) -> None:
        """Judge by the task with the period of the optimum."""
        self.judge = replace(self.judge, loaded=optimum.loaded, problem=optimum.problem)
        self._searched[self._dabs] = optimum
        self._show_pads()
        self.kept.rejudge(self.judge)

    def _show_pads(self) -> None:
        """Show the landscapes of the task as it is painted now."""
        self.controls.pads.content = pads_html(self._searched.get(self._dabs))

    def _paint(self, dabs: tuple[Dab, ...], stroke: int | None = None) -> None:
        painted(self._loaded, dabs)  # rejects an invalid task
        self._dabs = dabs
        self._update_text()
        self.painting.request(dabs)
        self._note(("stroke", stroke) if stroke is not None else None, math.inf)

    def _take(self, dabs: tuple[Dab, ...]) -> None:
        try:
            judge = Judge.for_task(painted(self._loaded, dabs))
        except ScanwrightError as error:
            self.show(str(error), bad=True)
            return
        self.judge = judge
        self._task_changed()

    def _task_changed(self) -> None:
        settings = [*np.radians([*STANDARD_DEG.values()]), self.setting.angles_rad]
        self._bands = bands_to(max(highest_density(self.judge.problem, angles) for angles in settings))
        self.controls.scale.content = key_html(
            self._bands,
            "beams per direction, without parts; grey: none; white: region of interest; red: hidden by the robot",
        )
        self._show_pads()
        self.view.outline(self.judge.problem)
        masks = sum(dab.brush == "hidden" for dab in self._dabs)
        self.controls.painted.content = note_html(f"{len(self._dabs)} dabs, {masks} of them hide directions")
        self.judging.request(self.setting)

    def _arm(self) -> None:
        self.brush.arm(self._guarded)
        if self.controls.painting.value and not self.controls.density.value:
            put(self.controls.density, True)  # the brush paints on what is shown
            self._show_density()

    def _show_density(self) -> None:
        self.view.show_density(self.controls.density.value)
        self.judging.request(self.setting)

    def _order(self) -> None:
        scene = {NO_SCENE: "", TASK_SCENE: "task"}.get(self.controls.scene.value, "room")
        loaded, problem = self.judge.loaded, self.judge.problem
        self.workers.order(Order(loaded, problem, self.setting, self.controls.scanner.value, scene))

    def _show_scanner(self) -> None:
        self.view.scanner.visible = self.controls.scanner.value
        self._order()

    def _change_scene(self) -> None:
        if self.controls.scene.value == NO_SCENE:
            self.view.show_points(np.empty((0, 3)))
        self._order()


def run_studio(
    loaded: LoadedTask, *, port: int, out: Path, progress: Progress, announce: Callable[[str], None]
) -> None:
    """Serve the studio until some minutes after the last visitor; raise TaskError if the port is taken."""
    with guarded_server(f"Scanwright: {loaded.task.name}", port, recall=True) as (server, gate):
        progress("reading the task (first run: compiling, about 5 s)")
        studio = Studio(server, loaded, Path.cwd(), out)
        try:
            announce(gate.address)
            studio.searching.begin()
            progress(f"press Ctrl-C to end; without a visitor the studio ends after {ALONE_S / 60:g} minutes")
            wait_until_alone(gate, ALONE_S)
        finally:
            studio.close()
        for why, count in gate.refused.items():
            _LOG.warning("refused %d requests: %s", count, why)
