"""Bearing cage: holds a thin-section bearing around the hub's journal where the axis is tilted too far for the horn.

Frame: rotation frame at gamma = 0 (`cad/layout/direct_stack.py`), mm. Two parts, since the cage must come down over
the ring:

    cage_base     thick plate on the ears of the servo's front, with a boss that centres the cage; with a ring it is
                  the plate of `slip_ring_adapter`
    bearing_cage  a bell around ring and adapter: legs between windows, a roof of 45 deg, the bearing's seat

Put together: shaft, base, ring and its tie, bell with the bearing, linkage; the four radial screws of the bell last, so
that the bearing finds the journal. The bearing floats between lip and hub: along the axis the horn carries alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cadquery as cq
import numpy as np

from cad import solids
from cad.layout.direct_stack import CAGE_LIP, CAGE_SEAT_WALL, WINDOWS_REACH, Stack
from cad.screws import SCREWS, Screw, Trap, thread_hole, trap_of
from cad.solids import building, checked
from design.catalogue.products import Bearing, Servo
from design.errors import BuildError
from design.scanner import Scanner

PART = "bearing_cage"
BASE = "cage_base"
BASE_HEIGHT = 12.0
RING_ABOVE_BASE = 1.5
SEAT_GAP = 0.2  # the feet carry, not the plate
FOOT_RADIUS = 3.0
UNDER_HEAD = 3.0  # of the plate
HEAD_WALL = 2.0  # beside the recess of a head
CAGE_SCREW = SCREWS["M3"]
SCREW_DEPTH = 10.0  # of a radial screw in the boss
UNDER_CAGE_HEAD = 3.5  # of a leg
TRAP_WALL = 3.0  # of the boss outside a nut
WINDOW_HALF_WIDTH = 11.5  # the adapter's arms stand in the windows at +-x, the ring's wires leave at +-y
PLASTIC_PA = 2.3e9  # modulus of solid PLA, the softest of what the printers make
POISSON = 0.35
ROOM = 0.7  # between the bell's foot and what stands beside it


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingCage:
    """Lengths in mm, azimuths in rad; the servo's x and y are those of the rotation frame."""

    stack: Stack
    bearing: Bearing
    front: float  # z of the case's front
    ears: float  # z of the planes around the front holes
    opening: float  # radius, around the horn flange
    half_x: float
    screw: Screw
    hole: float  # diameter
    holes: tuple[tuple[float, float], ...]
    cage_hole: float  # diameter, in the legs
    cage_thread: float  # diameter, in the boss
    trap: Trap | None  # of the radial screws, if they hold in nuts
    legs: tuple[float, ...]  # azimuths of the bell's radial screws
    fit: float  # diametral clearance of a sliding fit

    @property
    def low(self) -> float:
        """Height of the base's lower face."""
        return self.front + SEAT_GAP

    @property
    def high(self) -> float:
        """Height of the boss, and of the whole base."""
        return _boss_top(self.stack, self.low)

    @property
    def foot(self) -> float:
        """Height of the flange that the bell stands on."""
        return (self.low + self.high) / 2


def cage_of(scanner: Scanner, stack: Stack) -> BearingCage | None:
    """Parameters of the cage of one scanner; None where the horn carries the rotor alone.

    Raises:
        BuildError: the case has no four holes beside the turning flange.
    """
    if stack.bearing is None:
        return None
    servo, printer = scanner.servo, scanner.printer
    screw = SCREWS[servo.case_screw]
    hole = screw.nominal + printer.screw_clearance_mm
    opening = stack.flange_radius + 1.0
    least = opening + hole / 2 + printer.min_wall_mm
    free = [(x, y) for x, y in servo.case_holes_mm if math.hypot(x, y) >= least]
    widest = max((x for x, _ in free), default=0.0)
    holes = tuple(sorted((x, y) for x, y in free if abs(x) == widest))
    if len(holes) < 4:
        raise BuildError(
            f"{BASE}: ears: case_holes_mm = {list(servo.case_holes_mm)}: {servo.name} needs two pairs of front holes "
            f"at least {least:.2f} mm from the axis, outside the turning flange"
        )
    trap = trap_of(CAGE_SCREW, printer)
    if trap is not None and not has_room(
        trap, stack, stack.horn + servo.case_max_mm[2] + SEAT_GAP, printer.min_wall_mm
    ):
        trap = None
    return BearingCage(
        stack=stack,
        bearing=stack.bearing,
        front=stack.horn + servo.case_max_mm[2],
        ears=stack.horn + servo.case_holes_z_mm,
        opening=opening,
        half_x=plate_half_x(servo, screw),
        screw=screw,
        hole=hole,
        holes=holes,
        cage_hole=CAGE_SCREW.nominal + printer.screw_clearance_mm,
        cage_thread=thread_hole(CAGE_SCREW, printer) if trap is None else trap.hole,
        trap=trap,
        legs=tuple(_leg_screw(middle, holes, stack.cage_inner) for middle in (45.0, 135.0, 225.0, 315.0)),
        fit=printer.fit_clearance_mm,
    )


