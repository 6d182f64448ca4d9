"""Detection of motion in the scene by ray conflicts between overlapping views.

Half a turn, or a full one, brings other beams of the scan plane to the same place. The angle of the axis and the
bearing of these beams follow from the mount, in closed form.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float64
from numpy import ndarray
from scipy.stats import norm

from scanwright.design.arrays import Floats, Ints, Mask
from scanwright.firmware_io.calibration.model import Mount, ReturnedBeams, axis_angle, beam_rays
from scanwright.firmware_io.calibration.scans import Scans

_ONCE_IN = 1000  # recordings with one false conflict by noise
_SQUARES = (0.5, 1.0)  # distance of scans around a beam, in that of its neighbours: small for slim and far objects
_SCANS = 8  # largest distance, as people move
_TESTED = 200_000  # beams, which suffice
_APART_RAD = np.radians(10.0)  # smallest rotation between two views
_TURN_RAD = 2 * np.pi


@dataclass(frozen=True, slots=True)
class OverlappingViews:
    """Comparison of two views of one place at two times."""

    tested: int  # beams with neighbours
    compared: int  # those whose place another view covers
    seen_through: int  # those whose place a beam of another view passed, to end well behind it


def overlapping_views(
    mount: Mount, x: Float64[ndarray, " parameters"], beams: ReturnedBeams, noise_m: float
) -> OverlappingViews:
    """Find beams that ended at places through which beams of another view passed.

    A beam and its four neighbours (in its scan, and in the scans before and after) ended at five points. A beam of
    another view passes between these and ends behind all of them, as do its four neighbours, by more than the depth of
    the five points and more than noise explains once in `_ONCE_IN` recordings. So the object is as wide as the free
    space of the other view: not a static object, or a slot, without holes narrower than three beams.
    """
    now = beams.under(x)
    origin, direction = beam_rays(mount, x, now)
    range_m = now.range_m + x[4]
    point = origin + range_m[:, None] * direction
    scans = Scans.of(now)
    aside = np.hypot(direction[:, 0], direction[:, 1])
    patches = [_patches(scans, aside, square) for square in _SQUARES]
    tested = np.flatnonzero(np.any([patch[0] >= 0 for patch in patches], axis=0))
    tested = tested[:: max(1, tested.size // _TESTED)]
    views = list(_other_views(mount, x, now, scans, point, tested))
    pairs = len(patches) * sum(mine.size for mine, _ in views)
    behind_m = noise_m * np.sqrt(2) * norm.isf(1 / _ONCE_IN / max(1, pairs))
    compared, through = np.zeros((2, range_m.size), bool)
    for patch, (mine, other) in product(patches, views):
        complete = (patch[0, mine] >= 0) & (patch[0, other] >= 0)
        mine, other = mine[complete], other[complete]
        five, along = point[patch[:, mine]] - origin[other], direction[other]
        depth = np.einsum("kij,ij->ki", five, along)
        across = five - depth[:, :, None] * along
        between = _between(across[0], (across[2] - across[1]) / 2, (across[4] - across[3]) / 2)
        compared[mine] |= between
        clear_m = range_m[patch[:, other]].min(axis=0)
        through[mine] |= between & (clear_m > 2 * depth.max(axis=0) - depth.min(axis=0) + behind_m)
    return OverlappingViews(tested.size, int(compared.sum()), int(through.sum()))


def _patches(scans: Scans, aside: Floats, square: float) -> Ints:
    """Return each beam, its neighbours in its scan and those in scans around it, shape (5, n); -1 if one is missing.

    `aside`: sine of each beam's angle to the axis, shape (n,); `square`: smallest distance of those scans relative to
    that of the beams.
    """
    beam = np.arange(1, scans.scan.size - 1)
    row = scans.scan
    inner = (row[beam - 1] == row[beam + 1]) & (
        scans.bearing_rad[beam + 1] - scans.bearing_rad[beam - 1] < 3 * scans.gap_rad
    )
    beam = beam[inner]
    apart = square * scans.gap_rad / np.maximum(scans.step_rad * aside[beam], 1e-9)
    apart = np.clip(np.rint(apart), 1, _SCANS).astype(np.int64)
    last, has_last = scans.beam(row[beam] - apart, scans.bearing_rad[beam])
    following, has_following = scans.beam(row[beam] + apart, scans.bearing_rad[beam])
    complete = has_last & has_following & (scans.run[row[last]] == scans.run[row[following]])
    patches = np.full((5, row.size), -1)
    patches[:, beam[complete]] = np.stack([beam, beam - 1, beam + 1, last, following])[:, complete]
    return patches


def _other_views(
    mount: Mount, x: Floats, now: ReturnedBeams, scans: Scans, point: Floats, tested: Ints
) -> Iterator[tuple[Ints, Ints]]:
    """Yield tested beams that another view covers, and the nearest beams of that view."""
    run = scans.run[scans.scan[tested]]
    for psi_rad, bearing_rad in _towards(mount, x, point[tested]):
        joint_rad = 2 * psi_rad - axis_angle(x, psi_rad, np.zeros(psi_rad.size))
        here_rad = now.joint_rad[tested] + _APART_RAD
        next_rad = here_rad + (joint_rad - here_rad) % _TURN_RAD
        here_rad = now.joint_rad[tested] - _APART_RAD
        last_rad = here_rad - (here_rad - joint_rad) % _TURN_RAD
        from_first_rad = scans.sense * (bearing_rad - scans.first_rad) % _TURN_RAD
        for r in range(scans.run[-1] + 1):
            rows = np.flatnonzero(scans.run == r)
            place = now.place[np.searchsorted(scans.scan, rows[0])]
            own = (run == r) & np.isfinite(joint_rad)
            adjacent = (np.abs(run - r) == 1) & (now.place[tested] == place) & np.isfinite(joint_rad)
            low_rad = scans.joint_rad[rows].min()
            # next and last view of its run; any one of the adjacent runs
            for mine, target_rad in (
                (own, next_rad),
                (own, last_rad),
                (adjacent, low_rad + (joint_rad - low_rad) % _TURN_RAD),
            ):
                its, other = _nearest_beams(now, scans, rows, np.flatnonzero(mine), target_rad, from_first_rad)
                yield tested[its], other


def _nearest_beams(
    now: ReturnedBeams, scans: Scans, rows: Ints, mine: Ints, target_rad: Floats, bearing_rad: Floats
) -> tuple[Ints, Ints]:
    """Return those of `mine` whose target angle is in the scans `rows` of one run, and the nearest beams."""
    joint_rad = scans.joint_rad[rows]
    direction = 1 if joint_rad[-1] > joint_rad[0] else -1
    target, bearing = target_rad[mine], bearing_rad[mine]
    reached = (target >= joint_rad.min()) & (target <= joint_rad.max())
    mine, target, bearing = mine[reached], target[reached], bearing[reached]
    after = rows[0] + np.searchsorted(direction * joint_rad, direction * target)
    best, off = np.zeros(mine.size, np.int64), np.full(mine.size, np.inf)
    for scan in (after - 2, after - 1, after, after + 1):  # the axis turns during a scan
        beam, near = scans.beam(np.clip(scan, rows[0], rows[-1]), bearing)
        its = np.where(near, np.abs(now.joint_rad[beam] - target), np.inf)
        best, off = np.where(its < off, beam, best), np.minimum(its, off)
    return mine[np.isfinite(off)], best[np.isfinite(off)]


def _towards(mount: Mount, x: Floats, point: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Yield the two angles of the axis whose scan plane contains a point, and its bearing there; NaN without one."""
    columns = mount.plane(x)[0]
    normal, offset = np.cross(columns[:, 0], columns[:, 1]), np.array([x[2], x[3], mount.along_m])
    a = point[:, :2] @ normal[:2]
    b = point[:, 1] * normal[0] - point[:, 0] * normal[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        half_rad = np.arccos((normal @ offset - normal[2] * point[:, 2]) / np.hypot(a, b))
    for sign in (-1, 1):
        psi_rad = np.arctan2(b, a) + sign * half_rad
        cos, sin = np.cos(psi_rad), np.sin(psi_rad)
        x_rot, y_rot = cos * point[:, 0] + sin * point[:, 1], cos * point[:, 1] - sin * point[:, 0]
        seen = np.column_stack([x_rot, y_rot, point[:, 2]]) - offset
        yield psi_rad, np.arctan2(seen @ columns[:, 1], seen @ columns[:, 0])


def _between(off: Floats, a: Floats, b: Floats) -> Mask:
    """Whether each `off`, shape (n, 3), is in the diamond with the corners +- `a` and +- `b`."""
    aa, bb, ab = (np.einsum("ij,ij->i", p, q) for p, q in ((a, a), (b, b), (a, b)))
    ao, bo = (np.einsum("ij,ij->i", p, off) for p in (a, b))
    area = aa * bb - ab**2
    return np.abs(ao * bb - bo * ab) + np.abs(bo * aa - ao * ab) < area
