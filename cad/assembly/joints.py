"""Which screws hold the scanner together, read from the solids: where a hole of one part meets another body.

A made part's hole is a screw hole if its diameter is that of a screw with the printer's clearance and both its ends are
open, or if its diameter is one that a screw holds on to (the core of a thread, the seat of an insert, the way into a
trapped nut). What lies behind it on the same axis decides: a thread (the screw's own diameter, or such a hole in a
part), a hole to pass through to a nut, or the spigot that a grub screw clamps; nothing means the robot's deck. Lengths
are the shortest of the standards that hold. Millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cad.assembly.assembly import Assembly
from cad.findings import PartFinding
from cad.geometry.holes import Piercing, Round
from cad.layout.balance.counterweight import SCREW as BAR_SCREW
from cad.layout.balance.counterweight import Counterweight
from cad.layout.belt.stack import PLATE, PLATE_GRIP, PLATE_SCREW, SHELF, BeltStack
from cad.layout.names import ALIGNMENT_LINKAGE, BASE_MOUNT, BEARING_TOWER, COUNTERWEIGHT, DRIVE_PLATE, SERVO_CASE
from cad.screws import SCREWS, Screw, holding_holes, trap_of
from design.catalogue.products import Printer
from design.scanner import Scanner

# ISO 4762 and ISO 4026
LENGTHS = {
    "M2": (3, 4, 5, 6, 8, 10, 12, 16, 20),
    "M2.5": (4, 5, 6, 8, 10, 12, 16, 20, 25),
    "M3": (4, 5, 6, 8, 10, 12, 16, 20, 25, 30),
    "M4": (5, 6, 8, 10, 12, 16, 20, 25, 30, 35, 40),
    "M5": (6, 8, 10, 12, 16, 20, 25, 30, 35, 40),
    "M6": (8, 10, 12, 16, 20, 25, 30, 35, 40),
}
HOLDS = 2.0  # diameters of thread that hold
NUT = 1.0  # diameters: a nut, 0.8, and the thread that looks out
THREAD_FREE = 0.5  # that a screw may not bottom
CASE_EAR = 2.0  # of a servo's case between a screw hole and its nut: assumed, no catalogue gives it
DECK_MM = 5.0  # thickness of the robot's deck, assumed
COAXIAL = 0.05
NEAR = 6.0  # between the hole of a part and what its screw holds: feet stand off, ears are recessed
DRIVER = 60.0  # free length behind the head

Fixing = Literal["thread", "trap", "nut", "deck", "grub"]


@dataclass(frozen=True, slots=True)
class Joint:
    """Equal screws between two bodies.

    Attributes:
        part: the made part that the screws go through.
        onto: the body that they hold it to; empty for the robot's deck.
        fixing: what holds the thread: the body itself, a nut in a trap of the body, a nut, a nut under the deck, or the
            part (grub screws).
        screw: the size.
        length_mm: of the screw's shank.
        count: number of screws.
        grip_mm: what the shank passes before it holds.
        covered: equal holes that no driver reaches, left empty.
        inserts: whether each screw holds in a heat-set insert.
        traps: whether each screw holds in a nut that a part carries.
    """

    part: str
    onto: str
    fixing: Fixing
    screw: Screw
    length_mm: int
    count: int
    grip_mm: float
    covered: int
    inserts: bool
    traps: bool

    @property
    def number(self) -> str:
        """The standard's designation."""
        return f"ISO {4026 if self.fixing == 'grub' else 4762} {self.screw.name} x {self.length_mm}"


