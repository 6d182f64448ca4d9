"""Save and build the task of the page; raises TaskError as `save_task` does."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from threading import Thread

from scanwright.design.errors import TaskError
from scanwright.design.task.task import LoadedTask
from scanwright.serving.style import note_html
from scanwright.studio.panel.controls import Controls, put
from scanwright.studio.state import Setting
from scanwright.studio.task_file import save_task, task_text

PERCENT = re.compile(r" \((\d+)%\)$")


class BuildProcess:
    """A running build; `progress` gets the share done and the last line, `done` the exit code and the last line."""

    def __init__(
        self, task_file: Path, out: Path, progress: Callable[[float, str], None], done: Callable[[int, str], None]
    ) -> None:
        self._progress, self._done = progress, done
        # -P: import no module from the working folder
        command = [sys.executable, "-P", "-m", "scanwright", "build", str(task_file), "--out", str(out)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self._thread = Thread(target=self._follow, name="build", daemon=True)
        self._thread.start()

    @property
    def runs(self) -> bool:
        """Whether it is still running."""
        return self._process.poll() is None

    def stop(self) -> None:
        """End the build, which then leaves no files."""
        if self.runs:
            self._process.terminate()
        self._thread.join()

    def _follow(self) -> None:
        assert self._process.stdout is not None
        last, share = "", 0.0
        for line in self._process.stdout:
            last = line.strip().removeprefix(".. ") or last
            if percent := PERCENT.search(last):
                share = int(percent[1]) / 100
            self._progress(share, last)
        self._process.stdout.close()
        self._done(self._process.wait(), last)


class Saving:
    """The controls under Save. `folder` is the only one that it writes to, `out` holds the builds."""

    def __init__(self, controls: Controls, folder: Path, out: Path) -> None:
        self._controls, self._folder, self._out = controls, folder, out
        self._building: BuildProcess | None = None

    def save(self, loaded: LoadedTask, setting: Setting) -> Path:
        """Write the task file, with fixed angles if that is ticked."""
        c = self._controls
        name, fixed = c.name.value, setting if c.fixed.value else None
        text = task_text(loaded, self._folder, name, fixed)  # rejects a name that is a path
        path = self._folder / f"{name}.toml"
        if not (path.is_file() and path.read_text(encoding="utf-8") == text):
            save_task(loaded, self._folder, name, fixed, overwrite=c.overwrite.value)
        c.built.content = note_html(f"saved to {path}")
        return path

    def build(self, loaded: LoadedTask, setting: Setting) -> None:
        """Save, and build the file in a separate process."""
        c = self._controls
        if self._building is not None and self._building.runs:
            raise TaskError("build: one runs already")
        path = self.save(loaded, setting)
        put(c.building, 0.0)
        c.building.visible = True

        def progress(share: float, line: str) -> None:
            put(c.building, 100 * share)
            c.built.content = note_html(line)

        def done(code: int, line: str) -> None:
            c.building.visible = False
            end = f"built {self._out / path.stem}: open its report.html" if code == 0 else f"build ended: {line}"
            c.built.content = note_html(end, bad=code != 0)

        self._building = BuildProcess(path, self._out, progress, done)

    def refuse(self, text: str) -> None:
        """Show an error at the name, which it is about; an empty text removes it."""
        self._controls.name_error.content = note_html(text, bad=True)

    def close(self) -> None:
        """End a build that runs."""
        if self._building is not None:
            self._building.stop()