def plate_half_x(servo: Servo, screw: Screw) -> float:
    """Half width of a plate on the servo's front: that of the case, or what the heads of the ears' screws need."""
    return max(servo.case_max_mm[0], max(x for x, _ in servo.case_holes_mm) + screw.head_room + HEAD_WALL)


def bearing_cage(p: BearingCage) -> cq.Solid:
    """Make the bell.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    size = f"{p.bearing.outer_mm:g}"
    with building(PART, "bell", "outer_mm", size):
        seat = p.bearing.outer_mm / 2 + p.fit / 4
        lip = p.bearing.outer_mm / 2 - CAGE_LIP
        rim = p.bearing.outer_mm / 2 + CAGE_SEAT_WALL
        roof = stack.cage_roof
        profile = [
            (stack.cage_outer, p.foot),
            (stack.cage_outer, roof),
            (rim, roof + stack.cage_outer - rim),
            (rim, stack.cage_top),
            (seat, stack.cage_top),
            (seat, stack.cage_seat),
            (lip, stack.cage_seat),
            (lip, stack.cage_seat - CAGE_LIP),
            (stack.cage_inner, roof),
            (stack.cage_inner, p.foot),
        ]
        body: cq.Shape = checked(solids.lathe(profile), PART, "bell", "outer_mm", size)
    with building(PART, "windows and screw holes", "outer_mm", size):
        cuts = _windows(p) if stack.ring_length > 0 else []
        for azimuth in p.legs:
            out = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
            centre = np.array([0.0, 0.0, (p.foot + p.high) / 2])
            cuts.append(solids.cylinder(p.cage_hole / 2, centre, out, 80.0))
            head = centre + (stack.cage_inner + UNDER_CAGE_HEAD) * out
            cuts.append(solids.cylinder(CAGE_SCREW.head_room, head, out, 80.0))
        return checked(body.cut(*cuts).clean(), PART, "windows and screw holes", "outer_mm", size)


def cage_base(p: BearingCage) -> cq.Solid:
    """Make the plate on the servo.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    last = min(y for _, y in p.holes) - FOOT_RADIUS - 1.5
    with building(BASE, "plate and boss", "case_holes_mm", p.holes):
        reaches_out = -last > stack.cage_outer + ROOM + 2 * FOOT_RADIUS
        tail = solids.box((-p.half_x, last, p.low), (p.half_x, 0.0, p.high if reaches_out else p.foot))
        around = solids.upright(stack.cage_outer + ROOM, p.foot, p.high + 1.0)
        boss = solids.upright(stack.cage_inner - p.fit / 2, p.low, p.high)
        body = solids.upright(stack.cage_outer, p.low, p.foot).fuse(tail).cut(around).fuse(boss)
        body = body.cut(solids.upright(p.opening, p.low - 1.0, p.high + 1.0))
        body = checked(body, BASE, "plate and boss", "case_holes_mm", p.holes)
    with building(BASE, "feet and screw holes", "case_holes_mm", p.holes):
        feet = [solids.upright(FOOT_RADIUS, p.ears, p.low + 1.0, x, y) for x, y in p.holes]
        body = body.fuse(*feet)
        cuts: list[cq.Shape] = [solids.upright(p.opening, p.front, p.high + 1.0)]
        for x, y in p.holes:
            cuts.append(solids.upright(p.hole / 2, p.ears - 1.0, p.high + 1.0, x, y))
            cuts.append(_head_room(p, x, y))
        for azimuth in p.legs:
            out = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
            start = (stack.cage_inner - SCREW_DEPTH) * out + [0.0, 0.0, (p.foot + p.high) / 2]
            cuts.append(solids.cylinder(p.cage_thread / 2, start, out, SCREW_DEPTH + 1.0))
            if p.trap is not None:
                cuts.append(_slot(p, p.trap, azimuth))
        return checked(body.cut(*cuts).clean(), BASE, "feet and screw holes", "case_holes_mm", p.holes)