def joints_of(scanner: Scanner, assembly: Assembly, rounds: dict[str, list[Round]]) -> list[Joint]:
    """All joints, in the order of the parts.

    Args:
        scanner: angles and products.
        assembly: the solids.
        rounds: of `holes.rounds_of`, for every solid, made or bought.
    """
    printer, printed = scanner.printer, assembly.made.keys() - assembly.metal()
    found: dict[tuple[str, str, Fixing, str, bool], list[tuple[float, float, bool]]] = {}
    for part, solid in assembly.made.items():
        piercing = Piercing(solid)
        for hole in rounds[part]:
            screw, core = _screw_for(hole, printer)
            behind = None if screw is None else _behind(assembly, part, hole, screw, core, rounds, printer)
            if screw is not None and behind is not None:
                covered = behind.head != 0 and not _reachable(hole, behind.head, piercing)
                in_trap = behind.fixing == "trap" or (core and _is_trap(hole, screw, printer))
                key = (part, behind.onto, behind.fixing, screw.name, in_trap)
                found.setdefault(key, []).append((hole.length, behind.depth, covered))
    for part, onto, screw, count, grip, depth in _slotted(scanner, assembly):
        traps = any(hole.hole and _is_trap(hole, screw, printer) for hole in rounds.get(onto, []))
        found[part, onto, "trap" if traps else "thread", screw.name, traps] = [(grip, depth, False)] * count
    if BASE_MOUNT not in assembly.made:
        key = ("deck", SERVO_CASE, "nut", scanner.servo.case_screw, False)
        found[key] = [(DECK_MM, CASE_EAR, False)] * 4
    return [
        _joint(*key, holes, inserts=_has_insert(printer, SCREWS[key[3]], key[2] == "grub" or key[1] in printed))
        for key, holes in found.items()
        if not all(covered for _, _, covered in holes)
    ]


def _slotted(scanner: Scanner, assembly: Assembly) -> list[tuple[str, str, Screw, int, float, float]]:
    """Screws in slots: part, what they end in, size, number, grip and depth of thread."""
    slots, stack, bar = [], assembly.layout.stack, assembly.layout.counterweight
    if isinstance(stack, BeltStack):
        depth = SHELF if trap_of(PLATE_SCREW, scanner.printer) is None else PLATE_GRIP
        slots.append((DRIVE_PLATE, BEARING_TOWER, PLATE_SCREW, 4, PLATE, depth))
    if COUNTERWEIGHT in assembly.made and isinstance(bar, Counterweight):
        grip = bar.ear.high - bar.ear.low
        slots.append((ALIGNMENT_LINKAGE, COUNTERWEIGHT, BAR_SCREW, len(bar.screws), grip, bar.section[1]))
    return slots


def without_traps(printer: Printer, assembly: Assembly, joints: list[Joint]) -> list[PartFinding]:
    """Screws that hold in plain threads although the printer's profile asks for nuts."""
    if printer.thread != "nut":
        return []
    found = []
    for joint in joints:
        holder = joint.part if joint.fixing == "grub" else joint.onto
        if holder in assembly.made.keys() - assembly.metal() and joint.fixing in ("grub", "thread") and not joint.traps:
            message = f"{holder}: no nut trap fits at its {joint.count} {joint.screw.name}: they hold in plain threads"
            found.append(PartFinding("no_nut_trap", "note", holder, message))
    return found


def _has_insert(printer: Printer, screw: Screw, in_a_part: bool) -> bool:
    """Whether a screw holds in a heat-set insert: not every size has one."""
    return printer.thread == "insert" and screw.insert is not None and in_a_part


@dataclass(frozen=True, slots=True)
class _Behind:
    """What a screw holds on to: body, how, depth of its thread, and on which side of the hole the head is (0: none)."""

    onto: str
    fixing: Fixing
    depth: float
    head: int


def _joint(
    part: str,
    onto: str,
    fixing: Fixing,
    name: str,
    traps: bool,
    holes: list[tuple[float, float, bool]],
    *,
    inserts: bool,
) -> Joint:
    """One length for all screws of a joint: that of the thickest place."""
    used = [(grip, depth) for grip, depth, covered in holes if not covered]
    grip, depth = max(grip for grip, _ in used), min(depth for _, depth in used)
    screw = SCREWS[name]
    length = _length(screw, grip, fixing, depth)
    covered = len(holes) - len(used)
    return Joint(part, onto, fixing, screw, length, len(used), round(grip, 2), covered, inserts, traps)


def _behind(
    assembly: Assembly,
    part: str,
    hole: Round,
    screw: Screw,
    core: bool,
    rounds: dict[str, list[Round]],
    printer: Printer,
) -> _Behind | None:
    """What is behind a screw hole; None where the hole is no joint of its own."""
    partner = _partner(part, hole, screw, rounds, printer)
    if core:  # a blind one, or one before another part's hole, is the thread of that part's screw
        if partner is not None or not hole.through or not _ends_in_bore(hole, rounds[part]):
            return None
        return _Behind(_clamped(assembly, part), "grub", 0.0, 0)
    if partner is None:
        return None if assembly.parts[part].turns else _Behind("", "deck", DECK_MM, 0)
    return partner


