"""De-skew: transformation of each beam with the frames at its time, compiled, for many scans on all cores.

A beam of time t, range r and bearing b is at

    p_map = T_map_world(t) @ T_world_laser(joint(t + lag)) @ [r cos b, r sin b, 0, 1]

The chain needs no matrix for each beam: the joint turns about the z of the rotation frame, and the platform, between
two of its poses, about one axis that a constant rotation turns to z. The rest is a range times a direction (a table,
constant in the rotation frame), a turn about z and a constant transform, and a second such pair if the platform moves.
The arithmetic is float64 in vector registers; ranges and points are float32.

The compiler's cache is keyed by file and line, and names the modules of the argument classes (`PosePieces`): to move
one of these, shift a line here, or an old cache imports a module that no longer exists.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64, UInt8
from numba import njit
from numpy import ndarray

from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Array, Bytes, Float32s, Floats, Mask, Times
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.firmware_io.assembly.beam_outcome import Verdict
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.poses.trajectory import PosePieces, Trajectory, at_rest
from scanwright.firmware_io.samples import AxisCurve, Block, JointLog, Scan, straight


@dataclass(frozen=True, slots=True, eq=False)
class PlacedBlock:
    """Scans in the world; rows are scans, columns beams."""

    joint_rad: Float64[ndarray, "rows beams"]  # NaN outside the joint log; (0, n) if it was not requested
    verdict: UInt8[ndarray, "scans beams"]  # shape (s, n)
    points_m: Float32[ndarray, "scans beams 3"]  # shape (s, n, 3), NaN where the verdict is not POINT


def place_block(
    block: Block,
    joint: JointLog | AxisCurve,
    angles: AngleSet,
    lag_s: float = 0.0,
    *,
    poses: Trajectory | None = None,
    own_body: OwnBody | None = None,
    with_joint: bool = True,
) -> PlacedBlock:
    """Place scans in the world, or on the map of `poses`; the beam of time t has the angle logged at t + lag_s."""
    scans, beams = block.range_m.shape
    curve = straight(joint) if isinstance(joint, JointLog) else joint
    fan = _fan(block.first, angles, own_body)
    T_world_rot = angles.T_world_rot(0.0)
    if poses is None:
        pieces = at_rest(T_world_rot)
    else:
        ends_ns = block.stamp_ns.min(), block.stamp_ns.max() + math.ceil(fan.offset_ns[-1])
        pieces = poses.pieces(int(ends_ns[0]), int(ends_ns[1]), T_world_rot)
    logged_ns = block.stamp_ns + round(lag_s * 1e9)
    points_m = np.empty((scans, 3 * beams), np.float32)
    verdict = np.empty((scans, beams), np.uint8)
    joint_rad = np.empty((scans if with_joint else 0, beams))
    range_m = block.range_m.view()
    range_m.flags.writeable = False  # as those of a recording are: the kernel is compiled for one kind only

    def work(rows: slice) -> None:
        _place(
            block.stamp_ns[rows],
            logged_ns[rows],
            range_m[rows],
            fan,
            curve.knot_ns,
            curve.coefficient,
            pieces,
            joint_rad[rows],
            verdict[rows],
            points_m[rows],
        )

    in_chunks(work, scans, smallest=64)
    return PlacedBlock(joint_rad, verdict, points_m.reshape(scans, beams, 3))


class _Fan(NamedTuple):
    """What all scans of a block share, as the kernel wants it.

    Attributes:
        stator: whether it hides a beam at each of g equal steps of the axis angle, shape (n, g); (n, 0) if none does.
    """

    x: Floats  # direction of each beam in the rotation frame, shape (n,); so y, z
    y: Floats
    z: Floats
    origin_m: Floats  # where the beams start in the rotation frame, shape (3,)
    offset_ns: Floats  # time of each beam after the stamp, whole numbers, not decreasing, shape (n,)
    near_m: np.float32  # shortest and `far_m` longest range that means something
    far_m: np.float32
    verdict: Bytes  # OWN_BODY for a beam that the own body hides at every axis angle, else POINT, shape (n,)
    stator: Mask
    gamma_rot_rad: float  # axis angle at joint position 0


def _fan(scan: Scan, angles: AngleSet, own_body: OwnBody | None) -> _Fan:
    bearing_rad, T_rot_laser = scan.bearing_rad, angles.T_rot_laser()
    x, y, z = np.ascontiguousarray(
        np.multiply.outer(T_rot_laser[:3, 0], np.cos(bearing_rad))
        + np.multiply.outer(T_rot_laser[:3, 1], np.sin(bearing_rad))
    )
    none = np.zeros(bearing_rad.size, np.bool_), np.zeros((bearing_rad.size, 0), np.bool_)
    beams, stator = none if own_body is None else own_body.tables(bearing_rad)
    return _Fan(
        x=x,
        y=y,
        z=z,
        origin_m=np.ascontiguousarray(T_rot_laser[:3, 3]),
        offset_ns=(scan.time_ns - scan.stamp_ns).astype(np.float64),
        near_m=np.float32(scan.range_min_m),
        far_m=np.float32(scan.range_max_m),
        verdict=np.where(beams, Verdict.OWN_BODY, Verdict.POINT).astype(np.uint8),
        stator=stator,
        gamma_rot_rad=math.radians(angles.angles_deg.gamma_rot),
    )


_POINT, _NO_RETURN, _TOO_NEAR, _TOO_FAR, _NO_ANGLE, _OWN_BODY, _NO_POSE, *_ = map(np.uint8, Verdict)
_TURN = 2 * math.pi
_ROUND = 6755399441055744.0  # 1.5 * 2^52: adding and taking it away rounds to a whole number
_CONTRACT = {"contract"}  # a * b + c in one instruction; keeps NaN and the order of sums


@njit(inline="always", fastmath=_CONTRACT)
def _sin_cos(angle_rad: float) -> tuple[float, float]:
    """Sine and cosine within 2e-11, from polynomials: a call to the library's would end the vector loop."""
    # Taylor's of degree 15 and 16 on half the angle, which whole turns change by pi: its sign cancels below
    half = 0.5 * angle_rad
    half -= math.pi * ((half * (1 / math.pi) + _ROUND) - _ROUND)
    q = half * half
    s = -1 / 1307674368000
    s = 1 / 6227020800 + q * s
    s = -1 / 39916800 + q * s
    s = 1 / 362880 + q * s
    s = -1 / 5040 + q * s
    s = 1 / 120 + q * s
    s = -1 / 6 + q * s
    s = half + half * q * s
    c = 1 / 20922789888000
    c = -1 / 87178291200 + q * c
    c = 1 / 479001600 + q * c
    c = -1 / 3628800 + q * c
    c = 1 / 40320 + q * c
    c = -1 / 720 + q * c
    c = 1 / 24 + q * c
    c = -1 / 2 + q * c
    c = 1 + q * c
    return 2 * s * c, 1 - 2 * s * s


