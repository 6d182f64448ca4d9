"""Content of a drawing: holes that belong together, their call-outs, cylinders, plane faces. mm, rotation frame."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cadquery as cq
import numpy as np

from scanwright.cad.geometry.holes import Round, rounds_of, triple
from scanwright.cad.layout.joints import Joint
from scanwright.cad.parts.part_spec import PartSpec, ToleratedDiameter
from scanwright.design.arrays import Array

IN_LINE_MM = 0.01  # between the axes of two holes, or of a hole and its screw
STRAIGHT = 1e-4  # two directions closer than this are parallel
PLANE_MM2 = 3.0  # smaller faces get no ordinate
SIDE_MM2 = 8.0  # nor do smaller upright ones: flanks of a pulley's teeth, ends of blind holes
SAME_SIZE_MM = 5e-3  # between a fit's diameter and its cylinder's: half of the last printed digit
PLANES = 9  # the largest faces of one direction that get an ordinate: more do not fit


@dataclass(frozen=True, slots=True)
class Pattern:
    """Equal parallel holes, or slots."""

    # all of one diameter, direction and height along it; of slots their width, in their middles
    holes: tuple[Round, ...]
    circle: float  # diameter of the circle that they share at equal steps; 0 if none
    heads: float = 0.0  # diameter of the recesses of their screws' heads; 0 if none
    holds: str = ""  # text of their thread; empty if none
    slot: float = 0.0  # length of slots; 0 if none

    @property
    def direction(self) -> Array:
        """Unit vector along the holes."""
        return np.array(self.holes[0].direction)

    @property
    def centre(self) -> Array:
        """Middle of the holes' lower ends."""
        return np.array([hole.low for hole in self.holes]).mean(axis=0)

    def words(self) -> str:
        """Return the call-out."""
        hole = self.holes[0]
        depth = "THRU" if hole.through else f"x {number(hole.length)} DEEP"
        circle = f" ON Ø{number(self.circle)}" if self.circle else ""
        heads = f", Ø{number(self.heads)} FOR HEADS" if self.heads else ""
        holds = f", {self.holds}" if self.holds else ""
        size = f"SLOT {number(hole.diameter)} x {number(self.slot)}" if self.slot else f"Ø{number(hole.diameter)}"
        return f"{counted(len(self.holes))}{size} {depth}{circle}{heads}{holds}"


def number(value: float) -> str:
    """Return a length or an angle with two decimals at most and no trailing zeros."""
    text = f"{round(value, 2) + 0.0:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def counted(count: int) -> str:
    """Return the count before a call-out if it is more than one."""
    return f"{count}x " if count > 1 else ""


def patterns_of(rounds: list[Round]) -> list[Pattern]:
    """Return the holes off the rotation axis, grouped by diameter, direction and height."""
    groups: dict[tuple[float, ...], list[Round]] = {}
    for hole in _drilled([item for item in rounds if item.hole and not on_axis(item)]):
        direction = np.array(hole.direction)
        height = round(float(np.array(hole.low) @ direction), 1) + 0.0
        key = (hole.diameter, *np.round(direction, 3).tolist(), height, hole.through)
        groups.setdefault(key, []).append(hole)
    return _with_heads([Pattern(tuple(holes), _circle(holes)) for _, holes in sorted(groups.items())])


def slots_of(joints: Sequence[Joint], moved: tuple[float, float, float]) -> list[Pattern]:
    """Return the slots of a part's joints; `moved` is the displacement of the part."""
    slots = []
    for joint in joints:
        if joint.slot_mm is None:
            continue
        width, length = joint.slot_mm
        rounds = []
        for axis in joint.axes:
            start, along = np.array(axis.start) + moved, np.array(axis.along)
            ends = [triple(end) for end in (start, start + joint.grip_mm * along)]
            rounds.append(Round(width, triple(along), ends[0], ends[1], True, True))
        slots.append(Pattern(tuple(rounds), 0.0, slot=length))
    return slots


def _drilled(holes: list[Round]) -> list[Round]:
    """Join holes of one diameter in line, one of them open at both ends: one drill makes them, a slot may part them."""
    out: list[Round] = []
    for hole in holes:
        for i, other in enumerate(out):
            if hole.diameter == other.diameter and hole.through | other.through and _in_line(hole, other):
                ends = sorted(
                    (hole.low, hole.high, other.low, other.high), key=lambda end: float(np.dot(end, hole.direction))
                )
                out[i] = replace(other, low=ends[0], high=ends[-1], through=hole.through and other.through)
                break
        else:
            out.append(hole)
    return out


def with_threads(patterns: list[Pattern], joints: Sequence[Joint], moved: tuple[float, float, float]) -> list[Pattern]:
    """Add thread, insert or nut to the patterns of a part, moved by `moved`, that hold screws of its joints."""
    threaded: list[Pattern] = []
    for pattern in patterns:
        for joint in joints:
            lines = [(np.array(axis.start) + moved, np.array(axis.along)) for axis in joint.axes]
            if all(any(_on_line(hole, *line) for line in lines) for hole in pattern.holes):
                pattern = replace(pattern, holds=_thread(joint))
                break
        threaded.append(pattern)
    return threaded


def _thread(joint: Joint) -> str:
    name, thread = joint.screw.name, joint.thread
    if thread is not None and thread.trap is not None:
        return f"{number(thread.trap.across)} ACROSS FLATS FOR NUT {name}"
    if joint.inserts:
        return f"INSERT {name}"
    return f"TAPPED {name}" if thread is None else f"THREAD {name}"