def _screw_for(hole: Round, printer: Printer) -> tuple[Screw | None, bool]:
    """The screw that goes through a hole, and whether it holds on to the hole itself."""
    if not hole.hole:
        return None, False
    for screw in SCREWS.values():
        passes = abs(hole.diameter - screw.nominal - printer.screw_clearance_mm) < 0.01
        if passes and hole.through:  # a blind one is a recess, such as that for the boss of a horn
            return screw, False
        if any(abs(hole.diameter - size) < 0.01 for size in holding_holes(screw, printer)):
            return screw, True
    return None, False


def _is_trap(hole: Round, screw: Screw, printer: Printer) -> bool:
    """Whether a hole leads a screw into a nut that the part carries."""
    trap = trap_of(screw, printer)
    return trap is not None and abs(hole.diameter - trap.hole) < 0.01


def _partner(part: str, hole: Round, screw: Screw, rounds: dict[str, list[Round]], printer: Printer) -> _Behind | None:
    """The body with a hole in line: a thread before a plain hole, which may be a pocket for heads; the nearer first."""
    direction, low, high = (np.array(v) for v in (hole.direction, hole.low, hole.high))
    best: tuple[tuple[bool, float], _Behind] | None = None
    for name, others in rounds.items():
        if name == part:
            continue
        for other in others:
            start = np.array(other.low)
            if not other.hole or abs(abs(float(direction @ other.direction)) - 1) > 1e-5:
                continue
            aside = start - low
            if float(np.linalg.norm(aside - (aside @ direction) * direction)) > COAXIAL:
                continue
            ends = sorted((float(start @ direction), float(np.array(other.high) @ direction)))
            gaps = (float(low @ direction) - ends[1], ends[0] - float(high @ direction))
            gap = max(gaps)
            if gap > NEAR or abs(gap) > other.length + 0.1:
                continue
            sizes = (screw.nominal, *holding_holes(screw, printer))
            threaded = min(abs(other.diameter - size) for size in sizes) < 0.01
            in_trap = _is_trap(other, screw, printer)
            fixing: Fixing = "trap" if in_trap else "thread" if threaded else "nut"
            head = 1 if gaps[0] > gaps[1] else -1
            behind = _Behind(name, fixing, other.length if threaded else CASE_EAR, head)
            order = (not threaded, round(abs(gap), 3))
            if best is None or order < best[0]:
                best = order, behind
    return None if best is None else best[1]


def _length(screw: Screw, grip: float, fixing: Fixing, depth: float) -> int:
    """Shortest standard length that holds; in a shallow thread the longest that does not bottom."""
    known = LENGTHS[screw.name]
    if fixing == "grub":
        return next((n for n in known if n >= grip - 0.1), known[-1])
    if fixing == "trap":  # the hole ends at the nut, and behind it there is room
        return next((n for n in known if n >= grip + depth + screw.nut_height - 0.1), known[-1])
    if fixing == "thread":
        most = [n for n in known if n <= grip + depth - THREAD_FREE + 1e-6]
        wanted = [n for n in most if n >= grip + HOLDS * screw.nominal]
        return wanted[0] if wanted else max(most, default=known[0])
    return next((n for n in known if n >= grip + depth + NUT * screw.nominal), known[-1])


def _ends_in_bore(hole: Round, own: list[Round]) -> bool:
    """Whether a radial hole opens into a wider one of the same part, whose axis it points to."""
    direction = np.array(hole.direction)
    for other in own:
        if other.hole and other.diameter > 1.5 * hole.diameter and abs(float(direction @ other.direction)) < 1e-5:
            between = np.array(hole.low) - np.array(other.low)
            axis = np.cross(direction, other.direction)
            if abs(float(between @ axis)) < COAXIAL and _along(hole, other):
                return True
    return False


def _along(hole: Round, other: Round) -> bool:
    height = float(np.array(hole.low) @ other.direction)
    ends = (float(np.array(other.low) @ other.direction), float(np.array(other.high) @ other.direction))
    return min(ends) < height < max(ends)


def _clamped(assembly: Assembly, part: str) -> str:
    """What sticks in the bore of a part: the shaft."""
    return next(name for name in assembly.made if name != part and name in assembly.turning_parts())


def _reachable(hole: Round, head: int, piercing: Piercing) -> bool:
    """Whether a straight driver finds the head: nothing of the part itself on the axis behind it."""
    direction = head * np.array(hole.direction)
    start = np.array(hole.high if head > 0 else hole.low)
    return not piercing.between(start - 0.05 * direction, start + DRIVER * direction)
