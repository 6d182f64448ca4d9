"""Which RPLIDAR it is by the model it tells, the speed of its line, and what starts its motor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Series:
    """What tells one series from another: the catalogue's name, the line's speed, and what starts the motor."""

    model: str
    baud: int
    motor: Literal["dtr", "pwm", "rpm", "scan"]


# by the higher half of the model's byte; that of the C1 is one user's word
SERIES = {
    1: Series("RPLIDAR A1", 115_200, "dtr"),
    2: Series("RPLIDAR A2", 256_000, "pwm"),
    3: Series("RPLIDAR A3", 256_000, "pwm"),
    4: Series("RPLIDAR C1", 460_800, "scan"),
    6: Series("RPLIDAR S1", 256_000, "rpm"),
    7: Series("RPLIDAR S2", 1_000_000, "rpm"),
}
