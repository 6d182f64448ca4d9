"""The first screen of the report: title, verdict and four cards, all from records that a build computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.design.angles import AngleSet
from scanwright.design.evaluation.as_built import AsBuilt
from scanwright.design.evaluation.metres import PlaneFigures, planes_of, rounded
from scanwright.design.motion import Motion
from scanwright.design.objective.holes import percent
from scanwright.design.task.task import LoadedTask
from scanwright.report.answer import BuildAnswer
from scanwright.report.parts_list import PartsList
from scanwright.report.to_do import count

DISC_M = 3.0  # distance at which a neighbourhood of directions is stated as a disc
GAP_M = 10.0  # distance at which the gap between scan lines is stated as a length
MOST_REGIONS = 2  # named in the title


@dataclass(frozen=True, slots=True)
class Card:
    """One answer: its question, the answer in a few words, and the numbers behind it."""

    title: str
    headline: str
    text: str


def title(loaded: LoadedTask) -> str:
    """Return what the scanner is for: the planes that it looks at in metres, or else the name of the task."""
    planes = [region.words() for region in planes_of(loaded)]
    named = planes if len(planes) == sum(region.value > 0 for region in loaded.task.weight) else []
    if 0 < len(named) <= MOST_REGIONS:
        return f"A 3D scanner for {' and '.join(words[:1].lower() + words[1:] for words in named)}"
    return f"A 3D scanner: {loaded.task.name.replace('_', ' ')}"


def cards(
    angles: AngleSet, answer: BuildAnswer, planes: Sequence[PlaneFigures], parts: PartsList | None
) -> tuple[Card, ...]:
    """Return what it sees, the gain over usual mounts, one scan, and what it takes to make it."""
    return _sees(answer, planes), _gain(answer.as_built), _scan(angles, answer), _make(parts)


def motion_in_words(motion: Motion | None) -> str:
    """Return the motion of the axis in one full scan."""
    if motion is None:
        return "the motion is not known"
    if motion.mode == "spin":
        return "one turn at constant speed"
    if motion.mode == "sweep":
        low, high = motion.limits_deg
        return f"from {low:g} to {high:g} deg and back"
    return f"{motion.stops} stops of {motion.dwell_s:g} s in one turn"


def _sees(answer: BuildAnswer, planes: Sequence[PlaneFigures]) -> Card:
    own = answer.as_built.own
    gap_mm = 1000 * GAP_M * np.radians(own.line_gap_deg)
    lines = f"Scan lines at most {own.line_gap_deg:.2f} deg apart, {rounded(gap_mm)} mm at {GAP_M:g} m."
    headline = f"All but {percent(own.blind_weight)} of what you asked for" if own.blind else "All you asked for"
    text = [f"{_capital(figures.words())}." for figures in planes]
    if own.blind:
        text.append(f"{_capital(', '.join(words.partition(':')[0] for words in own.blind))}.")
    elif not planes:
        disc_cm = rounded(200 * DISC_M * np.tan(np.radians(answer.ball_deg)))
        text.append(f"At least {own.least:,} beams on a disc of {disc_cm} cm, {DISC_M:g} m away.")
    return Card("What it sees", headline, " ".join([*text, lines]))


def _gain(built: AsBuilt) -> Card:
    first, *others = (mount.gain for mount in built.mounts)
    unit = "" if first.factor is None else "Beams per direction. "
    better = " It sees more than this scanner." if first.J_less < 0 else ""
    flaws = f" But: {first.flaws}." if first.flaws else ""
    rest = ", ".join(f"{gain.value} {gain.mount.name}" for gain in others)
    text = f"{unit}Best of {len(built.mounts)} usual mounts.{better}{flaws} The others: {rest}."
    return Card("Compared with usual mounts", f"{first.value} {first.mount.name}", text)


def _scan(angles: AngleSet, answer: BuildAnswer) -> Card:
    motion, blocked = angles.motion, answer.as_built.blocked
    beams = f"{answer.lines * answer.beams:,} beams"
    hidden = "" if blocked is None else f" Parts block {percent(blocked)}."
    words = _capital(motion_in_words(motion))
    headline = beams if motion is None else f"{motion.duration_s:g} s, {beams}"
    return Card("One scan", headline, f"{words}: {answer.lines:,} lines of {answer.beams:,}.{hidden}")


def _make(parts: PartsList | None) -> Card:
    if parts is None or parts.total is None:
        return Card("To make it", "Price unknown", "Missing: bom.csv with a total.")
    text = f"{parts.made('printed')} to print, {parts.made('turned', 'sawn')} to have machined, {parts.screws} screws."
    if tools := parts.group("tool"):
        text += f" {count(len(tools.rows), 'tool')}, {tools.usd} of that."
    return Card("To make it", parts.usd, text)


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