def _boss_top(stack: Stack, low: float) -> float:
    return min(low + BASE_HEIGHT, stack.ring_bottom - RING_ABOVE_BASE)


def has_room(trap: Trap, stack: Stack, low: float, wall: float) -> bool:
    """Whether a nut in the boss has a floor below it and does not reach the ring above."""
    quarter = (_boss_top(stack, low) - low) / 4
    return 3 * quarter - trap.corner >= wall and trap.corner <= quarter + RING_ABOVE_BASE / 2


def _slot(p: BearingCage, trap: Trap, azimuth: float) -> cq.Solid:
    """Slot in the boss that a nut is dropped into from above, before the ring and the bell come."""
    middle, half = (p.foot + p.high) / 2, trap.across / 2
    outer = p.stack.cage_inner - p.fit / 2 - TRAP_WALL
    slot = solids.box((outer - trap.depth, -half, middle - trap.corner), (outer, half, p.high + 1.0))
    return slot.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(azimuth))


def stiffness_n_per_m(p: BearingCage) -> float:
    """Sideways stiffness at the bearing, of legs (shear, bending, rocking) and base by beam formulas, halved.

    Screws and plates are stiffer or softer than beams: taken for right within a factor of two.
    """
    stack, E = p.stack, PLASTIC_PA * 1e-6  # N/mm2
    G = E / (2 + 2 * POISSON)
    radius, wall = (stack.cage_inner + stack.cage_outer) / 2, stack.cage_outer - stack.cage_inner
    half_window = math.asin(WINDOW_HALF_WIDTH / stack.cage_inner) if stack.ring_length > 0 else 0.0
    width = radius * (math.pi / 2 - 2 * half_window)
    length, lever = stack.cage_roof - p.foot, stack.bearing_middle - p.foot
    # four legs at 45 deg: two of them bend and shear across their width, all four stretch
    bending = length**3 / (2 * E * wall * width**3)
    shear = length / (2 * 5 / 6 * G * wall * width)
    rocking = (lever - length / 2) ** 2 * length / (4 * E * wall * width * radius**2 / 2)
    reach, span = radius * math.sqrt(0.5), 2 * radius * math.sqrt(0.5)
    beyond = reach - max(y for _, y in p.holes)
    second_moment = (stack.cage_inner - p.opening) * 2 * (p.high - p.low) ** 3 / 12
    base = (lever / span) ** 2 * beyond**3 / (3 * E * second_moment)
    return 0.5e3 / (bending + shear + rocking + base)


def _head_room(p: BearingCage, x: float, y: float) -> cq.Shape:
    """Recess of one screw's head; one beside the opening is open to it, else a sliver would stand between them."""
    radius, low, high = p.screw.head_room, p.low + UNDER_HEAD, p.high + 1.0
    recess: cq.Shape = solids.upright(radius, low, high, x, y)
    reach = math.hypot(x, y)
    if reach - radius > p.opening + 1.0:
        return recess
    way = solids.box((0.0, -radius, low), (reach, radius, high))
    return recess.fuse(way.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(math.atan2(y, x))))


def _windows(p: BearingCage) -> list[cq.Solid]:
    """At +-x open below, for the adapter's arms; at +-y closed, so that the legs stand in pairs."""
    cuts = []
    for k in range(4):
        out = np.array([1.0, 0.0, 0.0]) if k % 2 == 0 else np.array([0.0, 1.0, 0.0])
        out = out if k < 2 else -out
        up = np.array([0.0, 0.0, 1.0])
        low = p.foot - 1.0 if k % 2 == 0 else p.high + 2.0
        outline = solids.gable(WINDOW_HALF_WIDTH, low, p.stack.cage_roof + WINDOWS_REACH)
        frame = np.stack([np.cross(up, out), up, out], axis=1)
        cuts.append(solids.prism(outline, 0.0, 80.0).moved(solids.location(frame)))
    return cuts


def _leg_screw(middle_deg: float, holes: tuple[tuple[float, float], ...], radius: float) -> float:
    """Azimuth [rad] within a leg whose radial screw stays furthest from the ears' screws."""

    def clearance(azimuth: float) -> float:
        reach = np.linspace(radius - SCREW_DEPTH, radius, 11)
        line = np.stack([np.cos(azimuth) * reach, np.sin(azimuth) * reach], axis=1)
        return min(float(np.linalg.norm(line - hole, axis=1).min()) for hole in holes)

    return max((math.radians(middle_deg + turn) for turn in (0.0, 15.0, -15.0)), key=lambda a: round(clearance(a), 6))
