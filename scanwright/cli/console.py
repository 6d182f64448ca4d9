"""Common functions of the commands: results, warnings, progress, JSON, verbosity, signals."""

from __future__ import annotations

import logging
import math
import os
import re
import shutil
import signal
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import timedelta
from enum import Enum
from types import FrameType
from typing import IO, Any

import typer

from scanwright.design.errors import DeviceError, NumericalError, ScanwrightError, require


class Verbosity(Enum):
    """How much a command prints in addition to its results."""

    QUIET = "quiet"
    USUAL = ""
    VERBOSE = "verbose"


_VERBOSITY = "SCANWRIGHT_VERBOSITY"  # in the environment, for other processes of the command
_OLD_VERBOSITY = "SCANWRIGHT_VOICE"  # its name in version 0.1
_STYLES: dict[str, dict[str, Any]] = {
    "heading": {"bold": True},
    "error": {"fg": "red", "bold": True},
    "warning": {"fg": "yellow"},
    "note": {"bold": True},
    "progress": {"fg": "cyan"},
    "next": {"fg": "green", "bold": True},
}
_PRIORITY = -10  # nice value: above ordinary programs, below those of the system at -20
_APART_S = 10.0  # between two lines of one step in a log file
_MOST_COLUMNS = 100
_COLUMN = re.compile(r"\S {2,}(?=\S)")
_MOST_GAPS = 2  # wide gaps: a line with more is the row of a table
_MOST_INDENT = 20  # of continuation lines, to the column of the value
_BAR_CHARACTERS = 24  # leaves 50 of 80 columns for the step and the time left
_LEAST_SHARE = 0.1  # share of the work that is done before the time left is estimated
_NUMBER = re.compile(r"[\d.,]+")
_FIELD = re.compile(r"^[a-z]+(?=:| = )|(?<=`)\w+(?=`)|(?<![\w./-])[a-z]+(_[a-z0-9]+)+(?![\w/(-]|\.\w)")
_SETTING = re.compile(r'\b(\w+) = (true|"?([\w.+-]+)"?)')
_options: dict[str, str] = {}
_elsewhere: dict[str, str] = {}


def set_verbosity(value: Verbosity) -> None:
    """Set the verbosity of this process and of those that it starts."""
    os.environ[_VERBOSITY] = value.value


def verbosity() -> Verbosity:
    """Return how much to print."""
    value = os.environ.get(_VERBOSITY, os.environ.get(_OLD_VERBOSITY, ""))
    return Verbosity(value) if value in {each.value for each in Verbosity} else Verbosity.USUAL


class _Log(logging.Handler):
    """Handler that prints logged warnings on standard error."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a warning."""
        warn([record.getMessage()])


@contextmanager
def command_console() -> Iterator[None]:
    """Print logged warnings while the block runs, and restore the verbosity at its end."""
    before, log = os.environ.get(_VERBOSITY), _Log(logging.WARNING)
    logging.getLogger("scanwright").addHandler(log)
    try:
        yield
    finally:
        logging.getLogger("scanwright").removeHandler(log)
        os.environ.pop(_VERBOSITY, None)
        if before is not None:
            os.environ[_VERBOSITY] = before


def on_terminal(stream: IO[str]) -> bool:
    """Return whether a stream is a terminal with cursor control."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def styled(text: str, style: str, stream: IO[str] | None = None) -> str:
    """Return the text in the colour of a style, if the stream (standard output by default) is a terminal."""
    wanted = on_terminal(stream or sys.stdout) and "NO_COLOR" not in os.environ
    return typer.style(text, **_STYLES[style]) if wanted else text


def show(lines: Iterable[str]) -> None:
    """Print results on standard output, and the warnings among them on standard error."""
    _end_bar()
    warning = False
    for line in lines:
        warning = line.startswith("warning: ") or (warning and line.startswith(" "))
        if warning:
            warn([line.removeprefix("warning: ")])
        else:
            print(wrapped(line, sys.stdout), flush=True)


def wrapped(line: str, stream: IO[str]) -> str:
    """Return a line wrapped at 100 columns or at the terminal's width; unchanged for a file unless COLUMNS is set."""
    if not (on_terminal(stream) or "COLUMNS" in os.environ) or len(_COLUMN.findall(line)) > _MOST_GAPS:
        return line
    label = re.match(r" *(?:\S+(?: \S+)*  +)?", line)
    indent = len(label[0]) if label and 0 < len(label[0]) <= _MOST_INDENT else 2
    width = min(shutil.get_terminal_size().columns, _MOST_COLUMNS)
    return textwrap.fill(line, width, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False)


def warn(lines: Iterable[str]) -> None:
    """Print warnings in every verbosity; a line that begins with a space continues the one before it."""
    for line in lines:
        _print_aside("" if line.startswith(" ") else "warning", line)


def print_error(line: str) -> None:
    """Print an error."""
    _print_aside("error", line)


def print_note(line: str) -> None:
    """Print a note on the state of the work of a stopped command."""
    _print_aside("note", line)


def _print_aside(kind: str, line: str) -> None:
    """Print a line on standard error, after all output to standard output, with fields spelt as options."""
    _end_bar()
    sys.stdout.flush()
    if kind == "warning" or line.lstrip().startswith("hint: "):
        what, colon, remedy = line.rpartition(": ")
        line = what + colon + as_typed(remedy)
    text = _FIELD.sub(lambda match: _options.get(match[0], match[0]), line)
    if kind:  # not wrapped, so that a path can be copied
        text = styled(f"{kind}:", kind, sys.stderr) + f" {text}"
    print(text, file=sys.stderr, flush=True)


