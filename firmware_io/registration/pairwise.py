"""Pose of one scan position relative to another: small_gicp from a start, then an adjustment, and tests of the result.

The final pose comes from an adjustment of the common flat surfaces (`firmware_io.registration.surfels`), or from
small_gicp if these are too few. The solver also converges in a wrong room, so the result is tested by the share of
either cloud that lies on the other, the share in space that the other scanner measured to be free, and whether the
common surfaces hold all six degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import small_gicp
from jaxtyping import Bool, Float64, Int64
from numpy import ndarray

from scanwright.design import frames
from scanwright.design.arrays import Floats, Pose
from scanwright.firmware_io.clouds.filters import voxel_sums
from scanwright.firmware_io.registration.cube_map import cells_of
from scanwright.firmware_io.registration.sensor_view import THREADS, Level, SensorView, make_level
from scanwright.firmware_io.registration.surfels.adjust import adjust

_COARSE_REACH_M = 1.0  # of the first alignment: the largest error of a start
_COARSE_NEAR = 3  # times the spacing
_FINE_REACH = 1.5  # times the spacing: farther neighbours pull towards surfaces that the other scanner did not measure
_STEP_RAD = 1e-5  # small_gicp's own 0.1 deg and 1 mm stop an order of magnitude before the answer
_STEP_M = 1e-4  # smaller than the noise of a mean of points
_MAX_STEPS = 40  # of small_gicp
_NEARLY_ALL = 0.97  # share of points: without the rest the result is the same
_FEW = 100  # points: too few for statistics
_JUDGED = 20_000  # points of a pair: the sampling error of a share is below 0.4 %
_ALIKE = 0.5  # cosine between normals of one surface: two noisy normals, or a curved surface

MIN_OVERLAP = 0.2  # share of the points; a pair with less is not used
MAX_CONTRADICTION = 0.03  # share of the points in free space; a pair with more is not used
_BLOCK = 10  # times the spacing: a normal comes from ten neighbours, and a voxel is the target of several points
_CLEARLY = 0.3  # of the resistance of a surface square to the motion
_MIN_RESIST = 0.03  # share of the points; a motion that fewer resist counts as free


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """The pose of scan position b in the frame of a, with its evidence.

    Attributes:
        covariance: of a small motion (rotation vector [rad], translation [m]) on the right of `T_a_b`, shape (6, 6);
            NaN if the common surfaces leave a motion free.
    """

    a: str  # name of the first cloud
    b: str  # name of the second
    T_a_b: Pose  # shape (4, 4), NaN if there was no start
    covariance: Float64[ndarray, "6 6"]
    overlap: float  # share of the smaller view's points that lie on the other's surfaces
    contradiction: float  # share of the mutually visible points in space that the other scanner measured to be free
    why_not: tuple[str, ...]  # reasons against the pose; empty if it is accepted

    @property
    def merit(self) -> float:
        """Score of poses of the same two clouds, 0 to 1: overlap, reduced by contradiction."""
        return _merit(self.overlap, self.contradiction)


def align(a: SensorView, b: SensorView, T_a_b: Pose) -> Pair:
    """Register b to a from a start with errors up to about 1 m and 10 deg."""
    near = align_coarsely(a, b, T_a_b)
    T, converged = _gicp(a.fine, b.fine, near, _FINE_REACH * a.spacing_m, THREADS)
    pair = judge_pair(a, b, T)
    exact = None if pair.why_not else adjust(a.beams, b.beams, T, a.spacing_m)
    if exact is not None:  # also if small_gicp did not settle: in sparse clouds its neighbours change at every step
        return replace(pair, T_a_b=exact[0], covariance=exact[1])
    return pair if converged else refused(pair, f"small_gicp had not settled after {_MAX_STEPS} steps")


def refused(pair: Pair, why: str) -> Pair:
    """Return the pair with one more reason against it."""
    return replace(pair, why_not=(*pair.why_not, why))


def align_coarsely(a: SensorView, b: SensorView, T_a_b: Pose) -> Pose:
    """Return the pose from the coarse points alone."""
    return _gicp(a.coarse, b.coarse, T_a_b, _COARSE_REACH_M, 1)[0]


def judge_pair(a: SensorView, b: SensorView, T_a_b: Pose) -> Pair:
    """Test a pose against the measurements of both scanners."""
    near_m = _FINE_REACH * a.spacing_m
    T_b_a = np.linalg.inv(T_a_b)
    (points_a, normals_a), (points_b, normals_b) = _some(a.fine), _some(b.fine)
    there, turned = frames.apply(T_a_b, points_b), normals_b @ T_b_a[:3, :3]
    here = frames.apply(T_b_a, points_a)
    on_a, index = _touching(a.fine, there, turned, near_m)
    on_b, _ = _touching(b.fine, here, normals_a @ T_a_b[:3, :3], near_m)
    overlap = max(float(on_a.mean()), float(on_b.mean()))
    contradiction = max(_contradiction(a, there, near_m), _contradiction(b, here, near_m))
    target, points_m = index[on_a], there[on_a]
    normals = a.fine.normals[target]
    residual_m = np.einsum("ij,ij->i", normals, points_m - a.fine.points_m[target])
    loose = _loose(points_m, normals, turned[on_a], a.name)
    covariance = np.full((6, 6), np.nan)
    if not loose and len(residual_m) > _FEW:
        J = _jacobian(normals, points_m, T_a_b)
        covariance = _sandwich(J, residual_m, _blocks(points_m, normals, _BLOCK * a.spacing_m))
    why_not = []
    if overlap < MIN_OVERLAP:
        why_not.append(
            f"only {overlap:.0%} of the points lie on the other cloud: at least {MIN_OVERLAP:.0%} are needed"
        )
    if contradiction > MAX_CONTRADICTION:
        why_not.append(
            f"{contradiction:.0%} of the points are in space that the other scanner measured to be free: "
            f"at most {MAX_CONTRADICTION:.0%} are allowed"
        )
    return Pair(a.name, b.name, T_a_b, covariance, overlap, contradiction, (*why_not, *loose))


def _gicp(target: Level, source: Level, T_target_source: Pose, reach_m: float, threads: int) -> tuple[Pose, bool]:
    """Align the surfaces that face both scanners: else the two sides of a thin wall would settle on each other."""
    target = _facing(target, T_target_source[:3, 3])
    source = _facing(source, np.asarray(np.linalg.inv(T_target_source)[:3, 3], float))
    result = small_gicp.align(
        target.cloud,
        source.cloud,
        target.tree,
        T_target_source,
        registration_type="GICP",
        max_correspondence_distance=reach_m,
        num_threads=threads,
        max_iterations=_MAX_STEPS,
        rotation_epsilon=_STEP_RAD,
        translation_epsilon=_STEP_M,
    )
    # Without a neighbour in reach it returns the start as converged
    return result.T_target_source, bool(result.converged and result.num_inliers > 0)


def _facing(level: Level, other_m: Float64[ndarray, " 3"]) -> Level:
    """Return the points that face the other scanner as well; all of them if that is nearly all."""
    faces = np.einsum("ij,ij->i", level.normals, other_m - level.points_m) >= 0
    return level if faces.mean() > _NEARLY_ALL or faces.sum() < _FEW else make_level(level.points_m[faces])


def coarse_merit(a: SensorView, b: SensorView, T_a_b: Pose) -> float:
    """Return `Pair.merit` from the coarse points alone: a hundredth of the work."""
    there = frames.apply(T_a_b, b.coarse.points_m)
    here = frames.apply(np.linalg.inv(T_a_b), a.coarse.points_m)
    margin_m = _FINE_REACH * a.spacing_m
    contradiction = max(_contradiction(a, there, margin_m), _contradiction(b, here, margin_m))
    return _merit(max(_coarse_shares(a, b, T_a_b, _COARSE_NEAR * a.spacing_m)), contradiction)


def near_share(a: SensorView, b: SensorView, T_a_b: Pose) -> float:
    """Return the overlap for a pose with an error of decimetres."""
    return max(_coarse_shares(a, b, T_a_b, _COARSE_REACH_M))


def _coarse_shares(a: SensorView, b: SensorView, T_a_b: Floats, reach_m: float) -> tuple[float, float]:
    """Return the share of b's coarse points that touch a, and of a's that touch b."""
    T_b_a = np.linalg.inv(T_a_b)
    on_a, _ = _touching(a.coarse, frames.apply(T_a_b, b.coarse.points_m), b.coarse.normals @ T_b_a[:3, :3], reach_m)
    on_b, _ = _touching(b.coarse, frames.apply(T_b_a, a.coarse.points_m), a.coarse.normals @ T_a_b[:3, :3], reach_m)
    return float(on_a.mean()), float(on_b.mean())


def _merit(overlap: float, contradiction: float) -> float:
    return overlap * max(0.0, 1 - contradiction / MAX_CONTRADICTION) + 1e-3 * overlap


def _some(level: Level) -> tuple[Float64[ndarray, "n 3"], Float64[ndarray, "n 3"]]:
    """Return a sample of points and normals."""
    step = max(1, len(level.points_m) // _JUDGED)
    return level.points_m[::step], level.normals[::step]


def _touching(
    level: Level, points_m: Float64[ndarray, "n 3"], normals: Float64[ndarray, "n 3"], reach_m: float
) -> tuple[Bool[ndarray, " n"], Int64[ndarray, " n"]]:
    """Return which points have a neighbour within reach with a similar normal, and its index."""
    index, square_m2 = level.tree.batch_knn_search(np.ascontiguousarray(points_m), 1, 1)
    nearest = index[:, 0].astype(np.int64)
    alike = np.einsum("ij,ij->i", normals, level.normals[nearest]) > _ALIKE
    return (square_m2[:, 0] < reach_m**2) & alike, nearest


def _contradiction(view: SensorView, points_m: Float64[ndarray, "n 3"], margin_m: float) -> float:
    """Return the share of the points visible to the scanner of `view` that lie clearly before its measured surfaces."""
    cells = cells_of(points_m, view.depth.side)
    range_m = np.linalg.norm(points_m, axis=1)
    margin_m += 0.02 * range_m  # neighbouring beams on a slanted surface differ by this much
    visible = range_m < view.depth.far_m[cells] + margin_m
    before = visible & (range_m < view.depth.near_m[cells] - margin_m)
    return float(before.sum()) / max(int(visible.sum()), 1)


def _jacobian(
    normals: Float64[ndarray, "n 3"], points_a: Float64[ndarray, "n 3"], T_a_b: Pose
) -> Float64[ndarray, "n 6"]:
    """Return the derivatives of point-to-plane residuals by a small motion on the right of `T_a_b`, shape (n, 6)."""
    points_b = frames.apply(np.linalg.inv(T_a_b), points_a)
    normals_b = normals @ T_a_b[:3, :3]
    return np.hstack([np.cross(points_b, normals_b), normals_b])


def _blocks(points_m: Float64[ndarray, "n 3"], normals: Float64[ndarray, "n 3"], edge_m: float) -> Int64[ndarray, " n"]:
    """Return the number of each point's block: its cube, and the axis nearest to its normal."""
    cubes = np.column_stack([np.floor(points_m / edge_m).astype(np.int64), np.abs(normals).argmax(axis=1)])
    return np.unique(cubes, axis=0, return_inverse=True)[1].reshape(-1)


