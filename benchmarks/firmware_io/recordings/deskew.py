"""Plain reference of the de-skew, in NumPy and float64, a scan at a time: `place` for tests and benchmarks.

A beam of time t, range r and bearing b is at

    p_map = T_map_world(t) @ T_world_laser(joint(t + lag)) @ [r cos b, r sin b, 0, 1]
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64, UInt8
from numpy import ndarray

from scanwright.design import frames
from scanwright.design.angles import AngleSet
from scanwright.firmware_io.assembly.beam_outcome import Verdict, beam_verdicts
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.poses.trajectory import Trajectory
from scanwright.firmware_io.samples import AxisCurve, JointLog, Scan


@dataclass(frozen=True, slots=True, eq=False)
class PlacedScan:
    """One scan in the world; row i is beam i."""

    scan: Scan
    time_ns: Int64[ndarray, " n"]  # shape (n,)
    joint_rad: Float64[ndarray, " n"]  # servo angle of each beam, shape (n,), NaN outside the joint log
    verdict: UInt8[ndarray, " n"]  # a `Verdict` for each beam, shape (n,)
    points_m: Float64[ndarray, "n 3"]  # shape (n, 3), NaN if the verdict is not POINT


def deskew(scan: Scan, joint: JointLog | AxisCurve, angles: AngleSet, lag_s: float = 0.0) -> Float64[ndarray, "n 3"]:
    """Return the points of one scan in the world [m], shape (n, 3), NaN without a point.

    `lag_s` is the delay of the joint log's stamps: the beam of time t has the angle logged at t + lag_s.
    """
    return next(place([scan], joint, angles, lag_s)).points_m


def place(
    scans: Iterable[Scan],
    joint: JointLog | AxisCurve,
    angles: AngleSet,
    lag_s: float = 0.0,
    *,
    poses: Trajectory | None = None,
    own_body: OwnBody | None = None,
) -> Iterator[PlacedScan]:
    """Place scans in the world one by one, or on the map of `poses`; `lag_s` as in `deskew`."""
    T_world_rot, T_rot_laser = angles.T_world_rot(0.0), angles.T_rot_laser()
    lag_ns = round(lag_s * 1e9)
    for scan in scans:
        time_ns = scan.time_ns
        joint_rad = joint.angle_at(time_ns + lag_ns)
        T_map_world = None if poses is None else poses.T_map_world(time_ns)
        verdict = beam_verdicts(scan, joint_rad, own_body, math.radians(angles.angles_deg.gamma_rot))
        if T_map_world is not None:
            verdict[(verdict == Verdict.POINT) & np.isnan(T_map_world[:, 0, 3])] = Verdict.OUTSIDE_POSES
        bearing_rad = scan.bearing_rad
        range_m = np.where(verdict == Verdict.POINT, scan.range_m.astype(np.float64), np.nan)
        points_rot = (
            np.multiply.outer(range_m * np.cos(bearing_rad), T_rot_laser[:3, 0])
            + np.multiply.outer(range_m * np.sin(bearing_rad), T_rot_laser[:3, 1])
            + T_rot_laser[:3, 3]
        )
        cos, sin = np.cos(joint_rad), np.sin(joint_rad)
        x, y, z = points_rot.T
        points = frames.apply(T_world_rot, np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1))
        if T_map_world is not None:
            points = np.einsum("nij,nj->ni", T_map_world[:, :3, :3], points) + T_map_world[:, :3, 3]
        yield PlacedScan(scan, time_ns, joint_rad, verdict, points)
