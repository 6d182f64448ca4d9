"""Steps of the twin: what the ramp generator sends to the motor, and what the encoder counts of the horn.

Speeds are reached at once: at those of a scan a ramp takes some ten milliseconds. Right is clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from scanwright.firmware_io.twins.servo_plant import walked_rad

COUNTS = 1024  # of the encoder


@dataclass(frozen=True, slots=True)
class Steps:
    """Where the ramp generator is and goes, from one moment on.

    Attributes:
        since_ns: that moment.
        start: position then, in microsteps.
        goal: where it stops; infinite where it does not.
        rate: microsteps a second.
        unit_rad: of one microstep.
        origin_rad: angle of the field at position 0.
    """

    since_ns: int
    start: float
    goal: float
    rate: float
    unit_rad: float
    origin_rad: float

    def position(self, now_ns: int) -> float:
        """In microsteps."""
        return walked_rad((now_ns - self.since_ns) / 1e9, self.start, self.goal, self.rate)

    def speed(self, now_ns: int) -> float:
        """Microsteps a second; negative to the left."""
        left = self.goal - self.position(now_ns)
        return math.copysign(self.rate, left) if left and self.rate else 0.0

    def angle_rad(self, position: float) -> float:
        """Of the field; infinite where the position is."""
        return self.origin_rad - position * self.unit_rad

    def go(self, now_ns: int, goal: float, rate: float) -> Steps:
        """From now on to another goal."""
        return replace(self, since_ns=now_ns, start=self.position(now_ns), goal=goal, rate=rate)

    def count(self, now_ns: int, position: float) -> Steps:
        """Say another position for where the field is, and stand."""
        angle_rad = self.angle_rad(self.position(now_ns))
        origin_rad = angle_rad + position * self.unit_rad
        return replace(self, since_ns=now_ns, start=position, goal=position, rate=0.0, origin_rad=origin_rad)

    def take(self, now_ns: int, angle_rad: float, unit_rad: float) -> Steps:
        """The field is at another angle, its steps of another size; the count goes on."""
        here = self.position(now_ns)
        origin_rad = angle_rad + here * unit_rad
        return replace(self, since_ns=now_ns, start=here, unit_rad=unit_rad, origin_rad=origin_rad)


def encoder_count(angle_rad: float) -> int:
    """What the encoder has counted at an angle of the horn, turns included; its middle is where the horn is at 0."""
    return COUNTS // 2 - round(angle_rad * COUNTS / (2 * math.pi))
