"""Summary and end of a scan, with the lines of the terminal, for live views."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from scanwright.design.errors import ScanwrightError, UnsafeError, UnsafeNote, notes_of

BETWEEN_STOPS = "scans between two stops"  # dropped by design
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
class ScanSummary:
    """Data of a scan.

    Attributes:
        recording: the file.
        scans: number of scans in it.
        joint_samples: number of servo angles in it.
        duration_s: from the first to the last scan.
        speed_deg_s: mean speed of the servo; 0 for a sweep.
        ripple_deg: rms deviation from uniform rotation over half a second.
        clock_ns: standard uncertainty of the beam times at the end.
        reconnects: number of times that the lidar disconnected and came back.
        left_out: dropped data, reason -> count.
        lost_replies: missing or damaged replies of the servo.
        longest_gap_s: longest time between two servo angles.
    """

    recording: Path
    scans: int
    joint_samples: int
    duration_s: float
    speed_deg_s: float
    ripple_deg: float
    clock_ns: int
    reconnects: int
    left_out: dict[str, int]
    lost_replies: int = 0
    longest_gap_s: float = 0.0

    @property
    def lost_data(self) -> bool:
        """Whether data are missing other than those dropped by design."""
        return bool(self.reconnects or set(self.left_out) - {BETWEEN_STOPS})

    def lines(self) -> list[str]:
        """Format the summary."""
        lines = [f"dropped {count:,}: {reason}" for reason, count in self.left_out.items()]
        if self.reconnects:
            lines.append(f"lidar reconnects: {self.reconnects}")
        if self.lost_replies:
            share = self.lost_replies / (self.joint_samples + self.lost_replies)
            turned_deg = abs(self.speed_deg_s) * self.longest_gap_s
            lines.append(
                f"lost servo replies: {self.lost_replies:,} ({share:.1%}); longest gap between angles: "
                f"{self.longest_gap_s:.3f} s" + (f", {turned_deg:.1f} deg" if turned_deg else "")
            )
        if self.speed_deg_s:
            lines.append(f"servo speed: {self.speed_deg_s:.2f} deg/s, rms deviation {self.ripple_deg:.3f} deg")
        return [
            *lines,
            f"timestamp uncertainty: {self.clock_ns / 1e6:.2f} ms per beam",
            f"recorded {self.scans:,} scans and {self.joint_samples:,} angles, {self.duration_s:.1f} s, "
            f"to {self.recording}",
        ]


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
