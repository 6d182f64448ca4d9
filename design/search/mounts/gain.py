"""Gain of a mount over the reference mounts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from scanwright.design.angles import angles_words
from scanwright.design.objective.holes import NO_BLIND_WEIGHT, percent
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.stated_error import error_words
from scanwright.design.search.mounts.reference import TunedMount, angles_used

AS_GOOD = 1.02  # factors up to this do not justify a mount that is harder to build


@dataclass(frozen=True, slots=True)
class Gain:
    """Gain over one reference mount without parts."""

    mount: TunedMount  # the reference mount
    # ratio of the beams per direction (geometric mean) to those of the mount; None for objectives but `log`
    factor: float | None
    J_less: float  # J of the mount minus J of the result
    same: bool  # whether the result is this mount
    simpler: bool  # whether the mount has fewer angles other than 0 than the result

    @property
    def value(self) -> str:
        """The gain as text: a factor, or a difference of J."""
        return f"{self.J_less:+.4f} in J" if self.factor is None else f"{self.factor:.2f} x"

    @property
    def flaws(self) -> str:
        """Limits that the mount breaks and its blind share, as text; empty if there are none."""
        flaws = [] if self.mount.keeps_limits else ["breaks the limits"]
        blind = self.mount.score.blind_weight
        return ", ".join(flaws + ([f"blind to {percent(blind)} of the weight"] if blind > NO_BLIND_WEIGHT else []))

    def words(self) -> str:
        """Return the gain, the mount, its angles and its J as a line."""
        J = f"J = {self.mount.score.J:.4f}"
        if self.factor is None:
            J += f" +- {error_words(self.mount.score.J, self.mount.score.J_error)}"
        inside = "; ".join(filter(None, [J, self.flaws]))
        return f"{self.value} {self.mount.name} {angles_words(self.mount.angles_deg)}: {inside}"

    def facts(self) -> dict[str, Any]:
        """Return the figures by name, for JSON."""
        return {
            "name": self.mount.name,
            "angles_deg": list(self.mount.angles_deg),
            "factor": self.factor,
            "J_less": self.J_less,
            **{key: value for key, value in asdict(self.mount.score).items() if key != "J_lower"},
            "keeps_limits": self.mount.keeps_limits,
            "in_ranges": self.mount.in_ranges,
        }


def gains(problem: Problem, angles_deg: Sequence[float], J: float, mounts: Iterable[TunedMount]) -> tuple[Gain, ...]:
    """Return the gains of a mount over reference mounts, the smallest first."""
    logarithmic = problem.objective.name == "log"  # only its differences are ratios of densities
    result = []
    for mount in mounts:
        less = mount.score.J - J
        factor = float(np.exp(less)) if logarithmic else None
        same = np.allclose(angles_deg, mount.angles_deg, atol=1e-6)
        result.append(Gain(mount, factor, less, same, angles_used(mount.angles_deg) < angles_used(angles_deg)))
    return tuple(sorted(result, key=lambda gain: gain.J_less))


EASIER = ', and easier to build: angles.prefer = "simple" with prefer_loss = 0.02 picks it'


def gain_lines(result: tuple[Gain, ...]) -> list[str]:
    """Return the gains as lines, and the verdict."""
    what = "J" if result[0].factor is None else "beam density in the region"
    lines = [f"{what}, against simple mounts tuned to the task, without parts:"]
    return [*lines, *(f"  {gain.words()}" for gain in result), *verdict(result)]


def verdict(result: tuple[Gain, ...]) -> list[str]:
    """Return a sentence about a simple mount that is as good or better, preferably one without flaws."""
    good = [gain for gain in result if gain.factor is not None and gain.factor <= AS_GOOD]
    if not good:
        return []
    free = [gain for gain in good if not _against(gain)] or good
    better = free[0].factor is not None and free[0].factor < 2 - AS_GOOD  # the best one is first
    best = free[0] if better else min(free, key=lambda gain: (not gain.same, not gain.simpler))
    if best.same:
        return [f"the optimum is itself a simple mount: {best.mount.name}"]
    assert best.factor is not None
    mount = f"{best.mount.name} {angles_words(best.mount.angles_deg)}"
    against = _against(best)
    if not better:
        rest = f", but {against}" if against else EASIER if best.simpler else ""
        return [f"{mount} is as good within {AS_GOOD - 1:.0%}{rest}"]
    rest = f", but {against}" if against else ": fix its angles in the task and build, to see if its parts pass"
    return [f"{mount} has {1 / best.factor:.2f} times the beams if its parts block none{rest}"]


def _against(gain: Gain) -> str:
    """Return the flaws of a mount and whether the task excludes its angles, as text."""
    flaws = gain.flaws if not gain.flaws or gain.flaws.startswith("breaks") else f"is {gain.flaws}"
    return ", ".join(filter(None, [flaws, "" if gain.mount.in_ranges else "the angles of the task exclude it"]))
