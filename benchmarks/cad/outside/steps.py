"""The steps of `assembly.md`: their screws, and the bodies that are there in each."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

STEP = re.compile(r"^## \d+\. (.*)$", re.MULTILINE)
SCREWS = re.compile(
    r"\*\*(?P<count>\d+) x (?P<number>.+?)(?P<washer> with washers)? "
    r"(?:from (?P<from>\w+) into (?P<into>\w+)"
    r"|from (?P<lifts>\w+) onto \d+ nuts? [^,]+ in (?P<trap>\w+)"
    r"|through the (?P<foot>foot) into the deck, with .*?"
    r"|through (?P<through>\w+) into (?P<case>\w+), with \d+ nuts? \S+(?: in the slots of the case)?"
    r"|in (?P<grub>\w+), against (?P<against>\w+))"
    r"(?P<insert>, in heat-set inserts|, through [^,]* in its bore)?, (?:[\d.]+ N m|hand-tight|loose)"
    r"(?:, with a long driver \(blade (?:over )?(?P<blade>\d+) mm\))?\.\*\*"
)
SIZE = re.compile(r"ISO (\d+) M([\d.]+) x (\d+)")
DECK = "deck"
DEVICES = (("servo_case", "servo_horn", "servo_output"), ("lidar_",), ("ring_stator", "ring_rotor"))


@dataclass(frozen=True, slots=True)
class WrittenScrews:
    """Equal screws of a step as its text names them.

    Attributes:
        part: that the heads are on; `deck` if they are below it.
        onto: that holds the threads or the nuts.
        holds: `thread`, `insert`, `trap` (a nut in a pocket), `nut` (behind it), or `grub`.
        standard, size_mm, length_mm: of the screw; each screw.
        blade_mm: of the driver, if a key is too short; else 0.
    """

    step: int
    part: str
    onto: str
    holds: str
    count: int
    standard: str
    size_mm: float
    length_mm: float
    washer: bool
    blade_mm: float = 0.0

    @property
    def words(self) -> str:
        """Name it in a line."""
        return f"step {self.step}, {self.count} x M{self.size_mm:g} x {self.length_mm:g} {self.part} to {self.onto}"


@dataclass(frozen=True, slots=True)
class WrittenStep:
    """One step: its title, its screws, and those of no standard."""

    title: str
    screws: tuple[WrittenScrews, ...]
    others: tuple[str, ...]


def steps_of(text: str) -> list[WrittenStep]:
    """Read the steps of an `assembly.md`.

    Raises:
        ValueError: a sentence about screws is not understood.
    """
    pieces = STEP.split(text)[1:]
    if unread := [words for words in re.findall(r"\*\*\d+ x [^*]*\*\*", text) if not SCREWS.fullmatch(words)]:
        raise ValueError(f"assembly.md: not understood: {unread}")
    return [
        _step(number, title, words)
        for number, (title, words) in enumerate(zip(pieces[::2], pieces[1::2], strict=True), start=1)
    ]


def _step(number: int, title: str, words: str) -> WrittenStep:
    screws, others = [], []
    for found in SCREWS.finditer(words):
        if (size := SIZE.fullmatch(found["number"])) is None:
            others.append(found[0])
            continue
        part = found["from"] or found["lifts"] or found["through"] or found["grub"] or "base_mount"
        onto = found["into"] or found["trap"] or found["case"] or found["against"] or DECK
        holds = "thread" if found["into"] else "trap" if found["trap"] else "grub" if found["grub"] else "nut"
        if found["insert"] and holds == "thread":
            holds = "insert"
        standard, diameter, length = size.groups()
        screws.append(
            WrittenScrews(
                number, part, onto, holds, int(found["count"]), standard, float(diameter), float(length),
                bool(found["washer"]), float(found["blade"] or 0.0),
            )
        )  # fmt: skip
    return WrittenStep(title, tuple(screws), tuple(others))


def present(steps: list[WrittenStep], bodies: Collection[str]) -> list[set[str]]:
    """Return the bodies that are together at the end of each step, on the scanner or on the bench.

    A body comes with the first step whose screws name it; one without screws with the first step whose title has a word
    of its name, or with the last one. All bodies of a device come together. What screws or a title name joins what is
    there.
    """
    named = [{name for screw in step.screws for name in (screw.part, screw.onto)} & set(bodies) for step in steps]
    titles = [{word.removesuffix("s") for word in re.findall(r"[a-z]{3,}", step.title.lower())} for step in steps]
    arrives: list[set[str]] = [set() for _ in steps]
    for body in bodies:
        device = next((names for names in DEVICES if body.startswith(names)), (body,))
        group = {name for name in bodies if name.startswith(device)}
        by_screws = [number for number, names in enumerate(named) if names & group]
        by_title = [number for number, words in enumerate(titles) if words & set(body.split("_"))]
        arrives[[*by_screws[:1], *by_title, len(steps) - 1][0]].add(body)
    groups: list[set[str]] = []
    there = []
    for comes, names, words in zip(arrives, named, titles, strict=True):
        titled = {body for group in groups for body in group if words & set(body.split("_"))}
        own = comes | names | (set() if names else titled)
        joined = [group for group in groups if group & own]
        groups = [group for group in groups if group not in joined] + [own.union(*joined)]
        there.append(groups[-1])
    return there
