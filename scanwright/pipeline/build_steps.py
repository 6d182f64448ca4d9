"""Share of a build that is done when one of its steps begins, measured by `benchmarks.scanwright.build_steps`."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from scanwright.design.progress import Progress

TABLE = "build_steps.csv"
DONE = "done"
_NUMBERS = re.compile(r"\([^)]*\)|[\d.,:;]+")


@dataclass(frozen=True, slots=True)
class BuildProgress:
    """A `Progress` that gets the share of the build in place of the share of a step."""

    progress: Progress

    def __call__(self, step: str, fraction: float | None = None, /) -> None:
        """See `design.progress.Progress`."""
        self.progress(step, share_done(measured_shares(), step, fraction or 0.0))


def kind_of(step: str) -> str:
    """Return a step without the numbers that differ from task to task."""
    return " ".join(_NUMBERS.sub(" ", step).split())


def share_done(shares: Mapping[str, float], step: str, fraction: float = 0.0) -> float | None:
    """Return the share of a build that is done in a step; None if no step of this kind was measured.

    Args:
        shares: kind of step -> share when it begins.
        step: text of the step. An unknown part counts as the first one of the same work.
        fraction: share of the step that is done.
    """
    kind = kind_of(step)
    alike = [share for known, share in shares.items() if known.split()[:2] == kind.split()[:2]]
    share = shares.get(kind, min(alike, default=None))
    if share is None or not fraction:
        return share
    following = min((other for other in shares.values() if other > share), default=1.0)
    return share + fraction * (following - share)


@cache
def measured_shares() -> dict[str, float]:
    """Return kind of step -> mean share over the measured builds."""
    shares: dict[str, list[float]] = {}
    for begins in measured_builds().values():
        for kind, begin_s in begins.items():
            shares.setdefault(kind, []).append(begin_s / begins[DONE])
    return {kind: sum(each) / len(each) for kind, each in shares.items()}


def measured_builds() -> dict[str, dict[str, float]]:
    """Return task -> kind of step -> seconds until it began; `DONE` is the end of the build."""
    text = files("scanwright.pipeline").joinpath(TABLE).read_text(encoding="utf-8")
    builds: dict[str, dict[str, float]] = {}
    for row in csv.DictReader(text.splitlines()):
        builds.setdefault(row["task"], {})[row["step"]] = float(row["seconds"])
    return builds
