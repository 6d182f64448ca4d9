"""The first screen of the report: title and four cards; what to do next, in order. All from records of the build."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.design.angles import AngleSet
from scanwright.design.evaluation.as_built import AsBuilt
from scanwright.design.evaluation.metres import planes_of, rounded
from scanwright.design.findings import Finding
from scanwright.design.motion import Motion
from scanwright.design.objective.holes import NO_BLIND_WEIGHT, percent
from scanwright.design.search.mounts.gain import AS_GOOD
from scanwright.design.task.task import LoadedTask
from scanwright.report.answer import BuildAnswer
from scanwright.report.parts_list import PartsList

DISC_M = 3.0  # distance at which a neighbourhood of directions is stated as a disc
GAP_M = 10.0  # distance at which the gap between scan lines is stated as a length
MOST_REGIONS = 2  # named in the title


@dataclass(frozen=True, slots=True)
class Card:
    """One answer: its question, the answer in a few words, and the numbers behind it."""

    title: str
    headline: str
    text: str


@dataclass(frozen=True, slots=True)
class ToDo:
    """One thing to do."""

    title: str
    text: str
    files: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()


def title(loaded: LoadedTask) -> str:
    """Return what the scanner is for: the planes that it looks at in metres, or else the name of the task."""
    planes = [region.words() for region in planes_of(loaded)]
    named = planes if len(planes) == sum(region.value > 0 for region in loaded.task.weight) else []
    if 0 < len(named) <= MOST_REGIONS:
        return f"A 3D scanner for {' and '.join(words[:1].lower() + words[1:] for words in named)}"
    return f"A 3D scanner: {loaded.task.name.replace('_', ' ')}"


def cards(angles: AngleSet, answer: BuildAnswer, parts: PartsList | None) -> tuple[Card, ...]:
    """Return what it sees, the gain over usual mounts, one scan, and what it takes to make it."""
    return _sees(answer), _gain(answer.as_built), _scan(angles, answer), _make(parts)


def to_do(files: Collection[str], findings: Sequence[Finding], parts: PartsList | None) -> list[ToDo]:
    """Return what to do in order, from the names of the files of the build, its checks and its parts."""
    todo = _before_making(findings)
    if parts is not None:
        text = f"{_capital(' and '.join(parts.bought.values()) or 'devices')} first: they decide the delivery date."
        todo.append(ToDo("Order devices, screws and wiring", text, ("#parts", "bom.csv")))
    if "print/fit_coupon.3mf" in files:
        text = "It shows which clearance your printer needs. Write the result into the printer's catalogue file."
        todo.append(ToDo("Print the fit coupon", text, ("print/fit_coupon.3mf",)))
    if "template.pdf" in files:
        text = (
            "Print template.pdf at 100 %, measure its 100 mm scale, and lay it on each device: do the screws meet the "
            "holes? Then try the test plate on lidar and servo."
        )
        plates = tuple(name for name in ("template.pdf", "print/test_plate.3mf") if name in files)
        todo.append(ToDo("Try the hole patterns on your devices", text, plates))
    machined = parts.group("turned") if parts is not None else None
    if machined is not None:
        sheets = tuple(f"drawings/{row['part']}.pdf" for row in machined.rows)
        text = f"Send the drawings to a workshop. It costs about {machined.usd}."
        todo.append(ToDo(f"Have {count(len(sheets), 'part')} machined", text, sheets))
    if plates := tuple(sorted(name for name in files if name.startswith("print/plate_") and name.endswith(".3mf"))):
        text = "The files set layers and lines in PrusaSlicer; set them yourself in other slicers."
        if parts is not None and parts.printing:
            text = f"{_capital(parts.printing)}. {text}"
        todo.append(ToDo(f"Print {count(len(plates), 'plate')}", text, plates))
    if "assembly.md" in files:
        text = "Follow the pictures: each step ends with a check."
        todo.append(ToDo("Assemble and wire", text, ("#assembly", "#wiring")))
    return todo


def count(number: int, what: str) -> str:
    """Return a number of things."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


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


