"""Parameters of Hokuyo lidars, and error codes among their ranges; invalid values raise ProtocolError."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Float32s
from scanwright.design.errors import ProtocolError
from scanwright.firmware_io.lidar.lidar import StampAt
from scanwright.firmware_io.lidar.scip.measurement import Window
from scanwright.firmware_io.lidar.scip.protocol import Integers


@dataclass(frozen=True, slots=True)
class Parameters:
    """A sensor's PP reply."""

    model: str  # without the maker
    range_min_mm: int  # smaller numbers are error codes
    range_max_mm: int  # larger numbers are error codes
    steps_per_turn: int
    first_step: int  # first measured one; step 0 is the sensor's zero
    last_step: int  # last measured one
    front_step: int  # straight ahead
    rpm: int  # turns per minute

    @property
    def scan_period_s(self) -> float:
        """Duration of one turn."""
        return 60 / self.rpm

    @property
    def step_rad(self) -> float:
        """Angle of one step, counter-clockwise from above."""
        return 2 * math.pi / self.steps_per_turn

    @property
    def step_s(self) -> float:
        """Duration of one step."""
        return self.scan_period_s / self.steps_per_turn

    @property
    def window(self) -> Window:
        """All measured steps."""
        return Window(first_step=self.first_step, last_step=self.last_step)

    def since_stamp_s(self, step: float, stamp_at: StampAt | None) -> float:
        """Return the time from a timestamp to a step.

        The specification puts the stamp at step 0 (p. 12); drivers put it at the rear beam, as other documents of the
        maker do. The two differ by 3.1 ms for the UTM-30LX and 12.5 ms for the URG-04LX.
        """
        rear_step = self.front_step - self.steps_per_turn / 2
        return (step - (rear_step if stamp_at == "rear" else 0.0)) * self.step_s


def parameters(fields: Mapping[str, str]) -> Parameters:
    """Decode a PP reply."""
    try:
        known = Parameters(
            model=fields["MODL"].partition("(")[0].strip(),
            range_min_mm=int(fields["DMIN"]),
            range_max_mm=int(fields["DMAX"]),
            steps_per_turn=int(fields["ARES"]),
            first_step=int(fields["AMIN"]),
            last_step=int(fields["AMAX"]),
            front_step=int(fields["AFRT"]),
            rpm=int(fields["SCAN"]),
        )
    except KeyError as error:
        raise ProtocolError(f"PP: {error.args[0]} is missing") from error
    except ValueError as error:
        raise ProtocolError(f"PP: {error}") from error
    ordered = 0 <= known.first_step < known.last_step < known.first_step + known.steps_per_turn
    if not (ordered and known.rpm > 0 and 0 <= known.range_min_mm < known.range_max_mm):
        raise ProtocolError(f"PP: the values contradict each other: {dict(fields)}")
    return known


def ranges_m(value: Integers, of: Parameters) -> Float32s:
    """Return ranges of sent numbers, shape (n,); NaN for error codes."""
    valid = (value >= of.range_min_mm) & (value <= of.range_max_mm)
    return np.where(valid, value / 1e3, np.nan).astype(np.float32)