def _sandwich(
    J: Float64[ndarray, "n 6"], residual_m: Float64[ndarray, " n"], block: Int64[ndarray, " n"]
) -> Float64[ndarray, "6 6"]:
    """Return the covariance of least squares with residuals correlated within a block: neighbours share targets.

    H. White, "Asymptotic Theory for Econometricians" (1984); K.-Y. Liang and S. L. Zeger, "Longitudinal data analysis
    using generalized linear models", Biometrika 73 (1986).
    """
    inverse = np.linalg.inv(J.T @ J)
    free = residual_m - J @ (inverse @ (J.T @ residual_m))
    pulls = voxel_sums(block, J * free[:, None])
    scatter = pulls.T @ pulls * len(pulls) / max(len(pulls) - 6, 1)
    return np.asarray(inverse @ scatter @ inverse, float)


def _loose(
    points_m: Float64[ndarray, "n 3"], normals: Float64[ndarray, "n 3"], others: Floats, frame: str
) -> list[str]:
    """Name the motions that no common surface resists: along a corridor, over a floor, about a tank.

    The smallest eigenvalue is no measure, since the noise of thousands of normals adds up. The points that resist the
    motion clearly are counted, by the normals of both clouds, since a normal of a far surface is uncertain.
    """
    if not len(points_m):
        return []
    arm = points_m - points_m.mean(axis=0)
    torque, torque_of_others = np.cross(arm, normals), np.cross(arm, others)
    shift, turn = _weakest(normals), _weakest(torque)
    lever_m = np.linalg.norm(np.cross(arm, turn), axis=1)
    along = np.minimum(np.abs(normals @ shift), np.abs(others @ shift))
    about = np.minimum(np.abs(torque @ turn), np.abs(torque_of_others @ turn))
    shares = {
        f"slide along {_axis(shift)}": float(np.mean(along > _CLEARLY)),
        f"turn about {_axis(turn)}": float(np.mean(about > _CLEARLY * lever_m)),
    }
    return [
        f"it can {motion} of {frame}: {share:.1%} of the points resist, {_MIN_RESIST:.0%} must"
        for motion, share in shares.items()
        if share < _MIN_RESIST
    ]


def _weakest(rows: Floats) -> Floats:
    """Return the unit vector with the least component in the rows."""
    return np.linalg.eigh(rows.T @ rows)[1][:, 0]


def _axis(direction: Float64[ndarray, " 3"]) -> str:
    x, y, z = direction * np.sign(direction[np.argmax(np.abs(direction))]) + 0.0
    return f"({x:z.2f}, {y:z.2f}, {z:z.2f})"
