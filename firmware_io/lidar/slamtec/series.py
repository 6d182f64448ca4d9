"""Series of RPLIDARs: baud rates and motor control."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Series:
    """One series."""

    models: tuple[str, ...]  # catalogue names, first that of a sensor whose model is not named
    bauds: tuple[int, ...]  # A2M8: 115,200
    motor: Literal["dtr", "pwm", "rpm", "scan"]  # signal or request that starts the motor


# by the upper half of the model byte (rplidar_sdk 2.1)
SERIES = {
    1: Series(("RPLIDAR A1",), (115_200,), "dtr"),
    2: Series(("RPLIDAR A2",), (256_000, 115_200), "pwm"),
    3: Series(("RPLIDAR A3",), (256_000,), "pwm"),
    4: Series(("RPLIDAR C1",), (460_800,), "scan"),
    6: Series(("RPLIDAR S1",), (256_000,), "rpm"),
    7: Series(("RPLIDAR S2", "RPLIDAR S2L"), (1_000_000,), "rpm"),
    8: Series(("RPLIDAR S3",), (1_000_000, 460_800), "rpm"),  # 460,800: model 0x82
}
