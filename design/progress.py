"""Progress of work that takes more than a second: one callback for all packages."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Callback for progress."""

    def __call__(self, step: str, fraction: float | None = None, /) -> None:
        """Report progress.

        Args:
            step: what is being done, as a short phrase without numbers of progress.
            fraction: share of this step that is done, 0 to 1; None if it is unknown.
        """


def no_progress(_step: str, _fraction: float | None = None, /) -> None:
    """Report nothing: the default of functions with a `Progress`."""