def as_typed(remedy: str) -> str:
    """Spell each `name = value` of a remedy as an option, with its command if the running one does not have it."""

    def as_option(setting: re.Match[str]) -> str:
        option = _options.get(setting[1]) or _elsewhere.get(setting[1])
        return setting[0] if option is None else option if setting[2] == "true" else f"{option} {setting[3]}"

    return _SETTING.sub(as_option, remedy)


def exit_code(error: ScanwrightError) -> int:
    """Return the exit code of an error: 1 for a wrong result, 2 for wrong input, 3 for a device."""
    return 1 if isinstance(error, NumericalError) else 3 if isinstance(error, DeviceError) else 2


def name_options(options: dict[str, str]) -> None:
    """Set the options of the running command: field of an error -> option, such as `min_range_m` -> `--min-range-m`."""
    _options.clear()
    _options.update(options)


def name_elsewhere(command: str, options: dict[str, str]) -> None:
    """Add the options of a command for messages of other commands; the first command of a field is used."""
    for field, option in options.items():
        _elsewhere.setdefault(field, f"{command} {option}")


def show_json(record: Any) -> None:
    """Print a record as one JSON object on standard output; infinite numbers become null."""
    from pydantic_core import to_json

    print(to_json(record, indent=2, inf_nan_mode="null").decode(), flush=True)


def show_result(lines: Callable[[], Iterable[str]], record: Any, as_json: bool) -> None:
    """Print a result as lines, or its record as one JSON object."""
    if as_json:
        show_json(record)
    else:
        show(lines())


def hint(line: str) -> None:
    """Print the next step as the last line of a command, on standard error, so that results can be piped."""
    if verbosity() is not Verbosity.QUIET:
        _end_bar()
        sys.stdout.flush()
        print(styled(wrapped(line, sys.stderr), "next", sys.stderr), file=sys.stderr, flush=True)


@dataclass
class ConsoleProgress:
    """A `Progress` that prints to standard error, so that results can be piped.

    On a terminal the steps with a known fraction are one bar, which the next line replaces. In a file such a step is
    one line every `_APART_S` seconds.
    """

    clock: Callable[[], float] = time.monotonic  # monotonic time [s], the same one in all processes
    began: tuple[float, float] | None = None  # time [s] and fraction of the first step with a fraction; None before it
    printed_s: float = -math.inf  # when a step with a fraction was last printed
    printed: str = ""  # that step, without numbers
    _fraction: float = 0.0

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle for another process, which estimates the time left from the same beginning."""
        return ConsoleProgress, (time.monotonic, self.began)

    def left_s(self, fraction: float) -> float | None:
        """Return the time left [s] at a fraction, from the time so far; None if that is too short."""
        now_s = self.clock()
        # nothing is done yet, or other or repeated work begins
        if self.began is None or not fraction or fraction < self._fraction - _LEAST_SHARE:
            self.began, self._fraction = (now_s, fraction), fraction
        fraction = self._fraction = max(fraction, self._fraction)
        began_s, first = self.began
        done = fraction - first
        return (1 - fraction) * (now_s - began_s) / done if done >= _LEAST_SHARE * (1 - first) else None

    def __call__(self, step: str, fraction: float | None = None, /) -> None:
        """See `design.progress.Progress`."""
        if verbosity() is Verbosity.QUIET:
            return
        verbose, terminal = verbosity() is Verbosity.VERBOSE, on_terminal(sys.stderr)
        if terminal and fraction is not None and not verbose:
            print(f"\r\033[K{self._drawn(step, fraction)}", end="", file=sys.stderr, flush=True)
            return
        now_s, kind = self.clock(), _NUMBER.sub("", step)
        if fraction is not None and not verbose:
            if now_s - self.printed_s < _APART_S and self.printed == kind:
                return
            self.printed_s, self.printed = now_s, kind
        share = "" if fraction is None else f" ({fraction:.0%})"
        _end_bar()
        print(f"  {styled('..', 'progress', sys.stderr)} {step}{share}", file=sys.stderr, flush=True)

    def _drawn(self, step: str, fraction: float) -> str:
        """Return the bar as text of one line."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn
        from rich.table import Column

        left_s = self.left_s(fraction)
        left = "-:--:--" if left_s is None else str(timedelta(seconds=round(left_s)))
        words = TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True, overflow="ellipsis"))
        console = Console(stderr=True)
        bar = Progress(BarColumn(_BAR_CHARACTERS), TaskProgressColumn(), TextColumn(left), words, console=console)
        bar.update(bar.add_task(step, total=1.0), completed=self._fraction)
        with console.capture() as capture:
            console.print(bar.get_renderable(), end="", width=console.width - 1)
        return capture.get().rstrip("\n")


def _end_bar() -> None:
    """Clear the bar on a terminal before anything else is written there."""
    if on_terminal(sys.stderr):
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def require_pages(work: str) -> None:
    """Require the packages of the extra `pages`; raises InstallError."""
    require("pages", f"{work} needs a page server", "msgspec", "viser", "websockets")


@contextmanager
def high_priority() -> Iterator[None]:
    """Run the block at a high priority if allowed, for exact arrival times; every signal is a KeyboardInterrupt."""
    usual = os.nice(0)
    with suppress(PermissionError):
        os.nice(_PRIORITY)

    def interrupt(number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        os.setpriority(os.PRIO_PROCESS, 0, usual)
