"""Work that a stage skipped because the task does not need it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Work that was skipped; what it saved is a count, not seconds, since builds are reproducible."""

    what: str  # what was skipped
    why: str  # reason
    saved: int  # count that it saved; 0 for mounts that were rejected
    unit: str  # unit of the count
