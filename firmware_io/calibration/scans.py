"""Beams as an image: rows of scans, columns of bearings, with neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Floats, Ints, Mask
from scanwright.firmware_io.calibration.model import ReturnedBeams

_ROW_RAD = 4 * np.pi  # two turns: bearings of one scan never reach the next row


@dataclass(frozen=True, slots=True, eq=False)
class Scans:
    """Scan and bearing of each beam."""

    scan: Ints  # number of each beam's scan, not decreasing, shape (n,)
    run: Ints  # number of each scan's run: one recording and one direction of the axis, shape (s,)
    joint_rad: Floats  # of each scan's middle, shape (s,)
    bearing_rad: Floats  # of each beam since the begin of its scan, increasing, shape (n,)
    first_rad: float  # bearing at the begin of a scan
    sense: float  # +1 or -1 for increasing or decreasing bearings
    gap_rad: float  # between neighbours in a scan

    @staticmethod
    def of(beams: ReturnedBeams) -> Scans:
        """Split the beams into scans, which end at a reversal of the bearing."""
        step_rad = np.diff(beams.bearing_rad)
        sense = float(np.sign(np.median(step_rad)))
        onward = (sense * step_rad > 0) & (np.diff(beams.recording) == 0)
        scan = np.append(0, np.cumsum(~onward))
        gap_rad = float(np.quantile(np.abs(step_rad[onward]), 0.1))  # many neighbours can be missing
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
        """Rotation of the axis between two scans."""
        return float(np.median(np.abs(np.diff(self.joint_rad)))) if self.joint_rad.size > 1 else 0.0

    def beam(self, scan: Ints, bearing_rad: Floats) -> tuple[Ints, Mask]:
        """Return the beam of a scan nearest to a bearing (since its begin), and whether it is within a gap."""
        keys, key = self.scan * _ROW_RAD + self.bearing_rad, scan * _ROW_RAD + bearing_rad
        at = np.clip(np.searchsorted(keys, key), 1, keys.size - 1)
        at = at - (key - keys[at - 1] < keys[at] - key)
        return at, (self.scan[at] == scan) & (np.abs(self.bearing_rad[at] - bearing_rad) < self.gap_rad)
