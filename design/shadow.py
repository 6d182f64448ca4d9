"""What the scanner's own parts hide of its fan: the record, its file, and the one Protocol that crosses the rooms.

The optimiser must know what the parts of a setting hide, and `design` never imports `cad`: `cad/assembly/shadow.py`
implements the Protocol, the front door passes it in.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from design.frames import Array

AXIS_STEPS = 720  # equal steps of the axis angle, from 0, in [0, 2 pi)

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Shadow:
    """Beams that never reach the scene.

    Attributes:
        beams: hidden at every axis angle by what turns with the laser, shape (B,).
        stator: hidden by what stands still, at `AXIS_STEPS` axis angles, shape (B, G); None where it was not asked for.
    """

    beams: Mask
    stator: Mask | None

    def hidden(self) -> Array:
        """Share of the axis angles at which each beam is hidden, shape (B,)."""
        if self.stator is None:
            return self.beams.astype(float)
        return np.where(self.beams, 1.0, self.stator.mean(axis=1))


@dataclass(frozen=True, slots=True)
class Refused:
    """A setting that cannot be built, and why."""

    reason: str


class Workshop(Protocol):
    """Whoever knows the parts. Settings are (alpha_rot, beta_rot, alpha_laser, beta_laser) in radians."""

    def bound(self, setting_rad: Array) -> Shadow | Refused:
        """What the parts hide at least, in closed form: `stator` is None, all of it holds at every axis angle."""
        ...

    def shadow(self, setting_rad: Array) -> Shadow | Refused:
        """What the parts hide, from the parts themselves."""
        ...


def own_body_bytes(shadow: Shadow, bearings_rad: Array) -> bytes:
    """`own_body.npz`: arrays `beams`, `stator` (none hidden where it was not asked for) and `bearing_rad`."""
    stator = np.zeros((len(bearings_rad), AXIS_STEPS), bool) if shadow.stator is None else shadow.stator
    stream = io.BytesIO()
    np.savez(stream, beams=shadow.beams, stator=stator, bearing_rad=bearings_rad)  # stored, dated 1980: same bytes
    return stream.getvalue()
