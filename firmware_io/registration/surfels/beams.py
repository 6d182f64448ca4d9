"""What every beam says of the piece of surface that it ends on: normal equations, summed by piece.

A beam measures a range, and its noise lies along it. A plane raised by `c0 + c1 u + c2 v` [m] and a point moved by `dp`
change what the range should be by `(c0 + c1 u + c2 v - n.dp) / n.d`: divided by `n.d`, all beams have the noise of a
range, and none shares it with another. Where the beam crosses the plane knows no noise either, so nothing that is
chosen by it (the beams of a piece, their levers) leans to one side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Float32s, Floats, Ints

UNKNOWNS = 13
"""Three of the plane, six of the pose (rotation vector [rad], translation [m]), four of the calibration."""

_GRAZING = 0.15  # cosine to the normal: beams that graze spread over more than the noise of a range


@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """What one stand measured, as it measured it.

    Attributes:
        points_m: in the frame of the stand, shape (n, 3).
        voxels_m: means of small voxels, shape (k, 3).
        counts: points of each voxel, shape (k,).
        eye_m: where the beams come from, shape (3,).
        joint_rad: angle of the axis at each beam, shape (n,); empty where the calibration is taken to be right.
        frame: columns x and y of the rotation frame in that of the stand, at joint 0, shape (3, 2).
        covariance: of the laser's tilt about them [rad] and its offset along them [m], shape (4, 4), of the scanner
            that made all clouds; None where the calibration is taken to be right.
    """

    points_m: Float32[ndarray, "n 3"]
    voxels_m: Float64[ndarray, "k 3"]
    counts: Int64[ndarray, " k"]
    eye_m: Float64[ndarray, " 3"]
    joint_rad: Float32[ndarray, " joints"]
    frame: Float64[ndarray, "3 2"]
    covariance: Float64[ndarray, "4 4"] | None


@njit(cache=True, nogil=True, error_model="numpy")
def sum_beams(
    points_m: Float32s,
    eye_m: Floats,
    joint_rad: Float32s,
    frame: Floats,
    T: Floats,
    moves: bool,
    edge_m: float,
    keys: Ints,
    first: Ints,
    numbers: Ints,
    low_m: Floats,
    edges_m: Floats,
    centres_m: Floats,
    axes: Floats,
    reach_m: float,
) -> tuple[Floats, Ints, Ints]:
    """Normal equations of each piece, how many beams end on it, and how many in its cube but off its plane.

    Args:
        points_m: of one stand, in its own frame, shape (n, 3).
        eye_m: where its beams come from, shape (3,).
        joint_rad: angle of its axis at each beam, shape (n,); empty where the calibration is not asked for.
        frame: columns x and y of the rotation frame at joint 0, shape (3, 2).
        T: pose of the stand in the frame of the pieces, shape (4, 4).
        moves: whether that pose is what is sought.
        edge_m: as in `firmware_io.registration.surfels.cells.Lookup`, like the next three.
        keys: shape (k,).
        first: shape (k + 1,).
        numbers: its `cells`.
        low_m: as in `firmware_io.registration.surfels.cells.Cells`, like the next four; shape (m, 3).
        edges_m: shape (m,).
        centres_m: shape (m, 3).
        axes: shape (m, 3, 3).
        reach_m: of all pieces.

    Returns:
        Shapes (m, 14, 14), the last row and column being what the ranges lack; (m,); (m,).
    """
    m = len(edges_m)
    sums = np.zeros((m, UNKNOWNS + 1, UNKNOWNS + 1))
    on, off = np.zeros(m, np.int64), np.zeros(m, np.int64)
    row = np.zeros(UNKNOWNS + 1)
    p, d, q, lever, n, q0 = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    half = np.int64(1) << 20
    key_before, place = np.int64(-1), -1
    for i in range(len(points_m)):
        length = 0.0
        for k in range(3):
            p[k] = T[k, 3] + T[k, 0] * points_m[i, 0] + T[k, 1] * points_m[i, 1] + T[k, 2] * points_m[i, 2]
            d[k] = p[k] - (T[k, 3] + T[k, 0] * eye_m[0] + T[k, 1] * eye_m[1] + T[k, 2] * eye_m[2])
            length += d[k] ** 2
        length = np.sqrt(length)
        key = (
            ((np.int64(np.floor(p[0] / edge_m)) + half) << 42)
            | ((np.int64(np.floor(p[1] / edge_m)) + half) << 21)
            | (np.int64(np.floor(p[2] / edge_m)) + half)
        )
        if key != key_before:
            key_before = key
            place = int(np.searchsorted(keys, key))
            if place == len(keys) or keys[place] != key:
                place = -1
        if place < 0 or length == 0.0:
            continue
        for j in range(first[place], first[place + 1]):
            c = numbers[j]
            slant, height, across, inside = 0.0, 0.0, 0, True
            for k in range(3):
                slant += axes[c, 2, k] * d[k] / length
                height += axes[c, 2, k] * (p[k] - centres_m[c, k])
                inside &= 0.0 <= p[k] - low_m[c, k] < edges_m[c]
                if abs(axes[c, 2, k]) > abs(axes[c, 2, across]):
                    across = k
            if abs(slant) < _GRAZING:
                continue
            lacks = height / slant
            if abs(lacks) > reach_m:
                off[c] += inside
                continue
            crosses = True
            for k in range(3):
                q[k] = p[k] - lacks * d[k] / length
                # Along the normal there is no face to be on either side of: a plane may lie just outside its cube
                crosses &= k == across or 0.0 <= q[k] - low_m[c, k] < edges_m[c]
            if not crosses:
                continue
            on[c] += 1
            row[0], row[1], row[2] = -1.0, 0.0, 0.0
            for k in range(3):
                row[1] -= (q[k] - centres_m[c, k]) * axes[c, 0, k] / edges_m[c]
                row[2] -= (q[k] - centres_m[c, k]) * axes[c, 1, k] / edges_m[c]
                n[k] = T[0, k] * axes[c, 2, 0] + T[1, k] * axes[c, 2, 1] + T[2, k] * axes[c, 2, 2]
                q0[k] = T[0, k] * (q[0] - T[0, 3]) + T[1, k] * (q[1] - T[1, 3]) + T[2, k] * (q[2] - T[2, 3])
            if moves:
                row[3] = q0[1] * n[2] - q0[2] * n[1]
                row[4] = q0[2] * n[0] - q0[0] * n[2]
                row[5] = q0[0] * n[1] - q0[1] * n[0]
                row[6], row[7], row[8] = n[0], n[1], n[2]
            if len(joint_rad):
                cosine, sine = np.cos(joint_rad[i]), np.sin(joint_rad[i])
                for k in range(3):
                    lever[k] = q0[k] - eye_m[k]
                # (e x lever) . n is e . (lever x n)
                torque = (
                    lever[1] * n[2] - lever[2] * n[1],
                    lever[2] * n[0] - lever[0] * n[2],
                    lever[0] * n[1] - lever[1] * n[0],
                )
                row[9], row[10], row[11], row[12] = 0.0, 0.0, 0.0, 0.0
                for k in range(3):
                    x = cosine * frame[k, 0] + sine * frame[k, 1]
                    y = cosine * frame[k, 1] - sine * frame[k, 0]
                    row[9] += x * torque[k]
                    row[10] += y * torque[k]
                    row[11] += x * n[k]
                    row[12] += y * n[k]
            row[UNKNOWNS] = -height
            for k in range(UNKNOWNS + 1):
                if row[k] != 0.0:
                    weighted = row[k] / slant**2
                    for other in range(k + 1):
                        sums[c, k, other] += weighted * row[other]
            break
    for c in range(m):
        for k in range(UNKNOWNS + 1):
            for other in range(k):
                sums[c, other, k] = sums[c, k, other]
    return sums, on, off
