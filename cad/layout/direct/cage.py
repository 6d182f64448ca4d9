"""Numbers of the plates on the servo's ears: the base of a bearing's cage, the fork of a ring's adapter. No kernel."""

import math
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.direct.frame import frame_ears, needs_frame
from scanwright.cad.layout.direct.loads import Supported, hanging, shaft_modulus_pa, supported
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.drive import Ears, ears_on
from scanwright.cad.layout.loads import Weight
from scanwright.cad.layout.names import CAGE_BASE, SLIP_RING_ADAPTER
from scanwright.cad.screws import SCREWS, Thread, Trap, passing_hole, thread_in_part
from scanwright.design.catalogue.products import Bearing
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

BASE_HEIGHT = 20.0
RING_ABOVE_BASE = 1.5
SEAT_GAP = 0.2  # the feet carry, not the plate
FOOT_RADIUS = 3.0
UNDER_HEAD = 3.0  # of the plate
CAGE_SCREW = SCREWS["M3"]
LEAST_BOSS = 8.0  # thickness of its wall: a nut in its slot between two walls, or an insert
SCREW_DEPTH = 10.0  # of a radial screw in the boss
WINDOW_HALF_WIDTH = 11.5  # the adapter's arms are in the windows at +-x; those at +-y give access to a tie
TURNS_CLEAR = 1.0  # between the shaft's flange, or the case, and the leads of a ring's stator next to it
PLUG_PLAY = 1.0  # clearance around a plug in a hole
PLASTIC_PA = 2.3e9  # modulus of solid PLA, the softest material of the printers
POISSON = 0.35


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingCage:
    """Lengths in mm, azimuths in rad."""

    stack: DirectStack
    bearing: Bearing
    ears: Ears
    cage_hole: float  # diameter, in the legs
    thread: Thread  # of the radial screws, in the boss
    legs: tuple[float, ...]  # azimuths of the bell's radial screws
    fit: float  # diametral clearance of a sliding fit
    lead_hole: tuple[float, float]  # half width and end in y of the base's hole for leads and plugs; 0, 0 without

    @property
    def low(self) -> float:
        """Height of the base's lower face."""
        return _base_low(self.stack, self.ears)

    @property
    def high(self) -> float:
        """Height of the boss, and of the entire base."""
        return _boss_top(self.stack, self.low)

    @property
    def foot(self) -> float:
        """Height of the flange below the bell."""
        return (self.low + self.high) / 2


def ears_of(scanner: Scanner, stack: DirectStack) -> Ears:
    """Return the holes for the base of a cage: of the case, or of a frame if the case has none.

    Raises:
        BuildError: the case has neither four holes next to the turning flange nor two for a frame.
    """
    servo, printer = scanner.servo, scanner.printer
    opening = stack.flange_radius + 1.0
    least = opening + passing_hole(SCREWS[servo.front.screw], printer) / 2 + printer.min_wall_mm
    free = [(x, y) for x, y in servo.front.places if math.hypot(x, y) >= least]
    widest = max((x for x, _ in free), default=0.0)
    holes = tuple(sorted((x, y) for x, y in free if abs(x) == widest))
    if len(holes) >= 4 and not needs_frame(servo):
        return ears_on(scanner, opening, holes)
    if len(servo.front.places) < 2:
        caution = servo.caution("holes")
        raise BuildError(
            f"{CAGE_BASE}: ears: holes = {list(servo.front.places)} in front{caution}: {servo.name} needs two "
            f"pairs of front holes at least {least:.2f} mm from the axis, outside the turning flange, or two for a "
            "frame"
        )
    return frame_ears(scanner, opening, fork=False)


def cage_of(scanner: Scanner, stack: DirectStack, ears: Ears) -> BearingCage | None:
    """Return the cage of one scanner; None if the horn carries the rotor alone."""
    if stack.bearing is None:
        return None
    printer = scanner.printer
    thread = thread_in_part(CAGE_SCREW, printer, carries=True)
    if thread.trap is not None and not nut_fits(thread.trap, stack, _base_low(stack, ears), printer.min_wall_mm):
        thread = thread_in_part(CAGE_SCREW, printer, nut_fits=False, carries=True)
    hole = lead_hole(scanner, stack)
    avoid = (*ears.holes, *((x, hole[1]) for x in (-hole[0], hole[0]) if hole[0]))
    return BearingCage(
        stack=stack,
        bearing=stack.bearing,
        ears=ears,
        cage_hole=passing_hole(CAGE_SCREW, printer),
        thread=thread,
        legs=tuple(_leg_screw(middle, avoid, stack.cage_inner) for middle in (45.0, 135.0, 225.0, 315.0)),
        fit=printer.fit_clearance_mm,
        lead_hole=hole,
    )


def stator_leads_y(scanner: Scanner, stack: DirectStack) -> float:
    """Return the distance from the axis of the leads of a ring's stator, at +y."""
    half = 0.0 if scanner.slip_ring is None else (scanner.slip_ring.lead_diameter_mm or 0.0) / 2
    return max(stack.flange_radius, scanner.servo.case_max_mm[1]) + TURNS_CLEAR + half


