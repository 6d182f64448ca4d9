"""End of a scan, with the lines of the terminal, for live views."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from scanwright.design.errors import ScanwrightError, UnsafeError, UnsafeNote, notes_of
from scanwright.firmware_io.scan.scan_summary import ScanSummary

Outcome = Literal["done", "lossy", "stopped", "failed", "unsafe"]

_SERVO_UNKNOWN = "state of the servo unknown: check it, and cut its power if it turns"
_HEADINGS: dict[Outcome, str] = {
    "done": "The scan is done.",
    "lossy": "The scan is done, but data were lost.",
    "stopped": "The scan was stopped.",
    "failed": "The scan failed.",
    "unsafe": "The scan failed. A device may still be on.",
}


@dataclass(frozen=True, slots=True)
class ScanEnd:
    """The end of a scan."""

    outcome: Outcome  # `unsafe` if a device did not confirm that it stopped
    lines: tuple[str, ...]  # as printed in the terminal

    @property
    def heading(self) -> str:
        """The outcome in one line."""
        return _HEADINGS[self.outcome]


LOST = ScanEnd(
    "unsafe",
    (
        "The connection to the scan program is lost, and the state of the devices is unknown.",
        "The servo may turn and the laser may be on: check them, and cut their power.",
    ),
)
"""The end of a scan whose program died."""


def finished(summary: ScanSummary, lines: Iterable[str] = ()) -> ScanEnd:
    """Return the end of a scan that recorded all its turns; `lines` follow those of the summary."""
    return ScanEnd("lossy" if summary.lost_data else "done", (*summary.lines(), *lines))


def failed(error: ScanwrightError) -> ScanEnd:
    """Return the end of a scan that an error stopped."""
    unsafe = isinstance(error, UnsafeError) or _has_unsafe_note(error)
    return ScanEnd("unsafe" if unsafe else "failed", (*str(error).splitlines(), *notes_of(error)))


def stopped(stop: KeyboardInterrupt) -> ScanEnd:
    """Return the end of a scan stopped by the user; unsafe without a reply of the servo."""
    notes = notes_of(stop)
    unsafe = not notes or _has_unsafe_note(stop)
    return ScanEnd("unsafe" if unsafe else "stopped", ("stopped", *(notes or [_SERVO_UNKNOWN])))


def _has_unsafe_note(error: BaseException) -> bool:
    return any(isinstance(note, UnsafeNote) for note in notes_of(error))
