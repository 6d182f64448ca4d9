"""Pose of one scan position relative to another without a start pose, by correlation of their floor plans.

Both clouds are levelled by their floors and ceilings. The normals of all vertical surfaces are entered in a grid seen
from above as complex numbers, so that turning the plan multiplies it by a phase, and the correlation of two plans (one
FFT for all shifts) counts walls that lie on walls with the same normal. All headings are tried. The height comes from
the floors, ceilings and table tops likewise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from jaxtyping import Float64
from numpy import ndarray
from numpy.typing import NDArray

from scanwright.design import frames
from scanwright.design.arrays import Floats, Pose
from scanwright.firmware_io.registration.pairwise import Pair, align, align_coarsely, coarse_merit, refused
from scanwright.firmware_io.registration.sensor_view import SensorView

_CELL_M = 0.25  # of the map that is correlated: wider than the shift of near walls by an error of heading
_HEADINGS = 120  # 3 deg apart: within a cell of the truth up to 10 m
_MAX_CELLS = 512  # of a plan's edge: larger halls get larger cells
_PEAKS = 30  # for each heading, neighbouring cells included
_POINTS = 20_000  # of a view: more do not change the map of cells
_WALL = np.sin(np.radians(30))  # largest vertical part of a wall's normal
_FLOOR = np.cos(np.radians([30, 15, 7, 7]))  # largest tilt of a floor's normal in each refinement
_MIN_FLOOR = 0.05  # share of the points; with less of it a cloud is used unlevelled
_HEIGHT_M = 0.05  # of a bin: finer than a step of a stair
_HEIGHTS = 1200  # bins: 30 m up and down
_STARTS = 60  # a corridor fits itself at every metre
_SETTLED = 10  # guesses that are refined
_APART_M = 0.8  # starts nearer than this settle at one place
_APART_RAD = np.radians(8)  # the same for the heading
_WORTH = 0.5  # of the best merit, at the coarse scale; others are not aligned finely
_TRIED = 3  # of the refined guesses: each costs a whole alignment
_RIVAL = 0.7  # of the best merit: with a second pose above it the result is ambiguous

Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    T_level_view: Pose
    points_m: Float64[ndarray, "n 2"]
    arrows: Complexes
    floors: Floats


def starts(a: SensorView, b: SensorView, count: int) -> list[Pose]:
    """Return the best distinct guesses of the pose of b in the frame of a, best first; empty without walls."""
    plans = _plan(a), _plan(b)
    if not all(len(plan.points_m) for plan in plans):
        return []
    reach_m = sum(float(np.percentile(np.abs(plan.points_m), 99)) for plan in plans)
    size = min(scipy.fft.next_fast_len(int(2 * reach_m / _CELL_M) + _PEAKS), _MAX_CELLS)
    cell_m = max(2 * reach_m / size, _CELL_M)
    fixed = _raster(plans[0].points_m, plans[0].arrows, cell_m, size)
    spectrum = scipy.fft.fft2(fixed)
    peaks: list[tuple[float, float, int, int]] = []
    for heading in np.arange(_HEADINGS) * (2 * np.pi / _HEADINGS):
        turned = plans[1].points_m @ frames.Rz(heading)[:2, :2].T
        moving = _raster(turned, plans[1].arrows * np.exp(1j * heading), cell_m, size)
        norm = np.sqrt(_energy(fixed) * _energy(moving)) or 1.0
        match = scipy.fft.ifft2(spectrum * scipy.fft.fft2(moving).conj()).real
        best = np.argpartition(match.ravel(), -_PEAKS)[-_PEAKS:]
        peaks += [(float(match.flat[k]) / norm, float(heading), *divmod(int(k), size)) for k in best]
    starts: list[Pose] = []
    for _, heading, row, column in sorted(peaks, reverse=True):
        shift_m = cell_m * (np.array([row, column]) - size * (np.array([row, column]) > size // 2))
        T = frames.rigid(frames.Rz(heading), [*shift_m, 0.0])
        if all(_distinct(T, other) for other in starts):
            starts.append(T)
        if len(starts) == count:
            break
    lift = frames.rigid(np.eye(3), [0.0, 0.0, _height_m(*plans)])
    down = np.linalg.inv(plans[0].T_level_view)
    return [down @ lift @ T @ plans[1].T_level_view for T in starts]


def find_start(a: SensorView, b: SensorView) -> Pair:
    """Register b to a without a start: the best of several guesses, refused if a second one is as good."""
    guesses = sorted(starts(a, b, _STARTS), key=lambda T: coarse_merit(a, b, T), reverse=True)
    if not guesses:
        why = "no walls or other upright surfaces to find a start from: give a start pose"
        return Pair(a.name, b.name, np.full((4, 4), np.nan), np.full((6, 6), np.nan), 0.0, 0.0, (why,))
    settled: list[tuple[float, Floats]] = []
    for guess in guesses[:_SETTLED]:
        T = align_coarsely(a, b, guess)
        if all(_distinct(T, other) for _, other in settled):
            settled.append((coarse_merit(a, b, T), T))
    settled.sort(key=lambda starts: starts[0], reverse=True)
    likely = [T for merit, T in settled if merit >= _WORTH * settled[0][0]][:_TRIED]
    best, *rivals = sorted((align(a, b, T) for T in likely), key=lambda pair: pair.merit, reverse=True)
    for rival in rivals:
        if rival.merit > _RIVAL * best.merit and _distinct(rival.T_a_b, best.T_a_b):
            apart_m = float(np.linalg.norm(rival.T_a_b[:3, 3] - best.T_a_b[:3, 3]))
            return refused(best, f"another pose {apart_m:.1f} m away fits as well: the place looks alike there")
    return best


def _plan(view: SensorView) -> _Plan:
    step = max(1, len(view.fine.points_m) // _POINTS)
    points_m, normals = view.fine.points_m[::step], view.fine.normals[::step]
    T = _level(normals)
    points_m, normals = frames.apply(T, points_m), normals @ T[:3, :3].T
    wall = np.abs(normals[:, 2]) < _WALL
    floor = np.abs(normals[:, 2]) > _FLOOR[1]
    bins = np.clip(points_m[floor, 2] / _HEIGHT_M + _HEIGHTS / 2, 0, _HEIGHTS - 1).astype(int)
    floors = np.bincount(bins, np.sign(normals[floor, 2]), _HEIGHTS).astype(float)
    return _Plan(T, points_m[wall, :2], normals[wall, 0] + 1j * normals[wall, 1], floors)


def _level(normals: Float64[ndarray, "n 3"]) -> Pose:
    """Return the transform that makes the floors horizontal; identity if there is no floor within 30 deg of level."""
    up = np.array([0.0, 0.0, 1.0])
    for cosine in _FLOOR:
        floor = normals[np.abs(normals @ up) > cosine]
        if len(floor) < _MIN_FLOOR * len(normals):
            return np.eye(4)
        up = np.linalg.eigh(floor.T @ floor)[1][:, 2]
        up *= np.sign(up[2])
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    return frames.rigid(frames.rotvec_to_matrix(axis / (sine or 1.0) * np.arcsin(min(sine, 1.0))), np.zeros(3))


def _raster(points_m: Floats, arrows: Complexes, cell_m: float, size: int) -> Complexes:
    """Return the sum of the arrows in each cell, scaled to its square root, or one long wall would outweigh the rest.

    The shape is (size, size), periodic.
    """
    cells = np.floor(points_m / cell_m).astype(int) % size
    flat = cells[:, 0] * size + cells[:, 1]
    plan = np.bincount(flat, arrows.real, size * size).astype(complex)
    plan.imag = np.bincount(flat, arrows.imag, size * size)
    plan /= np.sqrt(np.maximum(np.abs(plan), 1.0))
    return plan.reshape(size, size)


def _energy(plan: Complexes) -> float:
    return float((plan.real**2 + plan.imag**2).sum())


def _height_m(a: _Plan, b: _Plan) -> float:
    """Return the height of b's scanner over a's, by floors on floors and ceilings on ceilings."""
    # Blurred over 10 cm: the levelling is not that good
    wide = np.convolve(a.floors, np.ones(5), "same")
    match = np.correlate(wide, b.floors, "full")
    return float((np.argmax(match) - (_HEIGHTS - 1)) * _HEIGHT_M)


def _distinct(T: Pose, other: Pose) -> bool:
    angle = np.angle((T[0, 0] + 1j * T[1, 0]) * (other[0, 0] - 1j * other[1, 0]))
    return bool(abs(angle) > _APART_RAD or np.linalg.norm(T[:2, 3] - other[:2, 3]) > _APART_M)
