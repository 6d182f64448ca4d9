"""A terminal of 100 columns that runs the commands of a page in one folder."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

_PROGRESS = re.compile(r"  \.\. ")
_FOLDER_OF_A_PORT = re.compile(r"/\S+/(?=(?:lidar|ttyServo)\b)")


@dataclass(frozen=True, slots=True)
class Shell:
    """A shell without a person.

    Attributes:
        folder: where it works.
        running: ends the commands that run until Ctrl-C.
    """

    folder: Path
    running: ExitStack

    def run(self, command: str) -> list[str]:
        """Return the lines that a command prints, without its progress.

        Raises:
            SystemExit: it fails in another way than with a failed check or a device that needs a person.
        """
        if command.startswith("scanwright emulate"):
            self.running.close()  # one emulator at a time
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        process = subprocess.Popen(
            ["bash", "-c", f"exec {command}"],
            cwd=self.folder,
            env=os.environ | {"PATH": path, "COLUMNS": "100", "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert process.stdout is not None
        lines: list[str] = []
        for line in process.stdout:
            if not _PROGRESS.match(line):
                lines.append(_FOLDER_OF_A_PORT.sub(".../", line.rstrip("\n")))
            if "Ctrl-C ends" in line:
                self.running.callback(_end, process)
                return lines
        if process.wait() not in (0, 1, 3):
            raise SystemExit(f"{command}: exit code {process.returncode}\n" + "\n".join(lines))
        return lines


def _end(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGINT)
    with suppress(subprocess.TimeoutExpired):
        process.wait(30)
    process.kill()
