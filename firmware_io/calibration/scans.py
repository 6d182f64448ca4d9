"""Beams as an image: rows of scans, columns of bearings, and which beams are neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Floats, Ints, Mask
from scanwright.firmware_io.calibration.model import ReturnedBeams

_ROW_RAD = 4 * np.pi  # two turns: bearings of one scan never reach the next row


@dataclass(frozen=True, slots=True, eq=False)
class Scans:
    """The beams as rows of an image: which scan each is of, and where in it.

    Attributes:
        bearing_rad: from where a scan begins, rising in it, shape (n,). first_rad, sense: bearing there, and +1 or -1
            as bearings rise or fall.
    """

    scan: Ints  # number of each beam's scan, rising, shape (n,)
    run: Ints  # number of each scan's run: of one recording, turning one way, shape (s,)
    joint_rad: Floats  # of each scan's middle, shape (s,)
    bearing_rad: Floats
    first_rad: float
    sense: float
    gap_rad: float  # between neighbours in a scan, where none is missing

    @staticmethod
    def of(beams: ReturnedBeams) -> Scans:
        """A scan ends where the bearing jumps back."""
        step_rad = np.diff(beams.bearing_rad)
        sense = float(np.sign(np.median(step_rad)))
        onward = (sense * step_rad > 0) & (np.diff(beams.recording) == 0)
        scan = np.append(0, np.cumsum(~onward))
        gap_rad = float(np.quantile(np.abs(step_rad[onward]), 0.1))  # most may lack a neighbour
        first_rad = sense * float(np.min(sense * beams.bearing_rad)) - sense * gap_rad
        middle = np.searchsorted(scan, np.arange(scan[-1] + 1)) + np.bincount(scan) // 2
        direction = beams.direction[middle]
        # at rest, the axis keeps the direction of its last motion
        direction = direction[np.maximum.accumulate(np.where(direction != 0, np.arange(direction.size), 0))]
        run = np.append(0, np.cumsum((np.diff(direction) != 0) | (np.diff(beams.recording[middle]) != 0)))
        bearing_rad = sense * (beams.bearing_rad - first_rad)
        return Scans(scan, run, beams.joint_rad[middle], bearing_rad, first_rad, sense, gap_rad)

    @property
    def step_rad(self) -> float:
        """How far the axis turns from scan to scan."""
        return float(np.median(np.abs(np.diff(self.joint_rad)))) if self.joint_rad.size > 1 else 0.0

    def beam(self, scan: Ints, bearing_rad: Floats) -> tuple[Ints, Mask]:
        """The beam of a scan that is nearest to a bearing (from where a scan begins), and whether it is near."""
        key, wanted = self.scan * _ROW_RAD + self.bearing_rad, scan * _ROW_RAD + bearing_rad
        at = np.clip(np.searchsorted(key, wanted), 1, key.size - 1)
        at = at - (wanted - key[at - 1] < key[at] - wanted)
        return at, (self.scan[at] == scan) & (np.abs(self.bearing_rad[at] - bearing_rad) < self.gap_rad)
