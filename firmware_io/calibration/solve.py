"""Least squares of ranges with unknown planes.

A beam (o, d) meets the plane q . p = 1 at the range (1 - q . o) / (q . d); the difference to its range is the residual.
Neither its derivatives nor the choice of beams depends on noise, so the estimate is the maximum likelihood one and
reaches the Cramer-Rao bound. The sums of all beams of a tile, over

    parameters x (k) | its surface's plane q (3) | its spot's bulge u (1) | the residual (1)

are one small symmetric matrix. All bulges (unevenness u of each spot, normally distributed) and planes are eliminated
from these: the rest is the information on x, k x k.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from numba import njit
from numpy import ndarray
from scipy.sparse import csr_array

from scanwright.design.arrays import Array, Floats, Ints
from scanwright.firmware_io.calibration.model import COUNT, Mount, ReturnedBeams

_Q = COUNT
_U = COUNT + 3
_E = COUNT + 4
WIDTH = COUNT + 5
_MEDIAN_CHI2 = 0.4549  # of one degree of freedom
KINK = 3.0  # standard deviations beyond which residuals count linearly (Huber)
_REFITS = 4  # of the robust weights


@dataclass(frozen=True, slots=True, eq=False)
class Grouping:
    """Surface and spot of each tile."""

    surface: Int64[ndarray, " tiles"]  # number of each tile's surface, -1 for none, shape (m,)
    spot: Int64[ndarray, " tiles"]  # number of each tile's spot, over all surfaces; invalid without one, shape (m,)
    q: Float64[ndarray, "surfaces 3"]  # plane of each surface, q . p = 1, shape (s, 3)

    @property
    def used(self) -> Ints:
        """Tiles with a surface."""
        return np.flatnonzero(self.surface >= 0)

    @property
    def planes(self) -> Floats:
        """Plane of each tile, shape (m, 3); that of the first surface for a tile without one."""
        return self.q[np.maximum(self.surface, 0)]


@dataclass(frozen=True, slots=True, eq=False)
class Reduced:
    """Normal equations without bulges and planes."""

    information: Float64[ndarray, "free free"]  # of the free parameters, shape (k, k)
    right: Float64[ndarray, " free"]  # right-hand side, shape (k,)
    plane_rows: Floats  # for each surface, dq = plane_rows @ [dx, 1], shape (s, 3, k + 1)


def sums(
    mount: Mount,
    x: Float64[ndarray, " parameters"],
    beams: ReturnedBeams,
    tile: Int64[ndarray, " beams"],
    weight: Float64[ndarray, " beams"],
    q: Float64[ndarray, "tiles 3"],
    kink: float = KINK,
) -> Float64[ndarray, "tiles width width"]:
    """Return the normal equations of each tile, shape (m, WIDTH, WIDTH).

    `beams` include the lag; `tile`, `weight` (1 / variance of the range): of each beam, shape (n,); `q`: plane of each
    tile, shape (m, 3); `kink`: standard deviations beyond which residuals count linearly (Huber).
    """
    return _sums(
        mount.plane(x), mount.along_m, x, beams.joint_rad, beams.speed_rad_s, beams.direction, beams.bearing_rad,
        beams.range_m, tile, weight, q, kink,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _sums(
    plane: Array,
    along_m: float,
    x: Array,
    joint: Array,
    speed: Array,
    direction: Array,
    bearing: Array,
    range_m: Array,
    tile: Ints,
    weight: Array,
    q: Array,
    kink: float,
) -> Array:
    tiles = len(q)
    out = np.zeros((tiles, WIDTH, WIDTH))
    row = np.zeros(WIDTH)
    for i in range(range_m.size):
        c1, s1 = np.cos(joint[i]), np.sin(joint[i])
        c2, s2 = c1 * c1 - s1 * s1, 2.0 * c1 * s1
        psi = joint[i] + x[5] * c1 + x[6] * s1 + x[7] * c2 + x[8] * s2 - 0.5 * x[10] * direction[i]
        c, s = np.cos(psi), np.sin(psi)
        cb, sb = np.cos(bearing[i]), np.sin(bearing[i])
        a, b, n = q[tile[i], 0], q[tile[i], 1], q[tile[i], 2]
        # plane in the rotating frame
        e, f = c * a + s * b, c * b - s * a
        u0 = plane[0, 0, 0] * cb + plane[0, 0, 1] * sb
        u1 = plane[0, 1, 0] * cb + plane[0, 1, 1] * sb
        u2 = plane[0, 2, 0] * cb + plane[0, 2, 1] * sb
        slant = e * u0 + f * u1 + n * u2
        length = np.sqrt(a * a + b * b + n * n)
        if abs(slant) < 0.02 * length:
            continue
        met = (1.0 - e * x[2] - f * x[3] - n * along_m) / slant
        px, py, pz = x[2] + met * u0, x[3] + met * u1, along_m + met * u2
        around = (f * px - e * py) / slant
        for k in range(2):
            v0 = plane[k + 1, 0, 0] * cb + plane[k + 1, 0, 1] * sb
            v1 = plane[k + 1, 1, 0] * cb + plane[k + 1, 1, 1] * sb
            v2 = plane[k + 1, 2, 0] * cb + plane[k + 1, 2, 1] * sb
            row[k] = met * (e * v0 + f * v1 + n * v2) / slant
        row[2] = e / slant
        row[3] = f / slant
        row[4] = 1.0
        row[5] = around * c1
        row[6] = around * s1
        row[7] = around * c2
        row[8] = around * s2
        row[9] = around * speed[i] * (1.0 - x[5] * s1 + x[6] * c1 - 2.0 * x[7] * s2 + 2.0 * x[8] * c2)
        row[10] = -0.5 * around * direction[i]
        row[11] = (c * px - s * py) / slant
        row[12] = (s * px + c * py) / slant
        row[13] = pz / slant
        row[14] = -length / slant
        row[15] = range_m[i] + x[4] - met
        w = weight[i]
        off = abs(row[15]) * np.sqrt(w)
        if off > kink:
            w *= kink / off
        into = out[tile[i]]
        for j in range(WIDTH):
            for k in range(j + 1):
                into[j, k] += w * row[j] * row[k]
    for t in range(tiles):
        for j in range(WIDTH):
            for k in range(j):
                out[t, k, j] = out[t, j, k]
    return out


def reduced(
    normal: Float64[ndarray, "tiles width width"], grouping: Grouping, free: Int64[ndarray, " free"], bulge_m: float
) -> Reduced:
    """Eliminate the bulges of all spots (standard deviation `bulge_m`; 0 for perfect planes) and all planes.

    `normal`: sums of all tiles, shape (m, WIDTH, WIDTH); `free`: parameters to estimate, shape (k,).
    """
    spot, first = _per_spot(grouping, normal)
    surface_of = grouping.surface[first]
    if bulge_m > 0:
        pivot = spot[:, _U, _U] + 1 / bulge_m**2
        spot = spot - spot[:, :, _U, None] * spot[:, None, _U, :] / pivot[:, None, None]
    surface = _summed(spot, surface_of, len(grouping.q))
    keep = np.append(free, _E)
    planes = surface[:, _Q : _Q + 3, _Q : _Q + 3]
    across = surface[:, _Q : _Q + 3][:, :, keep]
    rows = -np.linalg.pinv(planes, rcond=1e-12, hermitian=True) @ across
    total = (surface[:, keep][:, :, keep] + across.swapaxes(1, 2) @ rows).sum(axis=0)
    return Reduced(total[:-1, :-1], total[:-1, -1], rows)


def _per_spot(grouping: Grouping, values: Floats) -> tuple[Floats, Ints]:
    """Return values of tiles summed over each spot, and one tile of each spot."""
    used = grouping.used
    spots, first, numbers = np.unique(grouping.spot[used], return_index=True, return_inverse=True)
    label = np.full(len(values), -1)
    label[used] = numbers
    return _summed(values, label, spots.size), used[first]


def _summed(values: Floats, label: Ints, labels: int) -> Floats:
    """Return rows summed by label, zero for a label without rows; skips those of label -1."""
    rows = np.flatnonzero(label >= 0)
    of_label = csr_array((np.ones(rows.size), (label[rows], rows)), shape=(labels, len(values)))
    return (of_label @ values.reshape(len(values), -1)).reshape(labels, *values.shape[1:])


def step(part: Reduced) -> tuple[Floats, Floats]:
    """Return one Gauss-Newton step of the free parameters, and of the plane of each surface."""
    scale = 1 / np.sqrt(np.maximum(np.diag(part.information), 1e-300))
    scaled = part.information * np.outer(scale, scale)
    dx = -scale * np.linalg.lstsq(scaled, scale * part.right, rcond=1e-10)[0]
    return dx, part.plane_rows @ np.append(dx, 1.0)


def covariance(part: Reduced) -> Float64[ndarray, "free free"]:
    """Return the covariance of the free parameters, shape (k, k); infinite if the information is singular."""
    scale = 1 / np.sqrt(np.maximum(np.diag(part.information), 1e-300))
    values, vectors = np.linalg.eigh(part.information * np.outer(scale, scale))
    lost = values <= 1e-11
    inverse = (vectors / np.where(lost, np.inf, values)) @ vectors.T
    weak = np.abs(vectors[:, lost]).max(axis=1, initial=0.0) > 1e-3
    inverse[weak, :] = inverse[:, weak] = 0.0
    inverse[weak, weak] = np.inf
    return inverse * np.outer(scale, scale)


def moved_by_last(part: Reduced) -> Floats:
    """Return the error of the other parameters per unit of error of the fixed last one, shape (k - 1,)."""
    others = Reduced(part.information[:-1, :-1], part.right[:-1], part.plane_rows)
    return covariance(others) @ part.information[:-1, -1]


def bulge_m(normal: Floats, grouping: Grouping) -> float:
    """Return the standard deviation of spots from their planes, beyond noise, by the median."""
    spot, _ = _per_spot(grouping, normal[:, _U, [_U, _E]])
    spot = spot[spot[:, 0] > 0]  # without those seen only at grazing angles
    square, noise = (spot[:, 1] / spot[:, 0]) ** 2, 1 / spot[:, 0]
    low, high = 0.0, float(square.max())
    for _ in range(60):
        middle = (low + high) / 2
        if np.median(square / (noise + middle)) > _MEDIAN_CHI2:
            low = middle
        else:
            high = middle
    return float(np.sqrt(high)) if high > 0.02 * float(np.median(noise)) else 0.0


def misfits(normal: Floats, beams: Ints) -> Floats:
    """Return the mean squared residual of each tile, in units of its variance, shape (m,); `beams`: their number."""
    return normal[:, _E, _E] / np.maximum(beams, 1)


def planes_alone(
    mount: Mount, x: Floats, beams: ReturnedBeams, tile: Ints, weight: Floats, grouping: Grouping
) -> Grouping:
    """Fit the planes of the surfaces with fixed parameters."""
    none = np.array([], np.int64)
    for _ in range(_REFITS):
        normal = sums(mount, x, beams, tile, weight, grouping.planes)
        grouping = replace(grouping, q=grouping.q + reduced(normal, grouping, none, 0.0).plane_rows[:, :, 0])
    return grouping


def heights(normal: Floats) -> tuple[Floats, Floats]:
    """Return the mean height of each tile over its surface [m] and its weight, each shape (m,)."""
    weight = normal[:, _U, _U]
    return -normal[:, _U, _E] / np.maximum(weight, 1e-300), weight


def rms(normal: Floats, weight_sum: float) -> float:
    """Return the root mean square of the residuals in sums [m]."""
    return float(np.sqrt(normal[:, _E, _E].sum() / weight_sum))