@njit(nogil=True)
def _before(time_ns: Times, end_ns: int) -> int:
    """How many of ascending times, whole numbers, lie before an end: numpy's search compiles ten times as long."""
    low, high = 0, time_ns.size
    while low < high:
        middle = (low + high) // 2
        if time_ns[middle] < end_ns:
            low = middle + 1
        else:
            high = middle
    return low


@njit(inline="always")
def _run(begin_ns: int, offset_ns: Floats, at: int, knot_ns: Times) -> tuple[int, int]:
    """The piece that beam `at` falls into (-1: none), and the first beam behind it that does not."""
    time_ns = begin_ns + int(offset_ns[at])
    if time_ns < knot_ns[0]:
        return -1, _before(offset_ns, knot_ns[0] - begin_ns)
    if time_ns > knot_ns[-1]:
        return -1, offset_ns.size
    piece = _before(knot_ns, time_ns + 1) - 1
    if piece >= knot_ns.size - 2:
        return knot_ns.size - 2, _before(offset_ns, knot_ns[-1] - begin_ns + 1)
    return piece, _before(offset_ns, knot_ns[piece + 1] - begin_ns)


@njit(cache=True, nogil=True, fastmath=_CONTRACT)
def _axis_angle(begin_ns: int, offset_ns: Floats, knot_ns: Times, coefficient: Floats, angle_rad: Floats) -> None:
    at = 0
    while at < offset_ns.size:
        piece, end = _run(begin_ns, offset_ns, at, knot_ns)
        if piece < 0:
            angle_rad[at:end] = np.nan
        else:
            since_s = (begin_ns - knot_ns[piece]) * 1e-9
            c0, c1, c2, c3 = coefficient[piece]
            for k in range(at, end):
                s = since_s + offset_ns[k] * 1e-9
                angle_rad[k] = c0 + s * (c1 + s * (c2 + s * c3))
        at = end


@njit(cache=True, nogil=True)
def _judge(range_m: Float32s, angle_rad: Floats, fan: _Fan, verdict: Bytes) -> None:
    near_m, far_m = fan.near_m, fan.far_m
    for k in range(range_m.size):
        r = range_m[k]
        outcome = fan.verdict[k]
        outcome = _NO_ANGLE if angle_rad[k] != angle_rad[k] else outcome
        outcome = _TOO_FAR if r > far_m else outcome
        outcome = _TOO_NEAR if r < near_m else outcome
        verdict[k] = _NO_RETURN if (r != r) | (r == np.inf) | (r == 0) else outcome
    steps = fan.stator.shape[1]
    if steps:
        for k in range(range_m.size):
            if verdict[k] == _POINT:
                step = int(np.rint((angle_rad[k] + fan.gamma_rot_rad) * (steps / _TURN))) % steps
                verdict[k] = _OWN_BODY if fan.stator[k, step] else _POINT


