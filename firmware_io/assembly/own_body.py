"""Self-occlusion mask of the scanner: `own_body.npz` next to the angle set, written by `scanwright build`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numpy import ndarray

from scanwright.design.self_occlusion import load_self_occlusion

FILE_NAME = "own_body.npz"
_TURN = 2 * np.pi


@dataclass(frozen=True, slots=True, eq=False)
class OwnBody:
    """Mask of the beams that end on the scanner."""

    bearing_rad: Float64[ndarray, " n"]  # increasing
    beams: Bool[ndarray, " n"]  # hidden by the rotor, at all axis angles
    stator: Bool[ndarray, "n angles"]  # hidden by the stator at the axis angles 2 pi j / g; shape (n, 0) if none is

    def hides(self, bearing_rad: Float64[ndarray, " n"], gamma_rad: Float64[ndarray, " n"]) -> Bool[ndarray, " n"]:
        """Whether the beam of each bearing at each axis angle ends on the scanner, shape (n,)."""
        beams, stator = self.tables(bearing_rad)
        if not stator.shape[1]:
            return beams
        known = np.isfinite(gamma_rad)
        step = np.rint(np.where(known, gamma_rad, 0.0) * (stator.shape[1] / _TURN)).astype(np.int64) % stator.shape[1]
        return beams | (known & stator[np.arange(bearing_rad.size), step])

    def tables(self, bearing_rad: Float64[ndarray, " n"]) -> tuple[Bool[ndarray, " n"], Bool[ndarray, "n angles"]]:
        """Return `beams` and `stator` of the nearest known bearings, shapes (n,) and (n, g); False if too far."""
        nearest, known = self._match(bearing_rad)
        return self.beams[nearest] & known, self.stator[nearest] & known[:, None]

    def unknown(self, bearing_rad: Float64[ndarray, " n"]) -> int:
        """Return the number of bearings that are not in the mask."""
        return int(np.sum(~self._match(bearing_rad)[1]))

    def _match(self, bearing_rad: Float64[ndarray, " n"]) -> tuple[Int64[ndarray, " n"], Bool[ndarray, " n"]]:
        """Return the nearest known beam of each bearing, and whether it is within one step."""
        # bearings are compared modulo the turn that begins opposite the middle of the known ones
        begin = (self.bearing_rad[0] + self.bearing_rad[-1]) / 2 - np.pi
        folded = (bearing_rad - begin) % _TURN + begin
        right = np.searchsorted(self.bearing_rad, folded).clip(1, self.bearing_rad.size - 1)
        left = right - 1
        nearer_left = folded - self.bearing_rad[left] <= self.bearing_rad[right] - folded
        nearest = np.where(nearer_left, left, right)
        step = np.diff(self.bearing_rad).max()
        return nearest, np.abs(self.bearing_rad[nearest] - folded) <= step


def own_body_of(angles: Path) -> OwnBody | None:
    """Return the mask in the folder of an angle set, None without one; BuildError if it is invalid."""
    path = angles.parent / FILE_NAME
    if not path.is_file():
        return None
    shadow, bearing_rad = load_self_occlusion(path)
    stator = np.zeros((bearing_rad.size, 0), bool) if shadow.stator is None else shadow.stator
    return OwnBody(bearing_rad, shadow.beams, stator)
