"""`scanwright build` as a separate process, and its progress."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from threading import Thread

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
