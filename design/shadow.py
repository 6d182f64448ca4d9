"""What the scanner's own parts hide of its fan: the record, and its file `own_body.npz`."""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from design.errors import BuildError

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
        if not zipfile.is_zipfile(path):  # NumPy would take it for a pickle
            raise ValueError("damaged, or another file")
        with np.load(path, allow_pickle=False) as arrays:
            bearings_rad, beams = np.asarray(arrays["bearing_rad"], float), np.asarray(arrays["beams"], bool)
            stator = np.asarray(arrays["stator"], bool) if "stator" in arrays else None
        if bearings_rad.ndim != 1 or bearings_rad.size < 2 or not np.all(np.diff(bearings_rad) > 0):
            raise ValueError(f"bearing_rad of shape {bearings_rad.shape}: two or more increasing bearings")
        if beams.shape != bearings_rad.shape or (stator is not None and stator.shape[:-1] != beams.shape):
            shapes = f"beams {beams.shape}, stator {None if stator is None else stator.shape}"
            raise ValueError(f"{shapes}: one row for each of {bearings_rad.size} bearings")
    except Exception as error:  # the reader of archives fails with a dozen types
        raise BuildError(f"{path}: not as `scanwright build` writes it ({error}): build the folder again") from error
    return Shadow(beams, stator), bearings_rad