def _sees(answer: BuildAnswer) -> Card:
    own, cloud = answer.as_built.own, answer.cloud
    gap_mm = 1000 * GAP_M * np.radians(own.line_gap_deg)
    lines = f"Scan lines at most {own.line_gap_deg:.2f} deg apart, {rounded(gap_mm)} mm at {GAP_M:g} m."
    unseen = own.blind_weight > NO_BLIND_WEIGHT
    headline = f"{percent(own.blind_weight)} of what you asked for is never seen" if unseen else "All you asked for"
    lost = [each.message for each in cloud.hidden_regions if each.severity == "warning"]
    if not unseen:
        lost += [each.message for each in cloud.empty_areas]
    if lost:
        headline = _capital(lost[0])
    elif cloud.hidden_regions:
        headline += ", except behind the robot"
    warned = [each.message for each in cloud.hidden_regions if each.message not in lost[:1]]
    if cloud.missed_object is not None:
        headline += ", but small objects can be missed" if not lost else ""
        warned, lines = [cloud.missed_object.message.partition(":")[0], *warned], ""
    elif cloud.wide_gap is not None:
        headline += ", but with a gap" if not lost else ""
        warned, lines = [cloud.wide_gap.message.partition(";")[0], *warned], ""
    text = [f"{_capital(words)}." for words in (*warned, *(plane.words() for plane in cloud.planes))]
    if own.blind:
        text.append(f"{_capital(', '.join(words.partition(':')[0] for words in own.blind))}.")
    elif not cloud.planes:
        disc_cm = rounded(200 * DISC_M * np.tan(np.radians(answer.ball_deg)))
        text.append(f"At least {own.least:,} beams on a disc of {disc_cm} cm, {DISC_M:g} m away.")
    return Card("What it sees", headline, " ".join([*text, lines]).rstrip())


def _gain(built: AsBuilt) -> Card:
    first, *others = (mount.gain for mount in built.mounts)
    unit = "" if first.factor is None else "Beams per direction. "
    better = ""
    if first.factor is not None and first.factor < 2 - AS_GOOD:
        better = f": {1 / first.factor:.2f} times the beams of this scanner"
    flaws = f" But: {first.flaws}." if first.flaws else ""
    rest = ", ".join(f"{gain.value} {gain.mount.name}" for gain in others)
    text = f"{unit}Best of {len(built.mounts)} mounts without parts{better}.{flaws} The others: {rest}."
    return Card("Compared with usual mounts", f"{first.value} {first.mount.name}", text)


def _scan(angles: AngleSet, answer: BuildAnswer) -> Card:
    motion, blocked = angles.motion, answer.as_built.blocked
    beams = f"{answer.lines * answer.beams:,} beams"
    hidden = f" Parts block {percent(blocked)}." if blocked else ""
    words = _capital(motion_in_words(motion))
    headline = beams if motion is None else f"{motion.duration_s:g} s, {beams}"
    error = _capital(answer.cloud.expected_error.words().partition(" (")[0])  # its parts are among the details
    return Card("One scan", headline, f"{error}. {words}: {answer.lines:,} lines of {answer.beams:,}.{hidden}")


def _make(parts: PartsList | None) -> Card:
    if parts is None or parts.total is None:
        return Card("To make it", "Price unknown", "Missing: bom.csv with a total.")
    text = f"{parts.made_words}, {parts.screws} screws."
    return Card("To make it", parts.usd, text)


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def _before_making(findings: Sequence[Finding]) -> list[ToDo]:
    """Return what to do before any part is made: failed checks, values to measure."""
    todo = []
    if failed := [finding for finding in findings if finding.severity == "error"]:
        text = "Change the task until no check fails: each check states what to change."
        todo.append(ToDo(f"Fix {count(len(failed), 'failed check')}", text, ("#checks", "task.toml")))
    for finding in findings:
        if finding.code == "deck_height" and finding.severity == "warning":
            todo.append(
                ToDo("Correct the scanner's height in the task", f"{_capital(finding.message)}.", ("task.toml",))
            )
    how = (
        "Copy the device's file next to your own task file: scanwright catalogue NAME -v prints its path. Change the "
        'values, write catalogue = ["COPY.toml"] at the top of your task file (not of the task.toml in this folder, '
        "which the next build replaces), and build again."
    )
    if unverified := tuple(each for each in findings if each.code == "unverified"):
        text = (
            "These values are not from a drawing. A wrong one makes a part that does not fit. Measure devices that you "
            f"still have to order when they arrive, before you print parts. {how}"
        )
        todo.append(ToDo(f"Measure {count(len(unverified), 'value')}", text, ("#checks",), unverified))
    return todo
