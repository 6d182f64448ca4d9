"""Rotations and rigid transforms.

`T_a_b` maps coordinates in frame b to coordinates in frame a: `p_a = T_a_b @ p_b`. Neighbouring subscripts
cancel, so `T_world_laser = T_world_rot @ T_rot_laser` is easy to check. All frames are right-handed; metres
and radians. Frames: `world` (the robot), `rot` (the servo axis is z), `laser` (x forward, z the normal of the
scan plane).
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.typing import ArrayLike

from scanwright.design.arrays import Array, Pose, Rotation

STANDARD_GRAVITY_M_S2 = 9.80665  # along -z of `world`; exact by definition: 3rd CGPM (1901), Resolution 2


def Rx(angle_rad: ArrayLike) -> Float[ndarray, "*k 3 3"]:
    """Rotation about x, shape (..., 3, 3)."""
    return _axis_rotation(angle_rad, 0)


def Ry(angle_rad: ArrayLike) -> Float[ndarray, "*k 3 3"]:
    """Rotation about y, shape (..., 3, 3)."""
    return _axis_rotation(angle_rad, 1)


def Rz(angle_rad: ArrayLike) -> Float[ndarray, "*k 3 3"]:
    """Rotation about z, shape (..., 3, 3)."""
    return _axis_rotation(angle_rad, 2)


def R_world_rot(alpha_rad: ArrayLike, beta_rad: ArrayLike, gamma_rad: ArrayLike = 0.0) -> Float[ndarray, "*k 3 3"]:
    """Rotation frame in the world, `Rx(alpha_rot) Ry(beta_rot) Rz(gamma_rot)` (paper, section 4.1)."""
    return Rx(alpha_rad) @ Ry(beta_rad) @ Rz(gamma_rad)


def R_rot_laser(alpha_rad: ArrayLike, beta_rad: ArrayLike, gamma_rad: ArrayLike = 0.0) -> Float[ndarray, "*k 3 3"]:
    """Laser in the rotation frame, `Rz(gamma_laser) Ry(beta_laser) Rx(alpha_laser)` (paper, section 4.1)."""
    return Rz(gamma_rad) @ Ry(beta_rad) @ Rx(alpha_rad)


def rotvec_to_matrix(rotvec_rad: ArrayLike) -> Rotation:
    """Rotation about v by its length (Rodrigues), shape (3, 3)."""
    v = np.asarray(rotvec_rad, dtype=float)
    angle = float(np.linalg.norm(v))
    K = cross_matrix(v)
    # sin(a)/a and (1 - cos(a))/a^2 in forms that stay exact as a -> 0
    return np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (K @ K)


def cross_matrix(v: Float[ndarray, " 3"]) -> Float[ndarray, "3 3"]:
    """Return the matrix of v x, shape (3, 3)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rigid(R_a_b: Float[ndarray, "... 3 3"], t_a_b: ArrayLike) -> Float[ndarray, "*k 4 4"]:
    """4x4 transform from a rotation and the origin of b in a; leading axes broadcast."""
    t = np.asarray(t_a_b, dtype=float)
    T = np.zeros((*np.broadcast_shapes(R_a_b.shape[:-2], t.shape[:-1]), 4, 4))
    T[..., :3, :3] = R_a_b
    T[..., :3, 3] = t
    T[..., 3, 3] = 1.0
    return T


def apply(T_a_b: Pose, points_b: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Return points of frame b, shape (n, 3), in frame a."""
    return points_b @ T_a_b[:3, :3].T + T_a_b[:3, 3]


def roll_pitch_yaw(R: Rotation) -> tuple[float, float, float]:
    """URDF's fixed-axis angles [rad]: R = Rz(yaw) Ry(pitch) Rx(roll); yaw is 0 if the pitch is +-90 deg."""
    level = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], level)
    if level < 1e-9:
        return math.atan2(-R[1, 2], R[1, 1]), pitch, 0.0
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


def _axis_rotation(angle_rad: ArrayLike, axis: int) -> Array:
    angle = np.asarray(angle_rad, dtype=float)
    c, s = np.cos(angle), np.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R = np.zeros((*angle.shape, 3, 3))
    R[..., axis, axis] = 1.0
    R[..., j, j] = c
    R[..., k, k] = c
    R[..., j, k] = -s
    R[..., k, j] = s
    return R
