"""Work that a stage skipped because the task does not need it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LeftOut:
    """One skipped item, the reason, and the count that it saved (not seconds, since builds are reproducible)."""

    what: str
    why: str
    saved: int
    unit: str
