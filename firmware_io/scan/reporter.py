"""Messages of a scan: progress for the caller, warnings for the log, both for live viewers."""

from __future__ import annotations

import logging
from dataclasses import dataclass

from scanwright.design.progress import Progress, no_progress
from scanwright.firmware_io.scan.live_feed import UNWATCHED, Watch

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Reporter:
    """Receiver of the messages of a scan."""

    progress: Progress = no_progress
    watch: Watch = UNWATCHED

    def step(self, text: str, fraction: float | None = None) -> None:
        """Report a step, and its completed fraction."""
        self.progress(text, fraction)
        self.watch.message(text if fraction is None else f"{fraction:.0%}: {text}")

    def warn(self, text: str) -> None:
        """Report a warning."""
        _log.warning("%s", text)
        self.watch.message(f"warning: {text}")