def _with_heads(patterns: list[Pattern]) -> list[Pattern]:
    """Join wider holes to the screw holes in line with them, as recesses of heads."""
    out: list[Pattern] = []
    for pattern in patterns:  # by diameter, smallest first
        inside = (one for one in out if all(any(_in_line(a, b) for b in one.holes) for a in pattern.holes))
        carrier = next(inside, None)
        hole = pattern.holes[0]
        if carrier is None:
            out.append(pattern)
        elif hole.diameter > carrier.holes[0].diameter:
            wider = max(carrier.heads, hole.diameter)
            out[out.index(carrier)] = replace(carrier, heads=wider)
        elif not hole.through:  # else one drill makes both
            out.append(pattern)
    return sorted(out, key=lambda pattern: -len(pattern.holes))


def _in_line(hole: Round, other: Round) -> bool:
    return _on_line(hole, np.array(other.low), np.array(other.direction))


def _on_line(hole: Round, point: Array, along: Array) -> bool:
    """Return whether a hole lies about the line through a point along a unit vector."""
    aside = np.array(hole.low) - point
    return bool(abs(along @ hole.direction) > 1 - 1e-5 and np.linalg.norm(aside - (aside @ along) * along) < IN_LINE_MM)


def on_axis(item: Round) -> bool:
    """Return whether a cylinder lies about the rotation axis."""
    return abs(item.direction[2]) > 1 - 1e-6 and math.hypot(item.low[0], item.low[1]) < 1e-3


def along_pattern(pattern: Pattern, towards: Array) -> Array:
    """Return the direction of the nearest two holes, so that a rectangle is level."""
    points = [np.array(hole.low) for hole in pattern.holes]
    pairs = [(a, b) for i, a in enumerate(points) for b in points[i + 1 :]]
    a, b = min(pairs, key=lambda pair: round(float(np.linalg.norm(pair[1] - pair[0])), 3))
    side = (b - a) - ((b - a) @ towards) * towards
    side /= np.linalg.norm(side)
    level = np.cross([0.0, 0.0, 1.0], towards)
    turned = [side, np.cross(towards, side), -side, -np.cross(towards, side)]
    return max(turned, key=lambda v: round(float(v @ level), 6))


def _circle(holes: list[Round]) -> float:
    if len(holes) < 3:
        return 0.0
    points = np.array([hole.low for hole in holes])
    centre = points.mean(axis=0)
    arms = points - centre
    radii = np.linalg.norm(arms, axis=1)
    if np.ptp(radii) > 0.01:
        return 0.0
    first = arms[0] / radii[0]
    second = np.cross(holes[0].direction, first)
    turns = np.sort(np.arctan2(arms @ second, arms @ first))
    steps = np.diff([*turns, turns[0] + 2 * math.pi])
    # four on a square get ordinates
    return float(2 * radii.mean()) if np.ptp(steps) < 1e-3 and len(holes) != 4 else 0.0


@dataclass(frozen=True, slots=True)
class Part:
    """Content of the drawing of a part."""

    solid: cq.Solid  # rotation frame, moved so that the axis of its ordinates is x = y = 0
    patterns: list[Pattern]  # its holes off the axis, then its slots
    axial: list[Round]  # its cylinders about that axis
    datum: float  # height of the lowest point
    lidar_axis: Array | None  # z of the lidar that it carries; None for other parts
    fits: tuple[ToleratedDiameter, ...]  # of its cylinders about the axis

    def tolerance(self, item: Round) -> str:
        """Return the text behind the diameter of a cylinder about the axis."""
        fit = next((fit for fit in self.fits if is_of(fit, item)), None)
        return "" if fit is None else f"  {fit.tolerance}"


def part_of(spec: PartSpec, solid: cq.Solid, lidar_axis: Array | None, joints: Sequence[Joint]) -> Part:
    """Read a solid; slots and threads come from its joints, fits from those that one of its cylinders has."""
    away = (-spec.axis[0], -spec.axis[1], 0.0)
    if any(away):
        solid = solid.translate(cq.Vector(*away))
    rounds = rounds_of(solid)
    axial = [item for item in rounds if on_axis(item)]
    fits = tuple(fit for fit in spec.fits if any(is_of(fit, item) for item in axial))
    datum = float(solid.BoundingBox().zmin)
    patterns = with_threads(patterns_of(rounds), [joint for joint in joints if joint.holder == spec.name], away)
    patterns += slots_of([joint for joint in joints if joint.part == spec.name], away)
    return Part(solid, patterns, axial, datum, lidar_axis, fits)


def is_of(fit: ToleratedDiameter, item: Round) -> bool:
    """Return whether a fit belongs to a cylinder."""
    return fit.hole == item.hole and abs(fit.diameter - item.diameter) < SAME_SIZE_MM


def parallel(a: Array, b: Array) -> bool:
    """Return whether two unit vectors are parallel or opposite."""
    return float(np.linalg.norm(np.cross(a, b))) < STRAIGHT


def azimuth_deg(direction: Array) -> float:
    """Return the azimuth of a direction: from +Y, counter-clockwise from above, 0 to 360."""
    return round(math.degrees(math.atan2(-direction[0], direction[1])) % 360, 6) % 360


def planes_across(solid: cq.Solid, normal: Array, least_mm2: float = PLANE_MM2) -> list[float]:
    """Return the positions of the larger plane faces across a direction, the largest first."""
    areas: dict[float, float] = {}
    for face in solid.Faces():
        if face.geomType() == "PLANE" and parallel(np.array(face.normalAt().toTuple()), normal):
            place = round(float(np.array(face.Center().toTuple()) @ normal), 2) + 0.0
            areas[place] = areas.get(place, 0.0) + face.Area()
    places = sorted((place for place in areas if areas[place] >= least_mm2), key=lambda place: (-areas[place], place))
    return places[:PLANES]
