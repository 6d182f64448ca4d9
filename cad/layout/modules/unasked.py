"""The entry in `left_out.json` of a module that no task asks for."""

from __future__ import annotations

from scanwright.design.left_out import LeftOut


def unasked(part: str) -> LeftOut:
    """One part, whose name is that of its key in the task."""
    return LeftOut(part, f"the task does not ask for it by modules.{part}", 1, "parts")
