"""The command `scanwright`: its groups of commands, and what becomes of an error.

A command imports its room only when it is called, so that `--help` answers at once.
"""

from __future__ import annotations

import errno
import sys

import typer

from design.errors import ScanwrightError
from scanwright.cli import clouds, design, devices, pages, parts
from scanwright.cli.console import complain, notes_of

_OF_THE_SYSTEM = {
    errno.EACCES,
    errno.EDQUOT,
    errno.EFBIG,
    errno.EIO,
    errno.ENAMETOOLONG,
    errno.ENOSPC,
    errno.EPERM,
    errno.EROFS,
}
"""What a disk refuses, wherever it does: never a bug of ours."""

app = typer.Typer(
    help="One task file becomes the angles, the parts and the frame chain of a rotating 2D lidar.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
for group in (parts, design, devices, clouds, pages):
    app.add_typer(group.app)


def run() -> None:
    """Entry point: one line and exit 2 for what a person can mend, a traceback for a bug."""
    try:
        app(prog_name="scanwright")
    except ScanwrightError as error:
        for line in (*str(error).splitlines(), *notes_of(error)):
            complain(line)
        sys.exit(2)
    except OSError as error:
        if error.errno not in _OF_THE_SYSTEM:
            raise
        complain(f"{error.filename or 'a file'}: {error.strerror}")
        sys.exit(2)
