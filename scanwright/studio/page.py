"""The studio: a person drags the angles or paints what matters, and sees at once what it comes to.

Three threads follow the hand, each doing only the newest wish: one judges the setting (J, gaps, the colours of the
sphere), one takes paint into the task, the workers have parts and scans made in other processes. The search and a build
run beside them. Everybody who has the page sees and moves the same setting.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import viser

from design.angles import STANDARD_DEG, standard_settings
from design.concurrency.second_process import second_process
from design.errors import ScanwrightError, TaskError
from design.search.optimum import find_optimum
from design.task.task import LoadedTask, load_task, shipped_tasks
from scanwright.pipeline.build import setting_built
from scanwright.serving.style import note_html
from scanwright.studio.panel import panel_html
from scanwright.studio.panel.controls import (
    BRUSHES,
    NO_SCENE,
    TASK_SCENE,
    Controls,
    name_of_copy,
    put,
    scan_scenes,
)
from scanwright.studio.panel.facts import Facts, Judge
from scanwright.studio.panel.kept_settings import KeptSettings
from scanwright.studio.panel.saving import Saving
from scanwright.studio.state import Dab, Setting, painted
from scanwright.studio.view.coloured_sphere import direction_hit, highest_density
from scanwright.studio.view.latest_only import LatestOnly
from scanwright.studio.view.view_3d import SIDES, View3D
from scanwright.studio.view.workers import Order, Workers

SEARCH_STEPS = 9  # lines that a search says
STROKE = 0.5  # of the radius: a stroke leaves a dab each time it has moved that far


@dataclass(frozen=True, slots=True)
class Canvas:
    """What is being judged: a task, and the paint on it."""

    base: LoadedTask
    dabs: tuple[Dab, ...]


class Studio:
    """One page. `saved_to` is the only folder it writes task files to, `out` holds the builds."""

    def __init__(self, server: viser.ViserServer, loaded: LoadedTask, saved_to: Path, out: Path) -> None:
        self._server, self._first = server, loaded
        self._canvas = Canvas(loaded, ())
        self.judge = Judge.for_task(loaded)
        self.facts: Facts | None = None
        self.view = View3D(server)
        names = shipped_tasks()
        own = loaded.task.name if loaded.task.name in names and loaded.source.parent != saved_to else str(loaded.source)
        self._tasks = [own, *(name for name in names if name != own)]
        self.controls = Controls(server.gui, loaded, self._tasks, Setting(STANDARD_DEG["rolling"]))
        self.kept = KeptSettings(self.controls, self.move, self.judge)
        self.saving = Saving(self.controls, saved_to, out)
        self.judging: LatestOnly[Setting] = LatestOnly("judge", self._follow, self._rest)
        self.painting: LatestOnly[Canvas] = LatestOnly("paint", self._take, self._rejudge)
        self.workers = Workers(self.view, self._say_making)
        self._connect()
        self._taken()

    def close(self) -> None:
        """End the threads, the processes and a build that runs."""
        self.saving.close()
        for worker in (self.painting, self.judging, self.workers):
            worker.close()

    @property
    def setting(self) -> Setting:
        """Where the sliders stand."""
        return Setting.within_bounds(slider.value for slider in self.controls.angles)

    def say(self, text: str, bad: bool = False) -> None:
        """One line under the facts."""
        self.controls.note.content = note_html(text, bad=bad)

    def move(self, setting: Setting) -> None:
        """Move the sliders."""
        for slider, angle in zip(self.controls.angles, setting.angles_deg, strict=True):
            put(slider, angle)
        self.judging.wish(setting)

    def dab(self, ray_origin: Any, ray_direction: Any) -> None:
        """Touch the sphere with the brush where a ray from the camera meets it."""
        c = self.controls
        hit = direction_hit(ray_origin, ray_direction, inside=self.view.inside)
        if hit is None or not c.painting.value or c.brush.value not in BRUSHES:
            return
        radius_deg = float(np.clip(c.radius.value, 1, 60))
        dabs = self._canvas.dabs
        if dabs and np.dot(dabs[-1].direction, hit) > np.cos(np.radians(STROKE * radius_deg)):
            return
        x, y, z = (float(value) for value in hit)
        value = float(np.clip(c.weight.value, 0.01, 1000.0))
        self._repaint((*dabs, Dab((x, y, z), radius_deg, c.brush.value, value)))

    def _painted(self) -> LoadedTask:
        return painted(self._canvas.base, self._canvas.dabs)

    def _keep(self) -> None:
        self.say(f"kept as {self.kept.keep(self.setting)}: see Compare")

    def _connect(self) -> None:
        c = self.controls

        async def moved(_: Any) -> None:
            self.judging.wish(self.setting)

        for slider in c.angles:
            slider.on_update(moved)
        c.task.on_update(self._told(self._change_task))
        c.painting.on_update(self._told(self._arm))
        c.look.on_update(self._told(self._look))
        c.scanner.on_update(self._told(self._show_scanner))
        c.scene.on_update(self._told(self._change_scene))
        for button, act in (
            (c.optimise, self.optimise),
            (c.keep, self._keep),
            (c.undo, lambda: self._repaint(self._canvas.dabs[:-1])),
            (c.clear, lambda: self._repaint(())),
            (c.restore, self.kept.restore),
            (c.remove, self.kept.remove),
            (c.save, lambda: self.saving.save(self._painted(), self.setting)),
            (c.build, lambda: self.saving.build(self._painted(), self.setting)),
        ):
            button.on_click(self._told(act))

    def _told(self, act: Callable[[], Any]) -> Callable[[Any], None]:
        """What goes wrong is said on the page."""

        @functools.wraps(act)
        def guarded(_: Any) -> None:
            try:
                act()
            except ScanwrightError as error:
                self.say(str(error), bad=True)

        return guarded

    # The setting

    def _follow(self, setting: Setting) -> None:
        judge = self.judge
        self._tell(judge.quick(setting))
        self.view.colour(judge.problem, setting, self._highest)

    def _rest(self, setting: Setting) -> None:
        self._order()
        exact = self.judge.exact(setting)
        self._tell(exact)
        self._tell(self.judge.settled(exact))

    def _tell(self, facts: Facts) -> None:
        self.facts = facts
        self.controls.facts.content = panel_html.facts_html(facts, self.judge.problem.objective.name == "log")
        self._server.flush()

    # The task and the paint on it

    def _change_task(self) -> None:
        name = self.controls.task.value
        if name not in self._tasks:  # a page could ask for any file of this computer
            raise TaskError(f"task '{name}': none of those that can be chosen")
        loaded = self._first if name in (str(self._first.source), self._first.task.name) else load_task(Path(name))
        self._canvas = Canvas(loaded, ())
        self.kept.clear()
        self.controls.scene.options = scan_scenes(loaded)
        put(self.controls.name, name_of_copy(loaded))
        self.painting.wish(self._canvas)

    def _repaint(self, dabs: tuple[Dab, ...]) -> None:
        painted(self._canvas.base, dabs)  # refuses what no task could hold
        self._canvas = replace(self._canvas, dabs=dabs)
        self.painting.wish(self._canvas)

    def _take(self, canvas: Canvas) -> None:
        try:
            loaded = painted(canvas.base, canvas.dabs)
            judge = Judge.for_task(loaded)
        except ScanwrightError as error:
            self.say(str(error), bad=True)
            return
        self.judge = judge
        self._taken()

    def _taken(self) -> None:
        settings = [*standard_settings().values(), self.setting.angles_rad]
        self._highest = max(highest_density(self.judge.problem, angles) for angles in settings)
        self.controls.scale.content = panel_html.scale_html(self._highest)
        self.view.outline(self.judge.problem)
        self.view.stand_in(self.judge.loaded.task)
        masks = sum(dab.brush == "hidden" for dab in self._canvas.dabs)
        count = len(self._canvas.dabs)
        self.controls.painted.content = note_html(f"{count} dabs on the task, {masks} of them hide")
        self.judging.wish(self.setting)

    def _rejudge(self, _: Canvas) -> None:
        """The settings that were kept, by the task as it is now."""
        self.kept.rejudge(self.judge)

    def _arm(self) -> None:
        """Take the brush in hand, or put it away so that dragging turns the view again."""
        sphere = self.view.sphere
        sphere.remove_click_callback()
        sphere.remove_drag_callback()
        if not self.controls.painting.value:
            return
        if not self.view.on_sphere:
            put(self.controls.look, "sphere from inside")  # which is what the brush paints on
            self._look()

        @sphere.on_click
        async def _(event: Any) -> None:
            self._told(lambda: self.dab(event.ray_origin, event.ray_direction))(event)

        @sphere.on_drag
        async def _(event: Any) -> None:
            eye = np.asarray(event.client.camera.position)
            self._told(lambda: self.dab(eye, np.asarray(event.end_position) - eye))(event)

    def _look(self) -> None:
        if self.controls.look.value in SIDES:
            self.view.look(self.controls.look.value)
            self.judging.wish(self.setting)

    # Other processes and long work

    def _order(self) -> None:
        scene = {NO_SCENE: "", TASK_SCENE: "task"}.get(self.controls.scene.value, "room")
        loaded, problem = self.judge.loaded, self.judge.problem
        self.workers.order(Order(loaded, problem, self.setting, self.controls.scanner.value, scene))

    def _say_making(self, text: str, bad: bool) -> None:
        self.controls.making.content = note_html(text, bad=bad)

    def _show_scanner(self) -> None:
        self.view.show_scanner(self.controls.scanner.value)
        self._order()

    def _change_scene(self) -> None:
        if self.controls.scene.value == NO_SCENE:
            self.view.show_points(np.empty((0, 3)))
        self._order()

    def optimise(self) -> None:
        """Search all angles of the task beside everything else, and move the sliders to what is found."""
        c, canvas, judge = self.controls, self._canvas, self.judge
        if c.optimise.disabled:
            return
        c.optimise.disabled = True
        c.progress.visible, c.progress.animated = True, True
        said = 0

        def told(line: str) -> None:
            nonlocal said
            said += 1
            put(c.progress, min(100.0 * said / SEARCH_STEPS, 95.0))
            self.say(line)

        def run() -> None:
            try:
                optimum = find_optimum(painted(canvas.base, canvas.dabs), told)
                if canvas != self._canvas:
                    return
                self.judge = replace(judge, loaded=optimum.loaded, problem=optimum.problem)
                self.kept.rejudge(self.judge)  # with the period that was found
                bare = Setting.within_bounds(optimum.search.best[0].angles_deg)
                self.move(bare)
                found = f"optimum of {optimum.search.covered:,} settings, {optimum.title}"
                blind = optimum.hole_lines()
                holes = "; ".join(dict.fromkeys((blind[0].partition(";")[0], blind[-1])))
                self.say(f"{found}: {holes}; which of the equal ones its parts hide least is still looked for")
                with second_process() as begin:
                    chosen = begin(setting_built, optimum)()
                if canvas == self._canvas and self.setting == bare:
                    self.move(Setting.within_bounds(chosen.family.angles_deg))
                self.say("; ".join([found, *chosen.lines(), holes]))
            except ScanwrightError as error:
                self.say(str(error), bad=True)
            finally:
                c.optimise.disabled, c.progress.visible = False, False

        Thread(target=run, name="optimise", daemon=True).start()
