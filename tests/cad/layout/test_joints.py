"""The declared joints are those of the solids: each is read back from the holes of the parts, which know no joints.

A made part's hole is a screw hole if its diameter is that of a screw with the printer's clearance and both its ends are
open, or if its diameter is one that a screw holds on to (the core of a thread, the seat of an insert, the way into a
trapped nut). What lies behind it on the same axis decides: a thread (the screw's own diameter, or such a hole in a
part), a hole to pass through to a nut, or the spigot that a grub screw clamps; nothing means the robot's deck. Slots
are read from the half cylinders of their ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from OCP.BRepAdaptor import BRepAdaptor_Surface
from quick_tests import samples
from scanners import CAPSULE, GROUND_AHEAD, ROLLING, TILTED, UPRIGHT, scanner_at

from scanwright.cad.geometry.holes import Piercing, rounds_of
from scanwright.cad.layout.joints import DECK_MM, shank_mm
from scanwright.cad.parts.all_parts import laid_out
from scanwright.cad.screws import SCREWS, thread_in_part, trap_of
from scanwright.design.catalogue.holes import CASE_EAR_MM
from scanwright.design.deck_holes import Rectangle
from scanwright.design.scanner import Modules

COAXIAL = 0.05
LOOSE = 0.1  # the kernel bounds a face whose end is cut by bore and flat no better
NEAR = 6.0  # between the hole of a part and what its screw holds: feet stand off, ears are recessed
DRIVER = 60.0  # free length behind the head


@dataclass(frozen=True)
class Behind:
    """What a screw holds on to: body, how, depth of its thread, on which side of the hole the head is (0: none)."""

    onto: str
    fixing: str
    depth: float
    head: int


def read_joints(scanner, assembly):
    """By part and what it is held to: fixing, screw, trap, and of each hole its axis, length, depth behind and head."""
    printer, found = scanner.printer, {}
    rounds = {name: rounds_of(solid) for name, solid in (assembly.made | assembly.bought).items()}
    for part, solid in assembly.made.items():
        piercing = Piercing(solid)
        for hole in rounds[part]:
            screw, core = screw_for(hole, printer)
            behind = None if screw is None else what_is_behind(assembly, part, hole, screw, core, rounds, printer)
            if behind is not None:
                assert behind.head == 0 or is_reachable(hole, behind.head, piercing), (part, behind)
                in_trap = behind.fixing == "trap" or (core and is_trap(hole, screw, printer))
                key = part, behind.onto
                kind, holes = found.setdefault(key, ((behind.fixing, screw.name, in_trap), []))
                assert kind == (behind.fixing, screw.name, in_trap), key
                holes.append((hole, behind))
    return found


def what_is_behind(assembly, part, hole, screw, core, rounds, printer):
    """None where the hole is no joint of its own."""
    partner = partner_of(part, hole, screw, rounds, printer)
    if core:  # a blind one, or one before another part's hole, is the thread of that part's screw
        if partner is not None or not hole.through or not ends_in_bore(hole, rounds[part]):
            return None
        shaft = next(name for name in assembly.made if name != part and name in assembly.parts_in("rot"))
        return Behind(shaft, "grub", 0.0, 0)
    if partner is None:
        layout = assembly.layout
        from_below = layout.deck.flat and part == layout.drive.mounted.onto  # by screws of the deck
        return None if assembly.parts[part].turns or from_below else Behind("deck", "deck", DECK_MM, 0)
    if partner.onto == "servo_horn":  # drawn as a disc: its threads go on into what is behind
        return replace(partner, depth=assembly.layout.scanner.servo.horn_thread_depth_mm)
    return partner


def screw_for(hole, printer):
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


def holding_holes(screw, printer):
    """Diameters of all holes in parts that a screw may hold on to."""
    return screw.core, thread_in_part(screw, printer, carries=True).hole


def is_trap(hole, screw, printer):
    """Whether a hole leads a screw into a nut that the part carries."""
    trap = trap_of(screw, printer, carries=True)
    return trap is not None and abs(hole.diameter - trap.hole) < 0.01


def partner_of(part, hole, screw, rounds, printer):
    """The body with a hole in line: a thread before a plain hole, which may be a pocket for heads; the nearer first."""
    direction, low, high = (np.array(v) for v in (hole.direction, hole.low, hole.high))
    best = None
    for name, others in rounds.items():
        for other in others if name != part else ():
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
            fixing = "trap" if is_trap(other, screw, printer) else "thread" if threaded else "nut"
            depth = CASE_EAR_MM if fixing == "nut" and name == "servo_case" else free_length(other, others, screw, low)
            order = (not threaded and name != "lidar_body", round(abs(gap), 3))  # the linkage has holes for drivers
            if best is None or order < best[0]:
                best = order, Behind(name, fixing, depth, 1 if gaps[0] > gaps[1] else -1)
    return None if best is None else best[1]


def free_length(hole, own, screw, towards):
    """Of a hole from its end nearer to a point: all of it, or what is left before the screw of one that crosses it."""
    direction, near = np.array(hole.direction), min(hole.low, hole.high, key=lambda end: np.linalg.norm(end - towards))
    lengths = [hole.length]
    for other in own:
        if other is not hole and other.hole and other.diameter == hole.diameter:
            line, between = np.array(other.direction), np.array(other.low) - near
            if abs(float(line @ direction)) < 1e-5 and abs(float(between @ np.cross(direction, line))) < COAXIAL:
                lengths.append(abs(float(between @ direction)) - screw.nominal / 2 - 0.2)
    return min(lengths)


def ends_in_bore(hole, own):
    """Whether a radial hole opens into a wider one of the same part, whose axis it points to."""
    direction = np.array(hole.direction)
    for other in own:
        if other.hole and other.diameter > 1.5 * hole.diameter and abs(float(direction @ other.direction)) < 1e-5:
            between = np.array(hole.low) - np.array(other.low)
            axis = np.cross(direction, other.direction)
            height = float(np.array(hole.low) @ other.direction)
            ends = (float(np.array(other.low) @ other.direction), float(np.array(other.high) @ other.direction))
            if abs(float(between @ axis)) < COAXIAL and min(ends) < height < max(ends):
                return True
    return False


def is_reachable(hole, head, piercing):
    """Whether a straight driver finds the head: nothing of the part itself on the axis behind it."""
    direction = head * np.array(hole.direction)
    start = np.array(hole.high if head > 0 else hole.low)
    return not piercing.between(start - 0.05 * direction, start + DRIVER * direction)


FOOT = Modules(tripod_foot=True)
SETTINGS = {
    "tilted, with a bearing": scanner_at(GROUND_AHEAD),
    "as it ships": scanner_at(GROUND_AHEAD, friction_nm=(0.16, 0.2)),
    "tilted, nuts": scanner_at(TILTED, printer="fdm-0.4-nut"),
    "tilted, inserts": scanner_at(TILTED, printer="fdm-0.4-insert"),
    "hanging, inserts": scanner_at((180, 20, 30, -45), printer="fdm-0.4-insert"),
    "upright on the deck": scanner_at(UPRIGHT),
    "upright, a sub-plate": scanner_at((0, 0, 25.5, -21.4), sensor="URG-04LX"),
    "a sub-plate in nuts": scanner_at((40, 0, 21, -21), printer="fdm-0.4-nut"),
    "small, without a ring": scanner_at((0, 40, -20, -70), slip_ring=None, sensor="URG-04LX", servo="AX-12A"),
    "printed throughout, inserts": scanner_at(
        (0, 0, 0, 50), slip_ring=None, sensor="STL27L", servo="XL430-W250", printer="fdm-0.4-insert"
    ),
    "a tripod": scanner_at(GROUND_AHEAD, modules=FOOT),
    "a belt on a tripod, nuts M5": replace(
        scanner_at(ROLLING, slip_ring=CAPSULE, printer="fdm-0.4-nut", modules=FOOT),
        deck=Rectangle(shape="rectangle", size_mm=(90, 90), screw="M5"),
    ),
    "a belt": scanner_at(ROLLING, slip_ring=CAPSULE),
    "a belt, nuts": scanner_at((60, 20, 10, 60), slip_ring=CAPSULE, printer="fdm-0.4-nut"),
}
DAILY = (  # every way to hold something, and every part that takes a screw, once
    "tilted, nuts",
    "upright on the deck",
    "upright, a sub-plate",
    "small, without a ring",
    "printed throughout, inserts",
    "a tripod",
    "a belt",
)


@pytest.mark.parametrize("name", samples(SETTINGS, DAILY))
def test_the_declared_joints_are_those_that_the_solids_have(name, parts_of):
    scanner = SETTINGS[name]
    assembly = parts_of(scanner)
    read, declared = read_joints(scanner, assembly), {(j.part, j.onto): j for j in assembly.layout.joints}
    assert {
        key for key, joint in declared.items() if joint.slot_mm is None and key[0] not in ("deck", "tripod")
    } == read.keys()
    for key, ((fixing, screw, trap), holes) in read.items():
        joint = declared[key]
        assert (joint.fixing, joint.screw.name, joint.count, joint.traps) == (fixing, screw, len(holes), trap), key
        washer = 0.0 if joint.washer_mm is None else assembly.layout.stack.cross_screw.washer_thick
        # of a tilted part the kernel knows it to a nanometre
        grip = round(washer + max(hole.length for hole, _ in holes), 3)
        depth = joint.thread_mm if fixing == "grub" else min(behind.depth for _, behind in holes)
        assert joint.length_mm == shank_mm(joint.screw, grip, fixing, depth), (key, grip, depth)
        assert joint.grip_mm == pytest.approx(grip, abs=LOOSE if key[1].endswith("shaft") else 0.02), key
        for axis in joint.axes:
            (hole,) = [hole for hole, _ in holes if _is_on(axis, hole) and _begins(axis, hole)]
            ends = [float((np.array(end) - axis.start) @ axis.along) for end in (hole.low, hole.high)]
            assert min(ends) == pytest.approx(washer, abs=0.02), (key, ends)  # it starts where the head bears
            assert max(ends) == pytest.approx(washer + hole.length, abs=0.02), (key, ends)


def _is_on(axis, hole):
    aside = np.array(hole.low) - axis.start
    off = np.linalg.norm(aside - (aside @ np.array(axis.along)) * np.array(axis.along))
    return off < 0.01 and abs(abs(np.array(axis.along) @ hole.direction) - 1) < 1e-6


def _begins(axis, hole):
    """Whether a hole has an end near the start of a screw: two that face each other are on one line."""
    return min(np.linalg.norm(np.array(end) - axis.start) for end in (hole.low, hole.high)) < hole.length / 2 + LOOSE


def half_cylinders(solid, radius, along):
    """Points on the axes of faces of half a turn along a direction."""
    surfaces = [BRepAdaptor_Surface(face.wrapped) for face in solid.Faces() if face.geomType() == "CYLINDER"]
    halves = [s for s in surfaces if abs(s.LastUParameter() - s.FirstUParameter() - np.pi) < 1e-3]
    axes = [half.Cylinder().Axis() for half in halves if abs(half.Cylinder().Radius() - radius) < 1e-6]
    return [
        np.array(axis.Location().Coord()) for axis in axes if abs(np.dot(axis.Direction().Coord(), along)) > 1 - 1e-9
    ]


SLOTTED = {
    "a belt": {("drive_plate", "bearing_tower"), ("alignment_linkage", "counterweight")},
    "small, without a ring": {("alignment_linkage", "counterweight")},
}


@pytest.mark.parametrize("setting", SLOTTED)
def test_screws_in_slots_stand_in_the_middle_of_them(parts_of, setting):
    assembly = parts_of(SETTINGS[setting])
    slotted = {(joint.part, joint.onto): joint for joint in assembly.layout.joints if joint.slot_mm}
    assert slotted.keys() == SLOTTED[setting]
    for (part, onto), joint in slotted.items():
        width, length = joint.slot_mm
        along = np.array(joint.axes[0].along)
        ends = [end - (end @ along) * along for end in half_cylinders(assembly.made[part], width / 2, along)]
        assert len(ends) == 2 * joint.count
        for axis in joint.axes:
            start = axis.start - (axis.start @ along) * along
            one, other = sorted(ends, key=lambda end, start=start: np.linalg.norm(end - start))[:2]
            np.testing.assert_allclose((one + other) / 2, start, atol=1e-6)
            assert np.linalg.norm(one - other) == pytest.approx(length - width, abs=1e-6)
        if onto not in assembly.made:
            continue
        threads = [hole for hole in rounds_of(assembly.made[onto]) if abs(hole.diameter - joint.screw.core) < 0.01]
        assert joint.count == len([axis for axis in joint.axes for hole in threads if _is_on(axis, hole)])


def test_a_screw_that_moves_is_noticed(parts_of):
    """The reading sees a hole that is not where the joint says: the servo's shaft of another scanner."""
    scanner = SETTINGS["upright on the deck"]
    assembly = parts_of(scanner)
    turned = scanner.servo.model_copy(update={"horn_first_hole_deg": 10.0})
    moved = laid_out(replace(scanner, servo=turned))
    joint = next(joint for joint in moved.joints if joint.onto == "servo_horn")
    _, holes = read_joints(scanner, assembly)["servo_shaft", "servo_horn"]
    assert not any(_is_on(axis, hole) for axis in joint.axes for hole, _ in holes)
