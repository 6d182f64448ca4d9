"""Every error that Scanwright raises on purpose.

    ScanwrightError            wrong input
     +-- TaskError             task or catalogue file: missing, malformed or inconsistent       (ValueError)
     |    +-- MissingFileError there is no such file                                            (FileNotFoundError)
     +-- NumericalError        a result fails the program's own check: a bug; exit code 1       (ArithmeticError)
     +-- BuildError            a part, a drawing or a build folder cannot be made as requested  (ValueError)
     +-- RecordingError        recording: unreadable, or without the data that is required      (ValueError)
     +-- SceneError            mesh: unreadable, or without a surface that a beam can hit       (ValueError)
     +-- InstallError          an extra of the package or a system library is not installed     (ImportError)
     +-- DeviceError           a device is absent or did not do what was requested; exit code 3
          +-- DeviceTimeoutError  it did not answer in time                                     (TimeoutError)
          +-- ProtocolError    its answer is not a valid packet
          +-- DeviceFaultError it is overloaded, too hot, blocked, or its supply failed
          +-- ServoSetupError  its settings must change first (`firmware_io.servo.fitness`, with the list)
          +-- UnsafeError      it did not confirm that it stopped: it may still turn or emit light

A command prints the message and exits with the code of its kind, 2 if none is named; any other exception is a bug and
prints its traceback. The message is one line, or one line for each fault of a file: file, line, field, value, bound
and a suggestion, as far as they apply.
It names fields in Python form: `min_range_m = 9: at most 5`. The command line prints those that are its options as
options. It recognises a field by an underscore, before ":" or " = " at the start, or in backquotes.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

_NO_SWITCH = "the servo knows its angle, and `scanwright scan` never read the switch"
_NO_STEPPER = "no layout took the stepper; use a Dynamixel or Feetech servo, such as MX-64R"

REMOVED: dict[str, str] = {  # names in files and commands of version 0.1, and what to use instead
    # keys of [modules]
    "homing_flag": f"leave the key out: {_NO_SWITCH}",
    "ring_cover": "leave the key out: nothing replaces it",
    # products and kinds of products
    "cnc": "printers print; use 'fdm-0.4', and have parts milled or turned from their STEP files",
    "EE-SX672": _NO_SWITCH,
    "slot_switch": _NO_SWITCH,
    "PD42-3-1140": _NO_STEPPER,
}


MAKERS: dict[str, str] = {  # suffix of a file -> the end of the message that there is none
    ".json": "; `scanwright build TASK` writes angles.json to out/TASK",
    ".mcap": "; `scanwright scan` makes recordings, `scanwright import` converts ROS bags",
    ".ply": "; `scanwright assemble` makes clouds of recordings",
}


class ScanwrightError(Exception):
    """Base of every error that the user can fix."""


class TaskError(ScanwrightError, ValueError):
    """A task file or a catalogue file is missing, malformed or inconsistent."""


class MissingFileError(TaskError, FileNotFoundError):
    """A task file, a catalogue file or an angle set does not exist."""


class NumericalError(ScanwrightError, ArithmeticError):
    """A result fails the program's own check: a bug of Scanwright that users can only report."""

    def __str__(self) -> str:
        return f"{super().__str__()}; this is a fault of Scanwright: please report it with the task file"


class BuildError(ScanwrightError, ValueError):
    """A part or a build folder cannot be made as requested. The message names part, feature, parameter and value."""


class RecordingError(ScanwrightError, ValueError):
    """A recording is unreadable, or lacks data that is required."""


class SceneError(ScanwrightError, ValueError):
    """A mesh is unreadable, or has no surface that a beam can hit."""


class InstallError(ScanwrightError, ImportError):
    """An extra of the package, or a system library, is not installed. The message names the command."""


class DeviceError(ScanwrightError):
    """A device is absent, or did not do what was requested. The message names port, device and what to do."""


class DeviceTimeoutError(DeviceError, TimeoutError):
    """A device did not answer in time: unplugged, without power, or at another baud rate."""


class ProtocolError(DeviceError):
    """A device's answer is not a valid packet: a bad checksum, a wrong length, the answer to another command."""


class DeviceFaultError(DeviceError):
    """A device reports a fault: overload, heat, voltage, stall. It was commanded to stop."""


class UnsafeError(DeviceError):
    """A device did not confirm that it stopped: a servo may still turn, a laser may still be on."""


class UnsafeNote(str):
    """A note on an earlier error: a device did not confirm that it stopped."""

    __slots__ = ()


def notes_of(error: BaseException) -> list[str]:
    """Return the notes of an error: further faults during its handling, such as a servo that did not stop."""
    return list(getattr(error, "__notes__", ()))


def removal(name: str) -> str | None:
    """Return "removed in 0.2: ..." with what to use instead; None for a name that version 0.1 did not have."""
    return None if name not in REMOVED else f"removed in 0.2: {REMOVED[name]}"


def suggest(word: str, known: Iterable[str]) -> str:
    """Return "; did you mean 'X'?", or the list of known words if none is close; or what replaces a removed word."""
    if (removed := removal(word)) is not None:
        return f"; {removed}"
    names = sorted(known)
    folded = {name.lower(): name for name in names}
    close = difflib.get_close_matches(word.lower(), folded, n=1, cutoff=0.6)
    if close:
        return f"; did you mean '{folded[close[0]]}'?"
    return f"; known: {', '.join(names)}" if names else ""


def made_by(path: Path) -> str:
    """Return the end of a message about a missing file: the command that makes such a file; empty if there is none."""
    return MAKERS.get(path.suffix.lower(), "")


def require(extra: str, need: str, *modules: str) -> None:
    """Require packages to be installed, without importing them.

    The message is `need`, such as "studio needs a page server", and the extra of the package that installs them.

    Raises:
        InstallError: one of them is not installed.
    """
    if not all(find_spec(module) for module in modules):
        raise InstallError(f"{need}: pip install 'scanwright[{extra}]'")
