"""Screws found in the solids: their axes, seats, holes, and the thread that holds them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.cad.outside.bodies import Array, StepBody
from benchmarks.cad.outside.steps import WrittenScrews

# ISO 4762: diameter and height of heads; ISO 4032: height of nuts, at most; ISO 7089 and 7093-1: washers
HEADS_MM = {1.6: (3.0, 1.6), 2.0: (3.8, 2.0), 2.5: (4.5, 2.5), 3.0: (5.5, 3.0), 4.0: (7.0, 4.0), 5.0: (8.5, 5.0),
            6.0: (10.0, 6.0), 8.0: (13.0, 8.0)}  # fmt: skip
NUTS_MM = {1.6: 1.3, 2.0: 1.6, 2.5: 2.0, 3.0: 2.4, 4.0: 3.2, 5.0: 4.7, 6.0: 5.2, 8.0: 6.8}
WASHERS_MM = {2.0: 0.3, 2.5: 0.5, 3.0: 0.8, 4.0: 1.0, 5.0: 1.0, 6.0: 1.6}
DECK_MM, EAR_MM = 5.0, 2.0  # `assembly.md` states both as assumed
INSERT_MM = 5.7  # length of the usual insert for M3
STEP_MM = 0.05
BEYOND_MM = 6.0  # that is looked at beyond both ends of a screw
COAXIAL_MM = 0.1
HEXAGON = 1.05  # its corners are further out than its flats by more than this share
NARROW_MM = 5.0  # radius of holes and pockets of screws, at most
LOOSE_MM = 0.6  # a hole for a screw is wider by at most this: ISO 273 coarse up to M5, rounded up
TIGHT_MM = 0.02  # error of the meshes


Free = tuple[Array, Array]  # least and largest radius around an axis


@dataclass(frozen=True, slots=True)
class FoundScrew:
    """A screw in the solids.

    Attributes:
        written: the line of the step.
        seat: the middle of the face under its head [mm].
        along: unit vector from the head to the tip.
        hole_mm: least diameter that the hole in its part leaves free.
        hole_off_mm: of the axis of the round hole in its part; NaN without one, as in a slot.
        thread_off_mm: of the axis of the thread, the pocket or the counterpart; NaN without one.
        held_mm: length of thread in what holds it.
    """

    written: WrittenScrews
    seat: Array
    along: Array
    hole_mm: float
    hole_off_mm: float
    thread_off_mm: float
    held_mm: float

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """The better of two candidates is the lower."""
        return not self.thread_off_mm < COAXIAL_MM, not self.hole_off_mm < COAXIAL_MM, -self.held_mm


def found_screws(written: WrittenScrews, bodies: Mapping[str, StepBody], deck: Array) -> list[FoundScrew]:
    """Return the screws of a line that fit both solids: the best places, at most as many as the line has.

    Args:
        written: the line.
        bodies: the solids; the deck is none of them.
        deck: a point of its face, and its normal towards the scanner, shape (2, 3).
    """
    found = [screw for line in _lines(written, bodies) for screw in _screws_on(written, bodies, deck, *line)]
    kept: list[FoundScrew] = []
    for screw in sorted(found, key=lambda each: each.rank):
        if all(np.linalg.norm(screw.seat - other.seat) > written.size_mm / 2 for other in kept):
            kept.append(screw)
    return kept[: written.count]


def _lines(written: WrittenScrews, bodies: Mapping[str, StepBody]) -> Iterator[tuple[Array, Array, float, float]]:
    """Yield each axis once of the holes of both bodies as wide as the screw or its thread, and the ends to look at."""
    reach = written.length_mm + BEYOND_MM
    seen: list[Array] = []
    for name in (written.part, written.onto):
        for row in bodies[name].cylinders if name in bodies else ():
            if not 0.38 * written.size_mm <= row[6] <= (written.size_mm + LOOSE_MM) / 2 + 1.0:
                continue
            along = row[3:6] * np.sign(row[3:6][np.argmax(np.abs(row[3:6]))])
            ends = sorted((row[:3] + row[7:9, None] * row[3:6]) @ along)
            at = row[:3] - (row[:3] @ along) * along
            line = np.array([*at, *along, round(sum(ends) / 2 / reach)])
            if all(np.abs(line - other).max() > COAXIAL_MM / 2 for other in seen):
                seen.append(line)
                yield at, along, ends[0] - reach, ends[1] + reach


def _screws_on(
    written: WrittenScrews,
    bodies: Mapping[str, StepBody],
    deck: Array,
    at: Array,
    along: Array,
    low: float,
    high: float,
) -> Iterator[FoundScrew]:
    """Yield the best screw of each direction on an axis."""
    t = np.arange(low, high, STEP_MM)
    free = {name: bodies[name].free_radius(at, along, t) for name in (written.part, written.onto) if name in bodies}
    if free:
        yield from _one_way(written, bodies, deck, at, along, t, free)
        back = {name: (least[::-1], most[::-1]) for name, (least, most) in free.items()}
        yield from _one_way(written, bodies, deck, at, -along, -t[::-1], back)


def _one_way(
    written: WrittenScrews, bodies: Mapping[str, StepBody], deck: Array, at: Array, along: Array, t: Array,
    free: Mapping[str, Free],
) -> Iterator[FoundScrew]:  # fmt: skip
    radius = written.size_mm / 2
    part = written.part if written.part in free else written.onto
    least, most = (0.75 * radius, radius) if written.holds == "grub" else (radius, radius + LOOSE_MM / 2)
    found = []
    for start, end in _runs(t, (free[part][0] >= least - TIGHT_MM) & (free[part][0] <= most + TIGHT_MM)):
        place = _held(written, start, end, t, free, deck, at, along)
        if place is None:
            continue
        seat, held = place
        hole = 2 * float(free[part][0][(t >= start) & (t <= end)].min())
        offs = [_offset(bodies[part], at, along, start, end)]
        offs.append(_offset(bodies[written.onto], at, along, start, end + written.length_mm) if written.onto in bodies
                    else 0.0)  # fmt: skip
        found.append(FoundScrew(written, at + seat * along, along, hole, offs[0], offs[1], held))
    yield from sorted(found, key=lambda each: each.rank)[:1]


def _held(
    written: WrittenScrews, start: float, end: float, t: Array, free: Mapping[str, Free], deck: Array,
    at: Array, along: Array,
) -> tuple[float, float] | None:  # fmt: skip
    """Return the place of a screw's seat along its axis, and the length of thread that holds it."""
    radius, nut = written.size_mm / 2, NUTS_MM[written.size_mm]
    if written.holds == "grub":
        meets = free[written.onto][0][(t > end) & (t < end + BEYOND_MM)]
        return (start, min(end - start, written.length_mm)) if (meets == 0.0).any() else None
    face = float((deck[0] - at) @ along)
    if "deck" in (written.part, written.onto):
        if abs(float(deck[1] @ along)) < 0.999 or (deck[1] @ along > 0) != (written.part == "deck"):
            return None
        if written.part == "deck":
            start = face - DECK_MM
    seat = start - (WASHERS_MM[written.size_mm] if written.washer else 0.0)
    tip = seat + written.length_mm
    if written.onto == "deck":
        return (seat, min(nut, tip - face - DECK_MM)) if abs(end - face) < 0.5 else None
    other, widest = free[written.onto]
    if written.holds in ("thread", "insert"):
        low, high = (0.76, 1.03) if written.holds == "thread" else (1.05, 1.6)
        beyond = (t > end - STEP_MM) & (t < tip)
        run = _runs(t, beyond & (other >= low * radius) & (widest <= high * radius + 2 * TIGHT_MM))
        length = sum(b - a for a, b in run)
        return (seat, min(length, INSERT_MM) if written.holds == "insert" else length) if run else None
    beyond = (t > end - STEP_MM) & (t < tip)
    if written.holds == "trap" or written.part == "deck":
        pocket = _runs(t, beyond & (other > 1.4 * radius) & (other < 2.6 * radius) & (widest > HEXAGON * other))
        return (seat, min(nut, tip - pocket[0][0])) if pocket else None
    if not np.isfinite(other[beyond]).any():
        return None
    ear = _runs(t, beyond & (other >= radius - TIGHT_MM) & (other <= radius + LOOSE_MM / 2))
    return seat, min(nut, tip - (ear[0][1] if ear else end + EAR_MM))


def _runs(t: Array, true: npt.NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return the ends of all stretches longer than two steps where something is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(int)))
    runs = [(float(t[a]) - STEP_MM / 2, float(t[b - 1]) + STEP_MM / 2) for a, b in edges.reshape(-1, 2)]
    return [(a, b) for a, b in runs if b - a > 2 * STEP_MM]


def _offset(body: StepBody, at: Array, along: Array, start: float, end: float) -> float:
    """Return the distance from a stretch of a line to the axis of the nearest narrow cylinder beside it, or NaN."""
    rows = body.cylinders
    rows = rows[(np.abs(rows[:, 3:6] @ along) > 0.9999) & (rows[:, 6] < NARROW_MM)]
    ends = (rows[:, None, :3] + rows[:, 7:9, None] * rows[:, None, 3:6] - at) @ along
    rows = rows[(ends.min(axis=1) < end) & (ends.max(axis=1) > start)]
    across = rows[:, :3] - at
    far = np.linalg.norm(across - np.outer(across @ along, along), axis=1)
    return float(far.min()) if len(far) and far.min() < NARROW_MM else float("nan")
