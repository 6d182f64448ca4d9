"""Pose of a pair by least squares over all beams of all pieces; every piece's plane and the calibration are unknown.

The plane of each piece is determined by the beams of both scan positions and eliminated (a Schur complement), which
leaves their disagreement about it. No measurement is used twice: normals are no averages of shared neighbours, and a
beam belongs to one piece. So the inverse of the normal equations is the covariance.

The four unknowns of the calibration are the same in both scan positions, with the stated covariance as their prior.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np
from jaxtyping import Bool, Float64, Int64
from numpy import ndarray

from scanwright.design import frames
from scanwright.design.arrays import Floats, Pose
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.firmware_io.registration.surfels.beams import UNKNOWNS, BeamRun, Beams, sum_beams
from scanwright.firmware_io.registration.surfels.cells import Cells, Lookup, find_cells, look_up

_ROUNDS = 8  # of finding cells and solving
_SETTLED = 5e-2  # squared sigmas of a step: beams that enter and leave pieces at their edges move it as much
_SAME_REACH = 0.9  # times the last reach: the cells would be the same
_REACH = 5  # sigmas: above the noise of a wall
_FOREIGN = 0.02  # share of points off the common plane
_MIN_CELLS = 12  # two for each degree of freedom
_SHARED_BEAMS = 20  # weight, in beams, of the whole cloud's noise in that of a piece
_OUTLIER = 36.0  # times the median disagreement of pieces, in squared sigmas: a moved or another object
_DOUBTED = 9.0  # above it the pull of a piece grows in proportion to its distance only
_REWEIGHTED = 8  # iterations of the robust weights
_MEDIAN_CHI2 = 2.37  # of three degrees of freedom
_VAGUE = 0.1  # of the spacing: largest sigma of a position that flat pieces hold
_RIDGE = 1e-9  # of a plane's information: makes a plane with a single line of beams solvable
_RANK = 1e-6  # times the largest eigenvalue: smaller ones are rounding
_SHARES = 8  # of the beams, summed in parallel: the same on every machine, since the order of a sum affects rounding


def adjust(a: Beams, b: Beams, T_a_b: Pose, spacing_m: float) -> tuple[Pose, Float64[ndarray, "6 6"]] | None:
    """Return the pose from a start with an error below `spacing_m`; None if the flat surfaces do not hold it.

    Its covariance is that of a small motion (rotation vector [rad], translation [m]) on its right.
    """
    cells = find_cells(
        np.concatenate([a.voxels_m, frames.apply(T_a_b, b.voxels_m)]),
        np.concatenate([a.counts, b.counts]),
        np.arange(len(a.counts) + len(b.counts)) < len(a.counts),
        np.stack([a.eye_m, T_a_b[:3, :3] @ b.eye_m + T_a_b[:3, 3]]),
        spacing_m,
    )
    prior = np.zeros((UNKNOWNS - 3, UNKNOWNS - 3))
    free = 6
    if a.covariance is not None:
        free = UNKNOWNS - 3
        prior[6:, 6:] = np.linalg.inv(a.covariance)
    T, adjusted = T_a_b, None
    for _ in range(_ROUNDS):
        if cells.number < _MIN_CELLS:
            return None
        lookup = look_up(cells)
        sums_a, on_a, off_a = _summed(a, cells, lookup, np.eye(4), False)
        sums_b, on_b, off_b = _summed(b, cells, lookup, T, True)
        enough = (np.minimum(on_a, on_b) > 3) & (off_a <= _FOREIGN * on_a) & (off_b <= _FOREIGN * on_b)
        cells = cells.select(enough)
        if cells.number < _MIN_CELLS:
            return None
        solved = _solve(sums_a[enough], sums_b[enough], on_a[enough], on_b[enough], prior, free)
        if max(np.abs(solved.x[3:6]).max(), np.sqrt(solved.covariance[3:, 3:].trace()) / _VAGUE) > spacing_m:
            return None
        T = T @ frames.rigid(frames.rotvec_to_matrix(solved.x[:3]), solved.x[3:6])
        adjusted = T, solved.covariance
        reach_m = min(cells.reach_m, _REACH * solved.noise_m)
        still = solved.x[:6] @ np.linalg.solve(solved.covariance, solved.x[:6]) < _SETTLED
        if still and reach_m > _SAME_REACH * cells.reach_m:
            break
        cells = cells.moved(solved.planes, reach_m).select(solved.agrees)
    return adjusted


@dataclass(frozen=True, slots=True, eq=False)
class _Solved:
    x: Float64[ndarray, " 10"]
    covariance: Float64[ndarray, "6 6"]
    planes: Float64[ndarray, "m 3"]
    agrees: Bool[ndarray, " m"]
    noise_m: float


def _summed(
    beams: Beams, cells: Cells, lookup: Lookup, T: Pose, moves: bool
) -> tuple[Floats, Int64[ndarray, " m"], Int64[ndarray, " m"]]:
    pose = np.ascontiguousarray(T)
    bounds = [len(beams.points_m) * k // _SHARES for k in range(_SHARES + 1)]

    def share(k: int) -> tuple[Floats, Int64[ndarray, " m"], Int64[ndarray, " m"]]:
        some = slice(bounds[k], bounds[k + 1])
        run = BeamRun(beams.points_m[some], beams.eye_m, beams.joint_rad[some], beams.frame, pose, moves)
        return sum_beams(run, cells, lookup)

    shares = in_chunks(lambda some: [share(k) for k in range(_SHARES)[some]], _SHARES, smallest=1)
    sums, on, off = zip(*chain.from_iterable(shares), strict=True)
    return np.sum(sums, axis=0), np.sum(on, axis=0), np.sum(off, axis=0)


def _solve(
    sums_a: Floats, sums_b: Floats, on_a: Int64[ndarray, " m"], on_b: Int64[ndarray, " m"], prior: Floats, free: int
) -> _Solved:
    """Weigh, eliminate the planes, solve; pieces that disagree are left out."""
    weights = [_weights(sums_a, on_a), _weights(sums_b, on_b)]
    sums_a, sums_b = (sums * weight[:, None, None] for sums, weight in zip((sums_a, sums_b), weights, strict=True))
    both = sums_a + sums_b
    left = _without_plane(both)
    alone = [_without_plane(sums_a), _without_plane(sums_b)]
    rank_a, rank_b, rank = (_rank(sums[:, :3, :3]) for sums in (sums_a, sums_b, both))
    freedom = rank_a + rank_b - rank
    some = freedom > 0
    trust = np.ones(len(both))
    for _ in range(_REWEIGHTED):
        x, _ = _least_squares(left, trust, prior, free)
        apart = _apart(left, alone, x)
        usual = max(1.0, float(np.median(np.append(apart[some] / freedom[some], 0.0))) * 3 / _MEDIAN_CHI2)
        # P. J. Huber, "Robust Estimation of a Location Parameter" (1964)
        trust = 1 / np.sqrt(np.maximum(1.0, apart / (_DOUBTED * usual)))
    agrees = apart <= _OUTLIER * usual
    x, H = _least_squares(left, agrees.astype(float), prior, free)
    apart = _apart(left, alone, x)
    scale = max(1.0, float(np.sqrt(apart[agrees].sum() / max(freedom[agrees].sum() - 6, 1))))
    A, rest = both[:, :3, :3], both[:, :3, -1] - both[:, :3, 3:-1] @ x
    planes = np.linalg.solve(_ridged(A), rest[..., None])[..., 0]
    noise_m = float(np.sqrt(1 / min(np.median(weight) for weight in weights)))
    covariance = scale**2 * np.linalg.inv(H[:free, :free])[:6, :6]
    return _Solved(x, covariance, planes, agrees, noise_m)


def _least_squares(
    left: Floats, trust: Float64[ndarray, " m"], prior: Floats, free: int
) -> tuple[Float64[ndarray, " 10"], Floats]:
    """Return the solution and the normal equations of pieces whose planes are eliminated."""
    sums = np.einsum("m,mij->ij", trust, left)
    H = sums[:-1, :-1] + prior
    x = np.zeros(UNKNOWNS - 3)
    x[:free] = np.linalg.solve(H[:free, :free], sums[:-1, -1][:free])
    return x, H


def _weights(sums: Floats, on: Int64[ndarray, " m"]) -> Float64[ndarray, " m"]:
    """Return one over the variance of a range [m^-2] for each piece, from the residuals to its fitted plane."""
    rest = np.maximum(_without_plane(sums)[:, -1, -1], 0.0)
    freedom = np.maximum(on - 3, 0)
    usual = float(np.median(rest[freedom > 0] / freedom[freedom > 0]))
    return (freedom + _SHARED_BEAMS) / (rest + _SHARED_BEAMS * usual)


def _without_plane(sums: Floats) -> Floats:
    """Return the Schur complement of the first three unknowns, shape (m, 11, 11)."""
    across = sums[:, :3, 3:]
    return sums[:, 3:, 3:] - np.swapaxes(across, 1, 2) @ np.linalg.solve(_ridged(sums[:, :3, :3]), across)


def _ridged(A: Floats) -> Floats:
    return A + _RIDGE * np.trace(A, axis1=1, axis2=2)[:, None, None] * np.eye(3)


def _apart(left: Floats, alone: list[Floats], x: Floats) -> Float64[ndarray, " m"]:
    """Return the residual of a shared plane over that of two separate ones, in squared sigmas."""
    full = np.append(-x, 1.0)
    shared, alone_a, alone_b = (np.einsum("i,mij,j->m", full, sums, full) for sums in (left, *alone))
    return np.maximum(shared - alone_a - alone_b, 0.0)


def _rank(A: Floats) -> Int64[ndarray, " m"]:
    """Return how many of a plane's three parameters are determined: a single line of beams determines two."""
    values = np.linalg.eigvalsh(A)
    return (values > _RANK * values[:, -1:]).sum(axis=1)
