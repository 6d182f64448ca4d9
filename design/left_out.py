"""What a stage skipped because the task does not need it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LeftOut:
    """One thing that was skipped, the reason, and the count it saved (never seconds: builds are reproducible)."""

    what: str
    why: str
    saved: int
    unit: str
