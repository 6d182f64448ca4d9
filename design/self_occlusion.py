"""Beams of the field of view that the scanner's own parts block: the mask, and its file `own_body.npz`."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.errors import BuildError
from scanwright.design.files.numpy_files import read_npz

AXIS_STEPS = 720  # equal steps of the axis angle in [0, 2 pi), 0.5 deg each


@dataclass(frozen=True, slots=True, eq=False)
class SelfOcclusion:
    """Blocked beams."""

    beams: Bool[ndarray, " beams"]  # blocked at every axis angle, by parts that turn with the laser, shape (B,)
    # blocked by fixed parts, at `AXIS_STEPS` axis angles, shape (B, G); None if not computed
    stator: Bool[ndarray, "beams angles"] | None

    def hidden(self) -> Float[ndarray, " beams"]:
        """Return the share of the axis angles at which each beam is blocked, shape (B,)."""
        if self.stator is None:
            return self.beams.astype(float)
        return np.where(self.beams, 1.0, self.stator.mean(axis=1))

    def share(self) -> float:
        """Return the share of all beams of one turn of the axis that is blocked."""
        return float(self.hidden().mean())

    def of(self, some: Bool[ndarray, " beams"]) -> SelfOcclusion:
        """Return the mask of the selected beams."""
        return SelfOcclusion(self.beams[some], None if self.stator is None else self.stator[some])

    def free(self, joint_rad: Float[ndarray, " k"]) -> Bool[ndarray, "k beams"]:
        """Return whether each beam leaves the scanner at joint angles [rad], shape (k, B)."""
        if self.stator is None:
            return np.tile(~self.beams, (len(joint_rad), 1))
        steps = self.stator.shape[1]
        return ~(self.beams[:, None] | self.stator[:, np.rint(joint_rad / (2 * np.pi / steps)).astype(int) % steps]).T

    def partly(self) -> Bool[ndarray, " beams"]:
        """Return which beams fixed parts block at some axis angles only, shape (B,)."""
        if self.stator is None:
            return np.zeros(len(self.beams), bool)
        return ~self.beams & self.stator.any(axis=1)


def self_occlusion_bytes(mask: SelfOcclusion, bearings_rad: Float[ndarray, " beams"]) -> bytes:
    """Return `own_body.npz`: arrays `beams`, `stator` (all False if not computed) and `bearing_rad`."""
    stator = np.zeros((len(bearings_rad), AXIS_STEPS), bool) if mask.stator is None else mask.stator
    stream = io.BytesIO()
    np.savez(stream, beams=mask.beams, stator=stator, bearing_rad=bearings_rad)  # stored, dated 1980: same bytes
    return stream.getvalue()


def load_self_occlusion(path: Path) -> tuple[SelfOcclusion, Float[ndarray, " beams"]]:
    """Read `own_body.npz`: the mask, and the bearings of its beams [rad], increasing.

    Raises:
        BuildError: the file is missing or damaged, or its arrays do not fit each other.
    """
    try:
        arrays = read_npz(path, BuildError)
    except BuildError as error:
        raise BuildError(f"{error}: build the folder again") from error
    bearings_rad, beams, stator = arrays.get("bearing_rad"), arrays.get("beams"), arrays.get("stator")
    if bearings_rad is None or bearings_rad.dtype != float or bearings_rad.ndim != 1 or bearings_rad.size < 2:
        raise BuildError(f"{path}: bearing_rad: two or more numbers: build the folder again")
    if not (np.isfinite(bearings_rad).all() and np.all(np.diff(bearings_rad) > 0)):
        raise BuildError(f"{path}: bearing_rad: finite and increasing: build the folder again")
    count = bearings_rad.size
    if beams is None or beams.dtype != bool or beams.shape != (count,):
        got = "missing" if beams is None else f"shape {beams.shape}, {beams.dtype}"
        raise BuildError(f"{path}: beams: {got}: ({count},) and bool: build the folder again")
    if stator is not None and (stator.dtype != bool or stator.ndim != 2 or len(stator) != count):
        got = f"shape {stator.shape}, {stator.dtype}"
        raise BuildError(f"{path}: stator: {got}: ({count}, axis angles) and bool: build the folder again")
    return SelfOcclusion(beams, stator), bearings_rad
