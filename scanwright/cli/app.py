"""The command `scanwright`: its groups of commands, and the printing of errors.

A command imports its packages only when it is called, so that `--help` is fast.
"""

from __future__ import annotations

import errno
import os
import re
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from scanwright import __version__
from scanwright.cli import clouds, design, devices, new, pages, parts
from scanwright.cli.console import command_console, exit_code, print_error
from scanwright.cli.help import Commands, GroupedHelp
from scanwright.design.errors import ScanwrightError, notes_of

USAGE_ERROR: Any = typer.BadParameter.__mro__[1]
"""Base class of the errors that typer raises for wrong calls; typer exports only a subclass."""

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
"""Errors of disks and permissions, which are never a bug of the program."""

app = Commands()
for group in (new, design, parts, devices, clouds, pages):
    app.add_typer(group.app)


@app.callback(
    cls=GroupedHelp,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Start with `scanwright new`, or try `scanwright build ground_ahead`. `scanwright COMMAND --help` lists the "
    "options of a command.",
)
def scanwright(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Design and run a 3D laser scanner made of a 2D lidar and a servo."""
    if version:
        print(f"scanwright {__version__}")
    elif context.invoked_subcommand is None:
        print(context.get_help())


def run() -> None:
    """Entry point: print one line for each fault of the input, or a traceback for a bug."""
    try:
        with command_console():
            code = app(prog_name="scanwright", standalone_mode=False)
            sys.stdout.flush()  # report write errors here, not at the exit of Python
            sys.exit(code)
    except USAGE_ERROR as error:
        number = re.fullmatch(r"-[\d.]+", getattr(error, "option_name", ""))
        advice = "; a value that begins with - goes behind =: --angles=0,90,0,-90" if number else ""
        message = error.format_message().replace(": Value error, ", ": ").removesuffix(".")  # added by pydantic
        command = "scanwright" if error.ctx is None else error.ctx.command_path
        print_error(f"{message}{advice} (see `{command} --help`)")
        sys.exit(2)
    except ScanwrightError as error:
        for line in (*str(error).splitlines(), *notes_of(error)):
            print_error(line)
        sys.exit(exit_code(error))
    except typer.Abort as error:  # at a question: Ctrl-C, or Ctrl-D and the end of a file
        ended = isinstance(error.__context__, EOFError)
        print()  # end the line of the question
        if ended:
            print_error("no answer: the input ended")
        sys.exit(2 if ended else 130)
    except BrokenPipeError:  # the reader of the results has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:
        if error.errno not in _OF_THE_SYSTEM:
            raise
        place = Path(error.filename).absolute() if error.filename else _unnamed(error)
        print_error(f"{place}: {error.strerror}")
        sys.exit(2)


def _unnamed(error: OSError) -> str:
    """Return the subject of a system error without a file name: standard output if that fails again, else a file."""
    try:
        print(flush=True)  # the failed output may have left the buffer
    except OSError as again:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python tries again at its exit
        if again.errno == error.errno:
            return "standard output"
    return "a file"
