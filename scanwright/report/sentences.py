"""The answer of a build in a few sentences that need no other page."""

from __future__ import annotations

from collections.abc import Sequence

from design.angles import AngleSet
from design.evaluation.metres import PlaneFigures, rounded
from design.motion import Motion
from scanwright.report.answer import BuildAnswer

AT_M = 3.0  # from the scanner, where a ball of directions is told as a disc


def sentences(angles: AngleSet, answer: BuildAnswer, ball_m: float, planes: Sequence[PlaneFigures]) -> list[str]:
    """What it is, what it sees, and what that is worth.

    Args:
        angles: what was built.
        answer: what it sees.
        ball_m: width of the ball of directions, one metre away.
        planes: what it sees on the planes of the task, in metres.
    """
    return [_is(angles, answer), *_sees(answer, ball_m, planes), *_is_worth(answer)]


def turns(motion: Motion | None) -> str:
    """How the axis moves in one full scan."""
    if motion is None:
        return "in a motion that the angle set does not tell"
    if motion.mode == "spin":
        return f"once around in {motion.duration_s:g} s"
    if motion.mode == "sweep":
        low, high = motion.limits_deg
        return f"from {low:g} to {high:g} deg and back in {motion.duration_s:g} s"
    return f"to {motion.stops} stops of {motion.dwell_s:g} s each"


def _is(angles: AngleSet, answer: BuildAnswer) -> str:
    points = answer.lines * answer.beams
    return (
        f"The lidar {angles.sensor}, turned by the servo {angles.servo} {turns(angles.motion)}, measures {points:,} "
        f"points: {answer.lines:,} lines of {answer.beams:,}."
    )


def _sees(answer: BuildAnswer, ball_m: float, planes: Sequence[PlaneFigures]) -> list[str]:
    said = [f"{_capital(figures.words())}." for figures in planes]
    if answer.holes:
        return [*said, f"It is {'; and '.join(answer.holes)}."]
    if planes:
        return [*said, "No direction that counts is left out."]
    width_cm = 100 * ball_m * AT_M
    return [
        f"Wherever it counts, a disc {rounded(width_cm)} cm wide, {AT_M:g} m away and facing the scanner, gets "
        f"{answer.own.least:,} of them or more."
    ]


def _is_worth(answer: BuildAnswer) -> list[str]:
    factors = [(each.factor, each.name) for each in answer.standard if each.factor is not None]
    if not factors:
        return []
    factor, name = min(factors)
    return [
        f"Where it counts there are {factor:.2f} times as many as with {name}, the better of the two usual mounts and "
        "drawn without any parts in its way (geometric mean)."
    ]


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