# Each loop below writes one array and has its constants in names: with more arrays, or constants in an array that is
# written, the compiler does not vectorise.


@njit(cache=True, nogil=True, fastmath=_CONTRACT)
def _spin(
    range_m: Float32s, verdict: Bytes, angle_rad: Floats, fan: _Fan, at: int, R: Floats, t: Floats, out_m: Array
) -> None:
    """Points `R Rz(angle) (direction range + origin) + t` of the beams from `at` on."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = R.flat
    t0, t1, t2 = t
    x0, y0, z0 = fan.origin_m
    dx, dy, dz = fan.x[at:], fan.y[at:], fan.z[at:]
    for k in range(range_m.size):
        r = np.float64(range_m[k]) if verdict[k] == _POINT else np.nan
        sin, cos = _sin_cos(angle_rad[k])
        x = dx[k] * r + x0
        y = dy[k] * r + y0
        z = dz[k] * r + z0
        p0 = cos * x - sin * y
        p1 = sin * x + cos * y
        out_m[3 * k] = r00 * p0 + r01 * p1 + r02 * z + t0
        out_m[3 * k + 1] = r10 * p0 + r11 * p1 + r12 * z + t1
        out_m[3 * k + 2] = r20 * p0 + r21 * p1 + r22 * z + t2


@njit(cache=True, nogil=True, fastmath=_CONTRACT)
def _ride(
    p_m: Floats, offset_ns: Floats, begin_ns: float, rate: float, poses: PosePieces, i: int, out_m: Float32s
) -> None:
    """Set points to `R Rz(u turn) p + t + u shift` in piece i, with u = (begin + offset) rate of each beam."""
    turn_rad = poses.turn_rad[i]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = poses.R_then[i].flat
    t0, t1, t2 = poses.t_then[i]
    v0, v1, v2 = poses.shift_m[i]
    for k in range(offset_ns.size):
        u = (begin_ns + offset_ns[k]) * rate
        sin, cos = _sin_cos(turn_rad * u)
        x, y, z = p_m[3 * k], p_m[3 * k + 1], p_m[3 * k + 2]
        p0 = cos * x - sin * y
        p1 = sin * x + cos * y
        out_m[3 * k] = r00 * p0 + r01 * p1 + r02 * z + (t0 + u * v0)
        out_m[3 * k + 1] = r10 * p0 + r11 * p1 + r12 * z + (t1 + u * v1)
        out_m[3 * k + 2] = r20 * p0 + r21 * p1 + r22 * z + (t2 + u * v2)


@njit(cache=True, nogil=True, fastmath=_CONTRACT)
def _place(
    stamp_ns: Times,
    logged_ns: Times,
    range_m: Float32s,
    fan: _Fan,
    knot_ns: Times,
    coefficient: Floats,
    poses: PosePieces,
    joint_rad: Floats,
    verdict: Bytes,
    points_m: Float32s,
) -> None:
    beams = range_m.shape[1]
    angle, spun = np.empty(beams), np.empty(3 * beams)
    for s in range(stamp_ns.size):
        _axis_angle(logged_ns[s], fan.offset_ns, knot_ns, coefficient, angle)
        _judge(range_m[s], angle, fan, verdict[s])
        if joint_rad.shape[0]:
            for k in range(beams):  # a row set at once brings the words of its errors, a second to compile
                joint_rad[s, k] = angle[k]
        at = 0
        while at < beams:
            i, end = _run(stamp_ns[s], fan.offset_ns, at, poses.time_ns)
            ranges, judged, angles = range_m[s, at:end], verdict[s, at:end], angle[at:end]
            points = points_m[s, 3 * at : 3 * end]
            if i < 0:
                points[:] = np.nan
                for k in range(end - at):
                    judged[k] = _NO_POSE if judged[k] == _POINT else judged[k]
            elif poses.moves[i]:
                since = np.float64(stamp_ns[s] - poses.time_ns[i])
                rate = 1 / np.float64(poses.time_ns[i + 1] - poses.time_ns[i])
                _spin(ranges, judged, angles, fan, at, poses.R_first[i], poses.t_first[i], spun)
                _ride(spun, fan.offset_ns[at:end], since, rate, poses, i, points)
            else:
                _spin(ranges, judged, angles, fan, at, poses.R_first[i], poses.t_first[i], points)
            at = end
