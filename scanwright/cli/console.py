"""What the commands share: their arguments, progress on standard error, JSON on standard output, signals."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import FrameType
from typing import IO, Annotated, Any

import typer

from scanwright.design.errors import require

TaskFile = Annotated[Path, typer.Argument(metavar="TASK", help="Task file, or the name of a shipped task.")]
TaskOrBuild = Annotated[
    Path, typer.Argument(metavar="TASK", help="Task file, name of a shipped task, or build folder (with its parts).")
]
BuildFolder = Annotated[Path, typer.Argument(metavar="OUT", help="Build folder of the scanner, with angles.json.")]
AllowOrigin = Annotated[
    list[str] | None,
    typer.Option(metavar="ORIGIN", help="Web page that may look beside Foxglove's own; can be given several times."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object for a program to read.")]


class Voice(Enum):
    """How much is said beside the results."""

    QUIET = "quiet"
    USUAL = ""
    VERBOSE = "verbose"


_VOICE = "SCANWRIGHT_VOICE"  # in the environment, so that a second process of the same command hears of it
_STYLES: dict[str, dict[str, Any]] = {
    "heading": {"bold": True},
    "error": {"fg": "red", "bold": True},
    "warning": {"fg": "yellow"},
    "progress": {"fg": "cyan"},
    "next": {"fg": "green", "bold": True},
}
_APART_S = 10.0  # between two lines of one progress, where nobody looks on
_BAR = 24  # characters
_NUMBER = re.compile(r"[\d.,]+")
_PERCENTAGE = re.compile(r"\s*\(?(\d{1,3})%\)?\s*")


def set_voice(voice: Voice) -> None:
    """Say more or less from now on."""
    os.environ[_VOICE] = voice.value


def voice() -> Voice:
    """How much is to be said."""
    told = os.environ.get(_VOICE, "")
    return Voice(told) if told in {each.value for each in Voice} else Voice.USUAL


@contextmanager
def own_voice() -> Iterator[None]:
    """A voice that is set within the block ends with it."""
    before = os.environ.get(_VOICE)
    try:
        yield
    finally:
        os.environ.pop(_VOICE, None)
        if before is not None:
            os.environ[_VOICE] = before


def on_terminal(stream: IO[str]) -> bool:
    """Whether a person looks on, at something that can move its cursor."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def styled(text: str, style: str, stream: IO[str] | None = None) -> str:
    """The text in the colour of a style, where the stream (standard output) is a terminal that wants colours."""
    wanted = on_terminal(stream or sys.stdout) and "NO_COLOR" not in os.environ
    return typer.style(text, **_STYLES[style]) if wanted else text


def show(lines: Iterable[str]) -> None:
    """Results, on standard output."""
    _end_bar()
    for line in lines:
        print(styled(line, "warning") if line.startswith("warning") else line)


def warn(lines: Iterable[str]) -> None:
    """Warnings, on standard error, in every voice; a line that begins with a space belongs to the one before it."""
    _end_bar()
    sys.stdout.flush()
    for line in lines:
        text = line if line.startswith(" ") else f"warning: {line}"
        print(styled(text, "warning", sys.stderr), file=sys.stderr, flush=True)


def show_json(value: Any) -> None:
    """One JSON object, on standard output."""
    print(json.dumps(value, indent=2))


def hint(line: str) -> None:
    """What to do next, the last line of a command; on standard error, so that results can be piped."""
    if voice() is not Voice.QUIET:
        _end_bar()
        sys.stdout.flush()
        print(styled(line, "next", sys.stderr), file=sys.stderr, flush=True)


@dataclass
class Progress:
    """Says what is being done, on standard error so that results can be piped.

    A line that holds a percentage is one of many of the same work. On a terminal they become one bar with the time that
    is left, which the next line takes the place of; elsewhere those that differ by their numbers only are printed every
    `_APART_S` seconds.

    Attributes:
        clock: seconds that never run backwards.
        began_s: when the work that a percentage is of began; None before the first.
        said_s: when a percentage was last printed.
        said: what of, without numbers.
    """

    clock: Callable[[], float] = time.monotonic
    began_s: float | None = None
    said_s: float = -math.inf
    said: str = ""

    def __call__(self, line: str, fraction: float | None = None) -> None:
        """Say it."""
        line = line if fraction is None else f"{fraction:4.0%}  {line}"
        if voice() is Voice.QUIET:
            return
        now_s = self.clock()
        share = _PERCENTAGE.search(line)
        if share is None and not on_terminal(sys.stderr):
            print(f"  .. {line}", file=sys.stderr, flush=True)
        elif share is None or voice() is Voice.VERBOSE:
            start = "\r\033[K" if on_terminal(sys.stderr) else ""
            print(f"{start}  {styled('..', 'progress', sys.stderr)} {line}", file=sys.stderr, flush=True)
        elif on_terminal(sys.stderr):
            done = int(share[1]) / 100
            self.began_s = now_s if self.began_s is None or done == 0 else self.began_s
            words = _PERCENTAGE.sub(" ", line, count=1).strip()
            bar = f"  {progress_bar(done)} {words}{_left(done, now_s - self.began_s)}"
            print(f"\r\033[K{bar[: shutil.get_terminal_size().columns - 1]}", end="", file=sys.stderr, flush=True)
        elif now_s - self.said_s >= _APART_S or self.said != _NUMBER.sub("", line):
            self.said_s, self.said = now_s, _NUMBER.sub("", line)
            print(f"  .. {line}", file=sys.stderr, flush=True)


def _end_bar() -> None:
    """A bar that is left on a terminal goes before anything else is written there."""
    if on_terminal(sys.stderr):
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def progress_bar(done: float) -> str:
    """The share that is done as a bar and as a percentage."""
    filled = round(_BAR * done)
    return f"[{'=' * filled}{' ' * (_BAR - filled)}] {done:4.0%}"


def _left(done: float, since_s: float) -> str:
    """How long it will take yet, once that can be told."""
    if not 0.05 <= done < 1 or since_s < 2:
        return ""
    left_s = since_s * (1 - done) / done
    return f", about {left_s / 60:.0f} min left" if left_s > 90 else f", about {left_s:.0f} s left"


def complain(line: str) -> None:
    """What went wrong, on standard error."""
    _end_bar()
    print(f"{styled('scanwright:', 'error', sys.stderr)} {line}", file=sys.stderr)


def require_pages(work: str) -> None:
    """Refuse work that opens a page where nothing is installed that could serve it.

    Raises:
        InstallError: a package of the extra `pages` is missing.
    """
    require("pages", f"{work} needs a page server", "msgspec", "viser", "websockets")


@contextmanager
def on_duty() -> Iterator[None]:
    """Go first where the system allows it (times get blurred on a busy computer), and end well on every signal."""
    usual = os.nice(0)
    with suppress(PermissionError):
        os.nice(-10)

    def interrupt(number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        os.setpriority(os.PRIO_PROCESS, 0, usual)
