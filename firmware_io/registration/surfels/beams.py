"""Normal equations of each piece of surface, summed over the beams that end on it.

A beam measures a range, and its noise lies along the beam. If a plane is raised by `c0 + c1 u + c2 v` [m] and a point
is moved by `dp`, the expected range changes by `(c0 + c1 u + c2 v - n.dp) / n.d`. Divided by `n.d`, all beams have the
noise of a range, and no beam shares its noise with another. The point where a beam crosses the plane does not depend
on that noise, so a selection by it (the beams of a piece, their levers) is unbiased.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64, Int64
from numba import njit
from numpy import ndarray

from scanwright.design.arrays import Float32s, Floats, Ints
from scanwright.firmware_io.registration.surfels.cells import Cells, Lookup

UNKNOWNS = 13
"""Three of the plane, six of the pose (rotation vector [rad], translation [m]), four of the calibration."""

_Triple = tuple[float, float, float] | Floats
_GRAZING = 0.15  # cosine to the normal: beams that graze spread over more than the noise of a range
_part = njit(error_model="numpy", inline="always")  # a call would copy the records: 1.5 times the time in all
_OFF, _BESIDE, _ON = 0, 1, 2  # a beam ends in the cube but off the plane; not on this piece; on it


@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """The measurements of one scan position; `joint_rad` and `covariance` only if the calibration is uncertain."""

    points_m: Float32[ndarray, "n 3"]  # in the frame of the cloud
    voxels_m: Float64[ndarray, "k 3"]  # means of small voxels
    counts: Int64[ndarray, " k"]  # points of each voxel
    eye_m: Float64[ndarray, " 3"]  # origin of the beams
    joint_rad: Float32[ndarray, " joints"]  # angle of the axis at each beam, or empty
    frame: Float64[ndarray, "3 2"]  # columns x and y of the rotation frame in that of the cloud, at joint 0
    covariance: Float64[ndarray, "4 4"] | None  # of the laser's tilt about x, y [rad] and offset along them [m]


class BeamRun(NamedTuple):
    """Part of the beams of one scan position for the compiled sum; the first four fields are those of `Beams`."""

    points_m: Float32s
    eye_m: Floats
    joint_rad: Float32s
    frame: Floats
    T: Floats  # pose of the cloud in the frame of the pieces, shape (4, 4)
    moves: bool  # whether that pose is unknown


@njit(cache=True, nogil=True, error_model="numpy")
def sum_beams(run: BeamRun, cells: Cells, lookup: Lookup) -> tuple[Floats, Ints, Ints]:
    """Return the normal equations of each piece, its number of beams, and the number in its cube off its plane.

    Returns:
        Shapes (m, 14, 14), the last row and column being the residuals of the ranges; (m,); (m,).
    """
    m = len(cells.edge_m)
    sums = np.zeros((m, UNKNOWNS + 1, UNKNOWNS + 1))
    on, off = np.zeros(m, np.int64), np.zeros(m, np.int64)
    row, eye, p, d, q = np.zeros(UNKNOWNS + 1), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    _move(run.T, run.eye_m, eye)
    key_before, place = np.int64(-1), -1
    for i in range(len(run.points_m)):
        _move(run.T, (run.points_m[i, 0], run.points_m[i, 1], run.points_m[i, 2]), p)
        key = _key(p, lookup.edge_m)
        if key != key_before:
            key_before = key
            place = int(np.searchsorted(lookup.keys, key))
            if place == len(lookup.keys) or lookup.keys[place] != key:
                place = -1
        if place < 0 or not _direction(p, eye, d):
            continue
        for j in range(lookup.first[place], lookup.first[place + 1]):
            c = lookup.cells[j]
            end, slant, height = _cross(cells, c, p, d, q)
            off[c] += end == _OFF
            if end == _ON:
                on[c] += 1
                _differentiate(run, cells, i, c, q, row)
                row[UNKNOWNS] = -height
                _add(sums, c, row, 1.0 / (slant * slant))
                break
    for c in range(m):
        for k in range(UNKNOWNS + 1):
            for other in range(k):
                sums[c, other, k] = sums[c, k, other]
    return sums, on, off


@_part
def _move(T: Floats, point: _Triple, out: Floats) -> None:
    for k in range(3):
        out[k] = T[k, 3] + T[k, 0] * point[0] + T[k, 1] * point[1] + T[k, 2] * point[2]


@_part
def _key(p: Floats, edge_m: float) -> np.int64:
    """Return `cube_keys` of one point."""
    half = np.int64(1) << 20
    a, b, c = np.int64(np.floor(p[0] / edge_m)), np.int64(np.floor(p[1] / edge_m)), np.int64(np.floor(p[2] / edge_m))
    return ((a + half) << 42) | ((b + half) << 21) | (c + half)


@_part
def _direction(p: Floats, eye: Floats, d: Floats) -> bool:
    """Set `d` to the unit vector of the beam; False if its length is 0."""
    length = np.sqrt((p[0] - eye[0]) ** 2 + (p[1] - eye[1]) ** 2 + (p[2] - eye[2]) ** 2)
    if length == 0.0:
        return False
    for k in range(3):
        d[k] = (p[k] - eye[k]) / length
    return True


@_part
def _cross(cells: Cells, c: int, p: Floats, d: Floats, q: Floats) -> tuple[int, float, float]:
    """Return where the beam to `p` ends at piece `c`, its slant and the height of `p` over the plane [m].

    `q` is set to the point at which the beam crosses the plane.
    """
    slant, height, across, inside = 0.0, 0.0, 0, True
    for k in range(3):
        normal = cells.axes[c, 2, k]
        slant += normal * d[k]
        height += normal * (p[k] - cells.centre_m[c, k])
        inside &= 0.0 <= p[k] - cells.low_m[c, k] < cells.edge_m[c]
        if abs(normal) > abs(cells.axes[c, 2, across]):
            across = k
    if abs(slant) < _GRAZING:
        return _BESIDE, slant, height
    lacks = height / slant
    if abs(lacks) > cells.reach_m:
        return (_OFF if inside else _BESIDE), slant, height
    for k in range(3):
        q[k] = p[k] - lacks * d[k]
        # A plane may lie just outside its cube, so the faces across its normal bound nothing
        if k != across and not 0.0 <= q[k] - cells.low_m[c, k] < cells.edge_m[c]:
            return _BESIDE, slant, height
    return _ON, slant, height


@_part
def _differentiate(run: BeamRun, cells: Cells, i: int, c: int, q: Floats, row: Floats) -> None:
    """Set `row` to the derivatives of the height of beam `i` over piece `c` with respect to the unknowns."""
    axes, off = cells.axes, (q[0] - run.T[0, 3], q[1] - run.T[1, 3], q[2] - run.T[2, 3])
    n, q0 = _turn_back(run.T, (axes[c, 2, 0], axes[c, 2, 1], axes[c, 2, 2])), _turn_back(run.T, off)
    row[0], row[1], row[2] = -1.0, 0.0, 0.0
    for k in range(3):
        row[1] -= (q[k] - cells.centre_m[c, k]) * axes[c, 0, k] / cells.edge_m[c]
        row[2] -= (q[k] - cells.centre_m[c, k]) * axes[c, 1, k] / cells.edge_m[c]
    if run.moves:
        row[3], row[4], row[5] = _cross_product(q0, n)
        row[6], row[7], row[8] = n
    if len(run.joint_rad):
        cosine, sine = np.cos(run.joint_rad[i]), np.sin(run.joint_rad[i])
        lever = (q0[0] - run.eye_m[0], q0[1] - run.eye_m[1], q0[2] - run.eye_m[2])
        torque = _cross_product(lever, n)  # (e x lever) . n is e . (lever x n)
        row[9], row[10], row[11], row[12] = 0.0, 0.0, 0.0, 0.0
        for k in range(3):
            x = cosine * run.frame[k, 0] + sine * run.frame[k, 1]
            y = cosine * run.frame[k, 1] - sine * run.frame[k, 0]
            row[9] += x * torque[k]
            row[10] += y * torque[k]
            row[11] += x * n[k]
            row[12] += y * n[k]


@_part
def _turn_back(T: Floats, a: _Triple) -> _Triple:
    """Rotate into the frame of the cloud."""
    x, y, z = a[0], a[1], a[2]
    return (
        T[0, 0] * x + T[1, 0] * y + T[2, 0] * z,
        T[0, 1] * x + T[1, 1] * y + T[2, 1] * z,
        T[0, 2] * x + T[1, 2] * y + T[2, 2] * z,
    )


@_part
def _cross_product(a: _Triple, b: _Triple) -> _Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@_part
def _add(sums: Floats, c: int, row: Floats, weight: float) -> None:
    """Add the lower triangle of the weighted outer product of `row`."""
    for k in range(len(row)):
        if row[k] != 0.0:
            weighted = row[k] * weight
            for other in range(k + 1):
                sums[c, k, other] += weighted * row[other]
