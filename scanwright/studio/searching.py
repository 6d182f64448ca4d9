"""The search of the studio, in its own thread."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from threading import Thread

from scanwright.design.concurrency.processes import worker_processes
from scanwright.design.errors import ScanwrightError
from scanwright.design.evaluation.as_built import as_built
from scanwright.design.objective.holes import percent
from scanwright.design.search.optimum import Optimum, find_optimum
from scanwright.design.task.task import LoadedTask
from scanwright.pipeline.build import setting_built
from scanwright.studio.panel.controls import Controls, put
from scanwright.studio.state import Dab, Setting

SEARCH_STEPS = 9  # progress lines of a search


class Searching:
    """The button, its progress bar, and the thread that searches."""

    def __init__(
        self,
        controls: Controls,
        show: Callable[..., None],
        now: Callable[[], tuple[LoadedTask, tuple[Dab, ...], Setting]],
        use: Callable[[Optimum], None],
        move: Callable[[Setting, Hashable], None],
    ) -> None:
        """`show` shows a line, `now` is the state of the page, `use` and `move` get the optimum."""
        self._controls, self._show, self._now, self._use, self._move = controls, show, now, use, move

    def begin(self) -> None:
        """Search all angles of the task, and move the sliders to the optimum; one search at a time."""
        c = self._controls
        if c.optimise.disabled:
            return
        c.optimise.disabled = True
        c.progress.visible, c.progress.animated = True, True
        Thread(target=self._run, args=self._now(), name="optimise", daemon=True).start()

    def _run(self, task: LoadedTask, dabs: tuple[Dab, ...], setting: Setting) -> None:
        steps = 0

        def progress(step: str, _fraction: float | None = None, /) -> None:
            nonlocal steps
            steps += 1
            put(self._controls.progress, min(100.0 * steps / SEARCH_STEPS, 95.0))
            self._show(step)

        try:
            optimum = find_optimum(task, progress)
            if dabs != self._now()[1]:
                return
            self._use(optimum)
            if setting != self._now()[2]:
                self._show("optimum found; Optimise moves the sliders there")
                return
            step = object()  # both moves are one
            bare = Setting.within_bounds(optimum.search.best[0].angles_deg)
            self._move(bare, step)
            title = f"optimum of {optimum.search.covered:,} settings, {optimum.title}"
            holes = optimum.hole_lines(tabled=False)[0].partition(";")[0]
            self._show(f"{title}; {holes}; searching the equivalent mount whose parts block the fewest beams")
            with worker_processes() as begin:
                chosen = begin(setting_built, optimum)()
            if (dabs, bare) == self._now()[1:]:
                self._move(Setting.within_bounds(chosen.family.angles_deg), step)
            seen = as_built(
                optimum.problem,
                optimum.loaded.task,
                chosen.family.angles_rad,
                chosen.shadow,
                chosen.family.score,
                optimum.mounts,
            )
            gain, blocked = seen.mounts[0].gain, percent(seen.blocked or 0.0)
            self._show(
                f"{title}: with parts, which block {blocked} of the beams, {gain.value} {gain.mount.name}; {holes}"
            )
        except ScanwrightError as error:
            self._show(str(error), bad=True)
        finally:
            self._controls.optimise.disabled, self._controls.progress.visible = False, False
