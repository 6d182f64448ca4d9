"""Permanent settings of a servo: written after confirmation, with a file to undo the change."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import typer

from scanwright.cli.console import print_error, show_json
from scanwright.cli.results.of_commands import Settings

if TYPE_CHECKING:
    from scanwright.firmware_io.servo.fitness import ServoSetupError

T = TypeVar("T")


def set_up_command(port: str, out: Path | None = None, servo_id: int | None = None) -> str:
    """Return the command that sets up the servo of a port, for the motion of a build folder."""
    words = [f"scanwright servo-setup {port}"]
    words += [] if out is None else [f"--scanner {out}"]
    words += [] if servo_id is None else [f"--from-id {servo_id}"]
    return " ".join(words)


def print_steps(port: str, steps: Iterable[str | Path], as_json: bool = False) -> None:
    """Print each change as it is made, and first how to undo all; or one JSON object at the end."""
    if as_json:
        made = list(steps)
        undo = next((step for step in made if isinstance(step, Path)), None)
        show_json(Settings([step for step in made if isinstance(step, str)], undo))
        return
    for step in steps:
        if isinstance(step, Path):
            print(
                f"the old settings are saved; `scanwright servo-setup {port} --undo {step}` restores them", flush=True
            )
        else:
            print(step, flush=True)


def asking_first(work: Callable[[], T], out: Path, servo_id: int | None) -> T:
    """Do work; if settings of the servo must change for it, ask the user, write them, and do it again.

    The work stops the servo before it raises an error. The build folder `out` gets the undo file.

    Raises:
        ServoSetupError: there is no terminal, or a setting does not last; nothing moves.
        typer.Exit: the user declines, code 3; nothing moves.
    """
    from scanwright.firmware_io.servo.fitness import ServoSetupError
    from scanwright.firmware_io.servo.settings import set_up

    written: set[str] = set()
    while True:
        try:
            return work()
        except ServoSetupError as error:
            names = {change.register.name for change in error.changes}
            if names & written:
                error.add_note("it was written and lost: the servo has restarted; check its supply")
                raise
            remedy = f"`{set_up_command(error.port, out, servo_id)}` writes that, and keeps a file to undo it"
            if not (sys.stdin.isatty() and sys.stderr.isatty()):
                error.add_note(remedy)
                raise
            if not _agrees(error):
                print_error(f"nothing was written, nothing was moved; {remedy}")
                raise typer.Exit(3) from None
            written |= names
            print_steps(error.port, set_up(error.port, error.model, error.servo_id, out, agreed=error.changes))


def _agrees(error: ServoSetupError) -> bool:
    """Print the changes, and return whether the user agrees."""
    for line in str(error).splitlines():
        print_error(line)
    number = len(error.changes)
    try:
        return typer.confirm(
            f"Write {'this register' if number == 1 else f'these {number} registers'} to the servo?", err=True
        )
    except typer.Abort:
        return False
