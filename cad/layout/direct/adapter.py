"""Numbers of the slip-ring adapter's fork on the servo's ears. No kernel."""

from scanwright.cad.layout.direct.cage import FOOT_RADIUS
from scanwright.cad.layout.direct.frame import frame_ears, needs_frame
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.drive import Ears, ears_on
from scanwright.cad.layout.names import SLIP_RING_ADAPTER
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

PLATE = 6.0
ARM_GAP = 0.25  # between arm and stator, on the radius
ARM = 5.0
ARM_HALF_WIDTH = 10.0
UNDER_ROOF = 12.0  # from the arms' ends to the ring's top, under a cage


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
