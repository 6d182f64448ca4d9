"""Trajectory of the platform: poses of the `world` frame (the robot with the scanner) on a map, over time.

Between two poses the position is interpolated linearly and the orientation by slerp; the error by an acceleration a is
at most a h^2 / 8 for poses h apart. Outside the poses: NaN. Unusable input raises RecordingError.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray
from numpy.typing import NDArray

from scanwright.design import frames
from scanwright.design.arrays import Floats, Pose, Times
from scanwright.design.errors import RecordingError

_NORM_ERROR = 1e-2  # of a quaternion printed with three digits
_FARTHEST_M = 1e8  # geocentric maps are 6.4e6 m from the Earth's centre
_EVER_NS = 2**62  # half of an int64: differences of two times still fit


class PosePieces(NamedTuple):
    """Poses factored for the kernel.

    Between two of them, at the fraction u in [0, 1], with p rotated by the joint, p_map = R_then Rz(u turn)
    (R_first p + t_first) + t_then + u shift; if `moves` is false, p_map = R_first p + t_first.
    """

    time_ns: Times  # (k + 1,)
    moves: NDArray[np.bool_]  # (k,)
    R_first: Floats  # (k, 3, 3)
    t_first: Floats  # (k, 3)
    turn_rad: Floats  # (k,)
    R_then: Floats  # (k, 3, 3)
    t_then: Floats  # (k, 3)
    shift_m: Floats  # (k, 3)


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses over time."""

    time_ns: Int64[ndarray, " n"]  # n >= 2, strictly increasing
    position_m: Float64[ndarray, "n 3"]
    quaternion: Float64[ndarray, "n 4"]  # x y z w, unit length
    platform: str = ""  # name of the moving frame; "" if unknown
    measured: Trajectory | None = None  # poses without the orientations of a gyro; None without a gyro

    def __post_init__(self) -> None:
        count = self.time_ns.size
        if count < 2:
            raise RecordingError(f"{count} poses: at least two are needed to go between them")
        if self.position_m.shape != (count, 3) or self.quaternion.shape != (count, 4):
            raise RecordingError(
                f"{count} times, positions {self.position_m.shape}, quaternions {self.quaternion.shape}"
            )
        values = np.hstack([self.position_m, self.quaternion])
        if not np.isfinite(values).all():
            raise RecordingError(f"pose {int(np.argmin(np.isfinite(values).all(axis=1))) + 1}: not a finite number")
        if (farthest_m := float(np.abs(self.position_m).max())) > _FARTHEST_M:
            raise RecordingError(f"a position of {farthest_m:.3g} m: at most {_FARTHEST_M:g}")
        with np.errstate(over="ignore"):
            norm = np.linalg.norm(self.quaternion, axis=1)
        if np.any(np.abs(norm - 1) > _NORM_ERROR):
            worst = int(np.argmax(np.abs(norm - 1)))
            raise RecordingError(
                f"pose {worst + 1}: quaternion of length {norm[worst]:.4g}: 1; the order is qx qy qz qw"
            )
        if np.any(np.diff(self.time_ns) <= 0):
            raise RecordingError(
                f"pose {int(np.argmax(np.diff(self.time_ns) <= 0)) + 2}: not later than the one before it"
            )

    def T_map_world(self, time_ns: Int64[ndarray, " k"]) -> Float64[ndarray, "k 4 4"]:
        """Return the pose at each time, shape (n, 4, 4), NaN outside."""
        from scipy.spatial.transform import Rotation, Slerp  # heavy, and not needed for a platform at rest

        inside = (time_ns >= self.time_ns[0]) & (time_ns <= self.time_ns[-1])
        # float64 rounds nanoseconds since 1970, but not differences
        origin_ns = self.time_ns[0]
        known_s = (self.time_ns - origin_ns) / 1e9
        query_s = (np.where(inside, time_ns, origin_ns) - origin_ns) / 1e9
        query_s = query_s.clip(0, known_s[-1])
        R = Slerp(known_s, Rotation.from_quat(self.quaternion))(query_s).as_matrix()
        t = np.stack([np.interp(query_s, known_s, column) for column in self.position_m.T], axis=1)
        T = frames.rigid(R, t)
        T[~inside] = np.nan
        return T

    def pieces(self, first_ns: int, last_ns: int, T_world_rot: Pose) -> PosePieces:
        """Return the poses between two times, combined with the constant `T_world_rot`."""
        from scipy.spatial.transform import Rotation

        begin, end = np.searchsorted(self.time_ns, [first_ns, last_ns], side="right")
        begin = min(max(int(begin) - 1, 0), self.time_ns.size - 2)
        near = slice(begin, max(int(end) + 1, begin + 2))
        position_m, quaternion = self.position_m[near], self.quaternion[near]
        R = Rotation.from_quat(quaternion[:-1]).as_matrix()
        turn = (Rotation.from_quat(quaternion[:-1]).inv() * Rotation.from_quat(quaternion[1:])).as_rotvec()
        turn_rad = np.linalg.norm(turn, axis=1)
        turning = turn_rad > 0
        axis = np.where(turning[:, None], turn / np.where(turning, turn_rad, 1.0)[:, None], [0.0, 0.0, 1.0])
        shift_m = np.diff(position_m, axis=0)
        moves = turning | np.any(shift_m != 0, axis=1)
        R_platform_axis = _with_z(axis)
        still = ~moves[:, None, None]
        R_before = np.where(still, R, np.swapaxes(R_platform_axis, 1, 2))
        t_before = np.where(moves[:, None], 0.0, position_m[:-1])
        return PosePieces(
            time_ns=self.time_ns[near],
            moves=moves,
            R_first=np.ascontiguousarray(R_before @ T_world_rot[:3, :3]),
            t_first=R_before @ T_world_rot[:3, 3] + t_before,
            turn_rad=turn_rad,
            R_then=np.ascontiguousarray(R @ R_platform_axis),
            t_then=position_m[:-1],
            shift_m=shift_m,
        )

    def error(self) -> tuple[float, float]:
        """Estimate the largest interpolation error, in m and rad, from the poses; NaN for two poses.

        Each pose is predicted from its two neighbours. They are twice as far apart as poses, so the difference is four
        times the error (a h^2 / 8). Vibration between poses is not included.
        """
        from scipy.spatial.transform import Rotation

        if self.time_ns.size < 3:
            return float("nan"), float("nan")
        gap_s = np.diff(self.time_ns) / 1e9
        part = gap_s[:-1] / (gap_s[:-1] + gap_s[1:])
        p = self.position_m
        miss_m = p[:-2] + part[:, None] * (p[2:] - p[:-2]) - p[1:-1]
        R = Rotation.from_quat(self.quaternion)
        step = (R[:-2].inv() * R[2:]).as_rotvec()
        miss = (R[:-2] * Rotation.from_rotvec(part[:, None] * step)).inv() * R[1:-1]
        return float(np.linalg.norm(miss_m, axis=1).max() / 4), float(miss.magnitude().max() / 4)


