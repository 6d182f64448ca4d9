"""A cloud prepared for registration: thinned at two scales, with normals and the depth map of its scanner.

Unusable input raises RecordingError.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
import small_gicp
from jaxtyping import Float64
from numpy import ndarray

from scanwright.design.angles import AngleSet
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.registration.cube_map import DepthMap, depth_map
from scanwright.firmware_io.registration.surfels.beams import Beams
from scanwright.firmware_io.registration.thin import beam_step_rad, thin, voxel_means

THREADS = os.cpu_count() or 1  # all processors
_NEIGHBOURS = 10  # more of them round off corners: benchmarks/firmware_io/registration.py
_COARSE = 4  # times the spacing
_MIN_POINTS = 200  # too few for surfaces below
_DEPTH_SIDE = 30  # cells of 3 deg: in finer ones mixed pixels at edges, and gaps between lines, become contradictions


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """Points at one scale, for small_gicp."""

    points_m: Float64[ndarray, "n 3"]  # shape (n, 3)
    normals: Float64[ndarray, "n 3"]  # unit, towards the scanner, shape (n, 3); zero if the neighbours give none
    cloud: small_gicp.PointCloud  # the same with the covariances of the neighbourhoods
    tree: small_gicp.KdTree  # nearest-neighbour search in it


@dataclass(frozen=True, slots=True, eq=False)
class SensorView:
    """The data of one scan position, in the frame of its scanner, with the origin in the optical centre."""

    name: str  # for messages
    spacing_m: float  # edge of the finest voxels
    fine: Level  # points about `spacing_m` apart
    coarse: Level  # points about four times as far apart
    depth: DepthMap
    beams: Beams  # all measurements


def make_view(
    name: str,
    points_m: Float64[ndarray, "n 3"],
    spacing_m: float,
    scanner: AngleSet | None = None,
    joint_rad: Float64[ndarray, " n"] | None = None,
) -> SensorView:
    """Prepare a cloud for registration: points of shape (n, 3), as measured; rows with NaN are left out.

    `scanner`: angle set that the cloud was assembled with, if its covariance is used; it requires the angle of the axis
    at each point, `joint_rad`, shape (n,).
    """
    points_m = np.ascontiguousarray(points_m, float)
    finite = np.isfinite(points_m).all(axis=1)
    joint_rad = _joints(name, scanner, joint_rad)
    if not finite.all():
        points_m, joint_rad = points_m[finite], joint_rad[finite[: len(joint_rad)]]
    voxels_m, counts = voxel_means(points_m, points_m, spacing_m)
    thinned = thin(voxels_m, counts, spacing_m, beam_step_rad(points_m)) if len(points_m) > 1 else points_m
    if len(thinned) < _MIN_POINTS:
        raise RecordingError(
            f"{name}: {len(thinned)} points {spacing_m:g} m apart: register needs at least {_MIN_POINTS}"
        )
    coarse, _ = voxel_means(thinned, thinned, _COARSE * spacing_m)
    eye_m, frame, covariance = np.zeros(3), np.zeros((3, 2)), None
    if scanner is not None:
        T = scanner.T_world_rot(0.0)
        eye_m, frame, covariance = T[:3, 3].copy(), T[:3, :2].copy(), np.array(scanner.covariance)
    turned = np.remainder(joint_rad, 2 * np.pi).astype(np.float32)
    beams = Beams(points_m.astype(np.float32), voxels_m, counts, eye_m, turned, frame, covariance)
    return SensorView(name, spacing_m, make_level(thinned), make_level(coarse), depth_map(thinned, _DEPTH_SIDE), beams)


def make_level(points_m: Float64[ndarray, "n 3"]) -> Level:
    """Return points with normals and a search tree."""
    cloud = small_gicp.PointCloud(points_m)
    tree = small_gicp.KdTree(cloud, num_threads=THREADS)
    small_gicp.estimate_normals_covariances(cloud, tree, _NEIGHBOURS, THREADS)
    normals = np.asarray(cloud.normals())[:, :3]
    away = np.einsum("ij,ij->i", normals, points_m) > 0
    return Level(points_m, np.where(away[:, None], -normals, normals), cloud, tree)


def _joints(
    name: str, scanner: AngleSet | None, joint_rad: Float64[ndarray, " n"] | None
) -> Float64[ndarray, " joints"]:
    if scanner is None:
        return np.empty(0)
    if scanner.covariance is None:
        raise RecordingError("the angle set has no covariance: `scanwright calibrate` writes one that has it")
    if joint_rad is None:
        raise RecordingError(
            f"{name}: no column joint_rad, which the effect of calibration errors on a point depends on: "
            "assemble the cloud with it, or register without the angle set"
        )
    return joint_rad
