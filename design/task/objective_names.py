"""Objectives that a task can name: the shipped functions, and those that installed packages add."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

GROUP = "scanwright.objectives"
"""Entry points that name functions `(field, loaded) -> Objective`; see `design.objective.named_objectives`."""

SHIPPED_OBJECTIVES = {
    name: EntryPoint(name, f"scanwright.design.objective.named_objectives:{name}", GROUP)
    for name in ("log", "kl", "required", "homogeneity", "worst")
}


def objectives() -> dict[str, EntryPoint]:
    """Return all objectives by name; a shipped one takes precedence over an installed one of the same name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)} | SHIPPED_OBJECTIVES
