"""Orientation between two poses, from a gyro.

The rates are integrated from each pose to the next (mean of neighbouring samples). The difference to the next pose, by
bias, noise and the error of the poses, is distributed over the time, so that all poses keep their orientation.
Positions are interpolated linearly. Source: the strapdown integral of D. Titterton, J. Weston, Strapdown Inertial
Navigation Technology (2nd ed.), ch. 11. Unusable input raises RecordingError.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numpy import ndarray
from scipy.spatial.transform import Rotation

from scanwright.design.arrays import Floats, Times
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.poses.trajectory import Trajectory

_LONG_GAP = 5.0  # times the median gap between two rates, beyond which the motion is unknown
_NOISE_RAD = math.radians(0.2)  # error of poses
_WORSE = 1.1  # largest error with the gyro relative to the rotation between poses, except for noise


@dataclass(frozen=True, slots=True, eq=False)
class Gyro:
    """Angular rates over time; RecordingError for fewer than two samples."""

    time_ns: Int64[ndarray, " n"]  # shape (n,), n >= 2, strictly increasing
    rate_rad_s: Float64[ndarray, "n 3"]  # about the axes of the IMU, shape (n, 3)
    frame: str = ""  # of the IMU; "" if unknown
    left_out: int = 0  # dropped samples: not finite, or of the time of another

    def __post_init__(self) -> None:
        if self.time_ns.size < 2:
            raise RecordingError(f"{self.time_ns.size} rates of turn: at least two are needed to integrate them")


def oriented(poses: Trajectory, gyro: Gyro, R_platform_imu: Float64[ndarray, "3 3"]) -> tuple[Trajectory, list[str]]:
    """Insert the orientations of a gyro between the poses.

    Args:
        poses: of the platform.
        gyro: of an IMU fixed to it.
        R_platform_imu: orientation of the IMU.

    Returns:
        The poses with orientations between them, and notes. Poses without gyro between them are unchanged.
    """
    rate_rad_s = gyro.rate_rad_s @ R_platform_imu.T
    informative = _informative(poses.time_ns, gyro.time_ns)
    if not informative.any():
        raise RecordingError(
            f"gyro {_span(gyro.time_ns)}, poses {_span(poses.time_ns)}: no two neighbouring poses with gyro between"
        )
    known = (gyro.time_ns >= poses.time_ns[0]) & (gyro.time_ns <= poses.time_ns[-1])
    interval = np.searchsorted(poses.time_ns, gyro.time_ns, side="right") - 1
    known &= informative[interval.clip(0, informative.size - 1)]
    if np.sum(known) < 2 * np.sum(informative):
        raise RecordingError(
            f"gyro: {np.sum(known)} rates between {np.sum(informative) + 1} poses: no denser than the poses"
        )
    time_ns = np.union1d(poses.time_ns, gyro.time_ns[known])
    at = np.searchsorted(time_ns, poses.time_ns)
    after_s = (time_ns - time_ns[0]) / 1e9
    rates = [np.interp(after_s, (gyro.time_ns - time_ns[0]) / 1e9, column) for column in rate_rad_s.T]
    turned = _integrated(time_ns, np.stack(rates, axis=1))
    pose = Rotation.from_quat(poses.quaternion)
    between = turned[at[:-1]].inv() * turned[at[1:]]
    step = pose[:-1].inv() * pose[1:]
    miss = (between.inv() * step).as_rotvec()
    fits = _fits(
        between.as_rotvec()[informative], step.as_rotvec()[informative], np.diff(poses.time_ns)[informative] / 1e9
    )
    behind = (np.searchsorted(at, np.arange(time_ns.size), side="right") - 1).clip(0, informative.size - 1)
    part = (time_ns - poses.time_ns[behind]) / np.diff(poses.time_ns)[behind]
    since = turned[at[behind]].inv() * turned
    quaternion = (pose[behind] * since * Rotation.from_rotvec(part[:, None] * miss[behind])).as_quat()
    quaternion[at] = poses.quaternion
    known_s = (poses.time_ns - time_ns[0]) / 1e9
    position_m = np.stack([np.interp(after_s, known_s, column) for column in poses.position_m.T], axis=1)
    if not informative.all():
        fits.append(
            f"warning: {np.sum(~informative)} of {informative.size} intervals between poses have no gyro rate: "
            "interpolated about one axis"
        )
    if gyro.left_out:
        fits.append(f"dropped {gyro.left_out} gyro rates: not finite, or not later than the one before")
    return Trajectory(time_ns, position_m, quaternion, poses.platform, measured=poses), fits


def _informative(pose_ns: Times, gyro_ns: Times) -> Bool[ndarray, " k"]:
    """Return whether the gyro covers the time from each pose to the next one."""
    gap_ns = np.diff(gyro_ns)
    long = np.append(0, np.cumsum(gap_ns > _LONG_GAP * np.median(gap_ns)))
    first = np.searchsorted(gyro_ns, pose_ns[:-1], side="right") - 1
    last = np.searchsorted(gyro_ns, pose_ns[1:], side="left")
    inside = (first >= 0) & (last < gyro_ns.size)
    return inside & (long[first.clip(0)] == long[last.clip(max=gyro_ns.size - 1)])


def _integrated(time_ns: Times, rate_rad_s: Floats) -> Rotation:
    """Return the rotation of the platform since the first time, for each time."""
    mean_rad_s = (rate_rad_s[1:] + rate_rad_s[:-1]) / 2
    steps = Rotation.from_rotvec(mean_rad_s * (np.diff(time_ns) / 1e9)[:, None])
    turned = Rotation.concatenate([Rotation.identity(), steps]).as_quat()
    reach = 1
    while reach < len(turned):  # cumulative product in log2(n) passes
        turned[reach:] = (Rotation.from_quat(turned[:-reach]) * Rotation.from_quat(turned[reach:])).as_quat()
        reach *= 2
    return Rotation.from_quat(turned)


def _fits(gyro_rad: Floats, pose_rad: Floats, gap_s: Floats) -> list[str]:
    """Describe the difference of gyro and poses, rotation vectors of shape (k, 3) over `gap_s`."""
    bias_rad_s = np.median((gyro_rad - pose_rad) / gap_s[:, None], axis=0)
    left_rad = gyro_rad - bias_rad_s * gap_s[:, None] - pose_rad
    missed_rad, turned_rad = _rms(left_rad), _rms(pose_rad)
    if missed_rad > _WORSE * turned_rad + _NOISE_RAD:
        raise RecordingError(
            f"gyro: differs from the turns between poses by {math.degrees(missed_rad):.2g} deg (rms), "
            f"while the poses turn by {math.degrees(turned_rad):.2g}{_hint(gyro_rad, pose_rad)}"
        )
    return [
        f"gyro: orientation between poses; bias {math.degrees(float(np.linalg.norm(bias_rad_s))):.2g} deg/s, residual "
        f"{math.degrees(missed_rad):.2g} deg (rms) at the next pose, while the poses turn by "
        f"{math.degrees(turned_rad):.2g}"
    ]


def _hint(gyro_rad: Floats, pose_rad: Floats) -> str:
    """Return a hint of the orientation of the IMU, or the unit of its rates, that fits the poses."""
    faster = _rms(gyro_rad) / max(_rms(pose_rad), 1e-12)
    if faster > 30:
        return f"; its rates are {faster:.0f} times as fast: deg/s?"
    R, _ = Rotation.align_vectors(pose_rad, gyro_rad)
    if _rms(R.apply(gyro_rad) - pose_rad) < _rms(pose_rad) / 2:
        roll, pitch, yaw = R.as_euler("xyz", degrees=True)
        return f"; its axes fit turned by roll {roll:.0f}, pitch {pitch:.0f}, yaw {yaw:.0f} deg more"
    return ": another platform, or another clock?"


def _rms(vectors: Floats) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def _span(time_ns: Times) -> str:
    return f"{time_ns[0] / 1e9:.3f} to {time_ns[-1] / 1e9:.3f} s"