def trajectory_of(time_ns: Sequence[int], poses: Sequence[Sequence[float]], platform: str = "") -> Trajectory:
    """Return the trajectory of poses x y z qx qy qz qw with rounded quaternions; `platform`: the moving frame."""
    values = np.array(poses, float).reshape(-1, 7)
    quaternion = values[:, 3:]
    with np.errstate(over="ignore"):
        norm = np.linalg.norm(quaternion, axis=1, keepdims=True)
    close = np.abs(norm - 1) < _NORM_ERROR
    return Trajectory(
        np.array(time_ns, np.int64),
        np.ascontiguousarray(values[:, :3]),
        np.where(close, quaternion / np.where(close, norm, 1.0), quaternion),
        platform,
    )


def at_rest(T_world_rot: Pose) -> PosePieces:
    """Return the pieces of a platform at rest."""
    none = np.zeros((1, 3))
    return PosePieces(
        time_ns=np.array([-_EVER_NS, _EVER_NS]),
        moves=np.zeros(1, np.bool_),
        R_first=np.ascontiguousarray(T_world_rot[None, :3, :3]),
        t_first=np.ascontiguousarray(T_world_rot[None, :3, 3]),
        turn_rad=np.zeros(1),
        R_then=np.eye(3)[None],
        t_then=none,
        shift_m=none,
    )


def _with_z(axis: Floats) -> Floats:
    """Return rotations whose third columns are the unit vectors, shape (n, 3, 3)."""
    # T. Duff and others, "Building an Orthonormal Basis, Revisited" (2017)
    x, y, z = axis.T
    side = np.copysign(1.0, z)
    a = -1 / (side + z)
    b = x * y * a
    columns = (1 + side * x * x * a, side * b, -side * x), (b, side + y * y * a, -y), (x, y, z)
    return np.array(columns).transpose(2, 1, 0)