def lead_hole(scanner: Scanner, stack: DirectStack) -> tuple[float, float]:
    """Return the half width and end in y of the hole for a ring's leads and plugs at +y; zeros without a ring."""
    ring = scanner.slip_ring
    if ring is None:
        return 0.0, 0.0
    lead = ring.lead_diameter_mm or 0.0
    wide, thick = ring.plug_mm or (lead, lead)
    y = max(stack.flange_radius + TURNS_CLEAR + thick, stator_leads_y(scanner, stack) + lead / 2) + PLUG_PLAY
    return max(wide, lead) / 2 + PLUG_PLAY, y


def _base_low(stack: DirectStack, ears: Ears) -> float:
    return stack.horn + ears.front + SEAT_GAP


def _boss_top(stack: DirectStack, low: float) -> float:
    return min(low + BASE_HEIGHT, stack.ring_bottom - RING_ABOVE_BASE)


def nut_fits(trap: Trap, stack: DirectStack, low: float, wall: float) -> bool:
    """Return whether a nut in the boss has a floor below it and does not reach the ring above."""
    quarter = (_boss_top(stack, low) - low) / 4
    return 3 * quarter - trap.corner >= wall and trap.corner <= quarter + RING_ABOVE_BASE / 2


def stiffness_n_per_m(stack: DirectStack, ears: Ears) -> float:
    """Return the sideways stiffness of a cage at the bearing: legs and base by beam formulas, halved.

    It is assumed to be right within a factor of two.
    """
    E = PLASTIC_PA * 1e-6  # N/mm2
    G = E / (2 + 2 * POISSON)
    low = _base_low(stack, ears)
    high = _boss_top(stack, low)
    foot = (low + high) / 2
    radius, wall = (stack.cage_inner + stack.cage_outer) / 2, stack.cage_outer - stack.cage_inner
    half_window = math.asin(WINDOW_HALF_WIDTH / stack.cage_inner) if stack.ring_length > 0 else 0.0
    width = radius * (math.pi / 2 - 2 * half_window)
    length, lever = stack.cage_roof - foot, stack.bearing_middle - foot
    # four legs at 45 deg: two of them bend and shear across their width, all four stretch
    bending = length**3 / (2 * E * wall * width**3)
    shear = length / (2 * 5 / 6 * G * wall * width)
    rocking = (lever - length / 2) ** 2 * length / (4 * E * wall * width * radius**2 / 2)
    reach, span = radius * math.sqrt(0.5), 2 * radius * math.sqrt(0.5)
    beyond = max(0.0, reach - max(y for _, y in ears.holes))
    strip = stack.cage_inner - ears.opening
    second_moment = strip * 2 * (high - low) ** 3 / 12
    base = (lever / span) ** 2 * beyond**3 / (3 * E * second_moment)
    return 0.5e3 / (bending + shear + rocking + base)


def _leg_screw(middle_deg: float, holes: tuple[tuple[float, float], ...], radius: float) -> float:
    """Return the azimuth [rad] within a leg whose radial screw stays furthest from the ears' screws."""

    def clearance(azimuth: float) -> float:
        reach = np.linspace(radius - SCREW_DEPTH, radius, 11)
        line = np.stack([np.cos(azimuth) * reach, np.sin(azimuth) * reach], axis=1)
        return min(float(np.linalg.norm(line - hole, axis=1).min()) for hole in holes)

    return max((math.radians(middle_deg + turn) for turn in (0.0, 15.0, -15.0)), key=lambda a: round(clearance(a), 6))


def share_weight(scanner: Scanner, stack: DirectStack, cage: BearingCage | None, weight: Weight) -> Supported:
    """Return how horn and bearing share the weight of all that turns."""
    if cage is None:
        return hanging(weight, stack, shaft_modulus_pa(scanner, stack))
    return supported(weight, stack, stiffness_n_per_m(stack, cage.ears))


def adapter_of(scanner: Scanner, stack: DirectStack) -> Ears | None:
    """Return the holes for the fork of one scanner; None without a ring, or if the base of a cage carries the arms.

    Raises:
        BuildError: the case has no four holes behind the turning flange, and no frame.
    """
    if scanner.slip_ring is None or stack.bearing is not None:
        return None
    servo = scanner.servo
    if needs_frame(servo):
        return frame_ears(scanner, _opening(stack), fork=True)
    holes = fork_holes(servo, stack)
    if not holes:
        caution = servo.caution("holes")
        raise BuildError(
            f"{SLIP_RING_ADAPTER}: fork: holes = {list(servo.front.places)} in front{caution}: {servo.name} needs two "
            f"pairs of front holes at y < {_behind(stack):g}, behind the turning flange"
        )
    return ears_on(scanner, _opening(stack), holes)


def fork_holes(servo: Servo, stack: DirectStack) -> tuple[tuple[float, float], ...]:
    """Return the nearest and the furthest pair of front holes behind the turning flange; none without two pairs."""
    behind = sorted({y for _, y in servo.front.places if y < _behind(stack)}, reverse=True)
    rows = [sorted(hole for hole in servo.front.places if hole[1] == y) for y in behind]
    widest = max((row[-1][0] for row in rows), default=0.0)
    rows = [row for row in rows if len(row) == 2 and row[-1][0] == widest]
    return (*rows[0], *rows[-1]) if len(rows) > 1 else ()


def _opening(stack: DirectStack) -> float:
    return stack.flange_radius + 1.5


def _behind(stack: DirectStack) -> float:
    return 2.0 - FOOT_RADIUS - _opening(stack)
