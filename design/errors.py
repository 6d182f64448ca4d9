"""Every error that Scanwright raises on purpose.

    ScanwrightError            wrong input: a line for each fault, exit 2
     +-- TaskError             a task file or a catalogue file is missing, malformed or inconsistent
     +-- NumericalError        a result fails the program's own check: a fault of Scanwright, not of the input; exit 1
     +-- BuildError            a part, a drawing or a build folder cannot be made as asked
     +-- RecordingError        a recording is unreadable, or lacks what the command needs
     +-- SceneError            a mesh is unreadable, or holds nothing that a beam can hit
     +-- InstallError          an extra of the package, or a library of the system, is not installed
     +-- DeviceError           a device is absent, or did not do what it was asked; exit 3
          +-- DeviceTimeoutError  ... because nothing came in time
          +-- ProtocolError    ... because what came is no valid packet
          +-- DeviceFaultError ... because it is overloaded, too hot, blocked, or its supply failed
          +-- ServoSetupError  ... because its settings must change first (`firmware_io.servo.fitness`, with the list)
          +-- UnsafeError      ... and may still turn or shine: it did not confirm that it stopped

A command prints the message and exits with the code of its kind; anything else is a bug and gets its traceback. The
message is one line, or one for each fault of a file; each names file, line, field, value, bound and a suggestion, as
far as they apply.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from importlib.util import find_spec

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


class ScanwrightError(Exception):
    """Base of every error that a person can mend."""


class TaskError(ScanwrightError):
    """A task file or a catalogue file is missing, malformed or inconsistent."""


class NumericalError(ScanwrightError, ArithmeticError):
    """A result fails the program's own check: a fault of Scanwright that its users can only report."""

    def __init__(self, message: str) -> None:
        super().__init__(f"{message}; this is a fault of Scanwright: please report it with the task file")


class BuildError(ScanwrightError):
    """A part or a build folder cannot be made as asked. The message names part, feature, parameter and value."""


class RecordingError(ScanwrightError):
    """A recording is unreadable, or lacks what the command needs."""


class SceneError(ScanwrightError):
    """A mesh is unreadable, or holds nothing that a beam can hit."""


class InstallError(ScanwrightError):
    """An extra of the package, or a library of the system, is not installed. The message names the command."""


class DeviceError(ScanwrightError):
    """A device is absent, or did not do what it was asked. The message names port, device and what to do."""


class DeviceTimeoutError(DeviceError):
    """Nothing came from a device in time: unplugged, without power, or at another speed."""


class ProtocolError(DeviceError):
    """What came from a device is no valid packet: a bad checksum, a wrong length, another command's answer."""


class DeviceFaultError(DeviceError):
    """A device reports a fault of its own: overload, heat, voltage, stall. It was told to stop."""


class UnsafeError(DeviceError):
    """A device did not confirm that it stopped: a servo may still turn, a laser may still be on."""


class UnsafeNote(str):
    """A note on an error that came first: a device did not confirm that it stopped."""

    __slots__ = ()


def notes_of(error: BaseException) -> list[str]:
    """Return what else went wrong while an error was handled, such as a servo that could not be stopped."""
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


def require(extra: str, need: str, *modules: str) -> None:
    """Refuse work whose packages are not installed. None of them is imported.

    Args:
        extra: the extra of the package that brings them, such as "clouds".
        need: the beginning of the line, such as "studio needs a page server".
        modules: their top-level names.

    Raises:
        InstallError: one of them is not installed.
    """
    if not all(find_spec(module) for module in modules):
        raise InstallError(f"{need}: pip install 'scanwright[{extra}]'")
