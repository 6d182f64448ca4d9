"""What the scanner's own parts hide of its fan: the record, and its file `own_body.npz`."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.errors import BuildError
from scanwright.design.files.numpy_files import read_npz

AXIS_STEPS = 720  # equal steps of the axis angle, from 0, in [0, 2 pi)


@dataclass(frozen=True, slots=True, eq=False)
class Shadow:
    """Beams that never reach the scene.

    Attributes:
        beams: hidden at every axis angle by what turns with the laser, shape (B,).
        stator: hidden by what stands still, at `AXIS_STEPS` axis angles, shape (B, G); None where it was not asked for.
    """

    beams: Bool[ndarray, " beams"]
    stator: Bool[ndarray, "beams angles"] | None

    def hidden(self) -> Float[ndarray, " beams"]:
        """Share of the axis angles at which each beam is hidden, shape (B,)."""
        if self.stator is None:
            return self.beams.astype(float)
        return np.where(self.beams, 1.0, self.stator.mean(axis=1))

    def share(self) -> float:
        """Return the share of all beams of a turn of the axis that is blocked."""
        return float(self.hidden().mean())

    def of(self, some: Bool[ndarray, " beams"]) -> Shadow:
        """Return the same for some of the beams."""
        return Shadow(self.beams[some], None if self.stator is None else self.stator[some])

    def free(self, joint_rad: Float[ndarray, " k"]) -> Bool[ndarray, "k beams"]:
        """Return whether each beam leaves the scanner at joint angles [rad], shape (k, B)."""
        if self.stator is None:
            return np.tile(~self.beams, (len(joint_rad), 1))
        steps = self.stator.shape[1]
        return ~(self.beams[:, None] | self.stator[:, np.rint(joint_rad / (2 * np.pi / steps)).astype(int) % steps]).T

    def partly(self) -> Bool[ndarray, " beams"]:
        """Return which beams are blocked at some axis angles by what stands still, shape (B,)."""
        if self.stator is None:
            return np.zeros(len(self.beams), bool)
        return ~self.beams & self.stator.any(axis=1)


def own_body_bytes(shadow: Shadow, bearings_rad: Float[ndarray, " beams"]) -> bytes:
    """`own_body.npz`: arrays `beams`, `stator` (none hidden where it was not asked for) and `bearing_rad`."""
    stator = np.zeros((len(bearings_rad), AXIS_STEPS), bool) if shadow.stator is None else shadow.stator
    stream = io.BytesIO()
    np.savez(stream, beams=shadow.beams, stator=stator, bearing_rad=bearings_rad)  # stored, dated 1980: same bytes
    return stream.getvalue()


def load_own_body(path: Path) -> tuple[Shadow, Float[ndarray, " beams"]]:
    """What the parts hide, and the bearings of the beams [rad], increasing, from `own_body.npz`.

    Raises:
        BuildError: the file is missing, damaged, or its arrays do not fit each other.
    """
    try:
        held = read_npz(path, BuildError)
    except BuildError as error:
        raise BuildError(f"{error}: build the folder again") from error
    bearings_rad, beams, stator = held.get("bearing_rad"), held.get("beams"), held.get("stator")
    if bearings_rad is None or bearings_rad.dtype != float or bearings_rad.ndim != 1 or bearings_rad.size < 2:
        raise BuildError(f"{path}: bearing_rad: two or more numbers: build the folder again")
    if not (np.isfinite(bearings_rad).all() and np.all(np.diff(bearings_rad) > 0)):
        raise BuildError(f"{path}: bearing_rad: finite and increasing: build the folder again")
    count = bearings_rad.size
    if beams is None or beams.dtype != bool or beams.shape != (count,):
        found = "missing" if beams is None else f"shape {beams.shape}, {beams.dtype}"
        raise BuildError(f"{path}: beams: {found}: ({count},) and bool: build the folder again")
    if stator is not None and (stator.dtype != bool or stator.ndim != 2 or len(stator) != count):
        found = f"shape {stator.shape}, {stator.dtype}"
        raise BuildError(f"{path}: stator: {found}: ({count}, axis angles) and bool: build the folder again")
    return Shadow(beams, stator), bearings_rad
