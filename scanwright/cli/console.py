"""What the commands share: their arguments, progress on standard error, JSON on standard output, signals."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

import typer

from design.errors import require

TaskFile = Annotated[Path, typer.Argument(metavar="TASK", help="Task file, or the name of a shipped task.")]
BuildFolder = Annotated[Path, typer.Argument(metavar="OUT", help="Build folder of the scanner, with angles.json.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object for a program to read.")]


def group() -> typer.Typer:
    """A set of commands."""
    return typer.Typer(rich_markup_mode=None, add_completion=False)


def show(lines: Iterable[str]) -> None:
    """Results, on standard output."""
    for line in lines:
        print(line)


def show_json(value: Any) -> None:
    """One JSON object, on standard output."""
    print(json.dumps(value, indent=2))


def say(line: str) -> None:
    """Progress, on standard error so that results can be piped."""
    print(f"  .. {line}", file=sys.stderr, flush=True)


def say_in_place(line: str) -> None:
    """Progress of long work: on a terminal, what follows a line with a percentage takes its place."""
    if sys.stderr.isatty():
        print(f"\r\033[K  .. {line}", end="" if "%" in line else "\n", file=sys.stderr, flush=True)
    else:
        say(line)


def complain(line: str) -> None:
    """What went wrong, on standard error."""
    print(f"scanwright: {line}", file=sys.stderr)


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
