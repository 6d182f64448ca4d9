"""The result of a build in a few sentences."""

from __future__ import annotations

from collections.abc import Sequence

from scanwright.design.angles import AngleSet
from scanwright.design.evaluation.metres import PlaneFigures, rounded
from scanwright.design.motion import Motion
from scanwright.design.objective.holes import percent
from scanwright.design.search.mounts.gain import Gain
from scanwright.report.answer import BuildAnswer

AT_M = 3.0  # from the scanner, where a neighbourhood of directions is stated as a disc


def sentences(angles: AngleSet, answer: BuildAnswer, ball_m: float, planes: Sequence[PlaneFigures]) -> list[str]:
    """Return what it is, what it sees, and the gain over simple mounts.

    Args:
        angles: what was built.
        answer: what it sees.
        ball_m: width of the neighbourhood of directions, one metre away.
        planes: what it sees on the planes of the task, in metres.
    """
    return [_is(angles, answer), *_sees(answer, ball_m, planes), *_is_worth(answer)]


def turns(motion: Motion | None) -> str:
    """Return the motion of the axis in one full scan."""
    if motion is None:
        return "in a motion that the angle set does not state"
    if motion.mode == "spin":
        return f"once around in {motion.duration_s:g} s"
    if motion.mode == "sweep":
        low, high = motion.limits_deg
        return f"from {low:g} to {high:g} deg and back in {motion.duration_s:g} s"
    return f"to {motion.stops} stops of {motion.dwell_s:g} s each"


def _is(angles: AngleSet, answer: BuildAnswer) -> str:
    blocked = answer.as_built.blocked
    parts = "" if blocked is None else f". Its own parts block {percent(blocked)} of them"
    return (
        f"The lidar {angles.sensor}, turned by the servo {angles.servo} {turns(angles.motion)}, sends "
        f"{answer.lines * answer.beams:,} beams: {answer.lines:,} lines of {answer.beams:,}{parts}."
    )


def _sees(answer: BuildAnswer, ball_m: float, planes: Sequence[PlaneFigures]) -> list[str]:
    text = [f"{_capital(figures.words())}." for figures in planes]
    if blind := answer.as_built.own.blind:
        return [*text, f"It is {'; and '.join(blind)}."]
    if planes:
        return [*text, "No direction of the region is blind."]
    width_cm = 100 * ball_m * AT_M
    return [
        f"Each disc of the region {rounded(width_cm)} cm wide, {AT_M:g} m away and facing the scanner gets "
        f"{answer.as_built.own.least:,} beams or more."
    ]


def _is_worth(answer: BuildAnswer) -> list[str]:
    first, *others = (mount.gain for mount in answer.as_built.mounts)
    if first.factor is None:
        return []
    rest = ", ".join(f"{gain.factor:.2f} ({_named(gain)})" for gain in others)
    return [
        f"In the region the scanner has {first.factor:.2f} times the beams of the best simple mount ({_named(first)}), "
        f"{answer.as_built.parts} (geometric mean, mounts without parts). Factors against the others: {rest}.",
        *(f"{_capital(sentence)}." for sentence in answer.as_built.verdict()),
    ]


def _named(gain: Gain) -> str:
    return f"{gain.mount.name} ({gain.flaws})" if gain.flaws else gain.mount.name


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
