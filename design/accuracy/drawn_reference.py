"""J by counting: random directions at random start phases, line by line, for any field, motion and objective.

It shares nothing with what it judges but the numbers of the task, the beam table, and what the rays into a mesh hit:
rotations are scipy's, windows come from the law of cosines, weights are painted region by region, no sum is zonal.
Directions and phases are scrambled Sobol points; the spread of independent scramblings is its error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import qmc

from design.arrays import Array, Ints, Mask, Setting
from design.concurrency.compiled import njit
from design.motion import Spin, StopAndGo, Sweep
from design.task.shapes import AllRegion, BandRegion, BoxRegion, ConeRegion, PlaneRegion
from design.task.task import LoadedTask

SETS, POINTS = 8, 2**15  # scramblings, and directions that each draws in every region
LOWEST, LOOKS, NEARER = 64, 256, (1e-2, 3e-3, 1e-3, 1e-4)  # points looked about, how often, how near: of `worst`
PHASES = 2048  # of the lines of a sweep; where the start phase turns them all alike, it is continuous


@dataclass(frozen=True, slots=True)
class Counted:
    """J, three standard errors of it, the least count met, and the share of weight where none was.

    Of `worst` the error is 0: the least count that was found.
    """

    J: float
    J_error: float
    least: int
    none: float


def counted_J(loaded: LoadedTask, angles_rad: Setting, seed: int, points: int = POINTS) -> Counted:
    """J of the setting (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad].

    Args:
        loaded: the task.
        angles_rad: the setting.
        seed: of the scramblings.
        points: directions that each scrambling draws in every region; a power of two.
    """
    layers = _layers(loaded)
    ball = np.radians(loaded.task.density.ball_radius_deg)
    to_rot = Rotation.from_euler("XY", angles_rad[:2]).inv()
    bearings = loaded.lidar.bearings_rad()
    in_laser = np.stack([np.cos(bearings), np.sin(bearings), 0 * bearings], axis=1)
    beams = Rotation.from_euler("YX", angles_rad[[3, 2]]).apply(in_laser)
    order = np.argsort(np.arccos(np.clip(beams[:, 2], -1, 1)))
    lines, first, repeats, span = _lines(loaded)
    objective = loaded.task.density.objective
    moments, least, none = [], np.iinfo(int).max, 0.0

    def counted(cubes: list[Array]) -> tuple[Ints, Array, Array, Array]:
        directions, value, area, required, phase = _weighted(layers, cubes)
        turned, mine = phase * span, np.minimum((phase * (len(first) - 1)).astype(int), len(first) - 2)
        counts = repeats * _counts(to_rot.apply(directions), beams[order], turned, mine, lines, first, ball)
        return counts, value, area, required

    drawing = _drawing(layers)
    for k in range(SETS):
        rng = np.random.default_rng([seed, k])
        cubes = [qmc.Sobol(3, rng=rng).random(points) for _ in drawing]
        counts, value, area, required = counted(cubes)
        keep = value > 0
        moments.append(_moments(objective, counts[keep], value[keep], area[keep], required[keep]))
        least = min(least, int(counts[keep].min()))
        weight = value * area
        none += float(weight[counts == 0].sum() / weight.sum()) / SETS
        for reach in NEARER if objective == "worst" else ():
            cubes = _about_the_lowest(cubes, np.where(keep, counts, np.inf), reach, rng)
            counts, value, area, required = counted(cubes)
            keep = value > 0
            if keep.any():
                least = min(least, int(counts[keep].min()))
    if objective == "worst":
        return Counted(-float(np.log(1 + least)), 0.0, least, none)
    each = np.array([_joined(objective, m) for m in moments])
    J = _joined(objective, np.mean(moments, axis=0))
    return Counted(float(J), float(3 * np.std(each, ddof=1) / SETS**0.5), least, none)


@dataclass(frozen=True, slots=True)
class _Layer:
    """One region: which directions it holds, its value there, what it requires; directions drawn in it, their area."""

    region: object
    table: Array | None
    value: float
    required: float

    def holds(self, d: Array) -> Mask:
        region = self.region
        if isinstance(region, ConeRegion):
            axis = np.array(region.axis) / np.linalg.norm(region.axis)
            return np.linalg.norm(d - axis, axis=1) <= 2 * np.sin(np.radians(region.half_angle_deg) / 2)
        if isinstance(region, BandRegion):
            theta = np.degrees(np.arccos(np.clip(d[:, 2], -1, 1)))
            ahead = (np.degrees(np.arctan2(d[:, 1], d[:, 0])) - region.phi_deg[0]) % 360
            inside = (region.theta_deg[0] <= theta) & (theta <= region.theta_deg[1])
            return inside & (ahead <= region.phi_deg[1] - region.phi_deg[0])
        if isinstance(region, PlaneRegion):
            return _On(region).holds(d)
        return np.ones(len(d), dtype=bool)

    def value_at(self, d: Array) -> Array:
        if self.table is None:
            return np.full(len(d), self.value)
        rows, columns = self.table.shape
        r = np.minimum((np.arccos(np.clip(d[:, 2], -1, 1)) / np.pi * rows).astype(int), rows - 1)
        c = np.minimum((np.arctan2(d[:, 1], d[:, 0]) / (2 * np.pi) % 1 * columns).astype(int), columns - 1)
        return self.value * self.table[r, c]

    def drawn(self, u: Array) -> tuple[Array, float]:
        region = self.region
        if isinstance(region, ConeRegion):
            half = np.radians(region.half_angle_deg)
            sine = np.sin(half / 2) * np.sqrt(u[:, 0])  # of half the angle from the axis: equal areas
            polar = 2 * np.arcsin(sine)
            d = np.stack([np.sin(polar) * np.cos(2 * np.pi * u[:, 1]), np.sin(polar) * np.sin(2 * np.pi * u[:, 1])])
            there, _ = Rotation.align_vectors([region.axis], [[0, 0, 1]])
            return there.apply(np.column_stack([*d, np.cos(polar)])), 4 * np.pi * np.sin(half / 2) ** 2
        if isinstance(region, PlaneRegion):
            return _On(region).drawn(u), float("nan")
        z, phi = (-1.0, 1.0), (0.0, 2 * np.pi)
        if isinstance(region, BandRegion):
            z = tuple(np.cos(np.radians(region.theta_deg[::-1])))
            phi = tuple(np.radians(region.phi_deg))
        if self.table is not None:
            rows, columns = self.table.shape
            edges = np.cos(np.pi * np.arange(rows + 1) / rows)
            r, c = np.nonzero(self.table)
            cell = np.minimum((u[:, 0] * len(r)).astype(int), len(r) - 1)
            inside = u[:, 0] * len(r) - cell
            area = (edges[r] - edges[r + 1])[cell]
            return _at(edges[r + 1][cell] + inside * area, 2 * np.pi * (c[cell] + u[:, 1]) / columns), float("nan")
        return _at(z[0] + (z[1] - z[0]) * u[:, 0], phi[0] + (phi[1] - phi[0]) * u[:, 1]), (z[1] - z[0]) * (
            phi[1] - phi[0]
        )

    def chance(self, d: Array, area: float) -> Array:
        """Of drawing each direction, per steradian."""
        if isinstance(self.region, PlaneRegion):
            return _On(self.region).chance(d)
        if self.table is None:
            return np.where(self.holds(d), 1 / area, 0.0)
        rows, columns = self.table.shape
        edges = np.cos(np.pi * np.arange(rows + 1) / rows)
        r = np.minimum((np.arccos(np.clip(d[:, 2], -1, 1)) / np.pi * rows).astype(int), rows - 1)
        cells = np.count_nonzero(self.table) * (edges[r] - edges[r + 1]) * 2 * np.pi / columns
        return np.where(self.value_at(d) > 0, 1 / cells, 0.0)


class _On:
    """A rectangle on a plane, by where rays meet that plane.

    A point of it is drawn by two angles, one in a plane through its first side's direction, one across.
    """

    def __init__(self, region: PlaneRegion) -> None:
        a, b, _, d = (np.array(corner) for corner in region.corners_m())
        self.origin, self.along, self.across = a, b - a, d - a
        self.e1, self.e2 = self.along / np.linalg.norm(self.along), self.across / np.linalg.norm(self.across)
        normal = np.cross(self.e1, self.e2)
        self.normal = normal * np.sign(normal @ a)
        self.away = float(self.normal @ a)
        self.x = self.e1 @ a, self.e1 @ b
        self.y = self.e2 @ a, self.e2 @ d

    def holds(self, d: Array) -> Mask:
        facing = d @ self.normal
        met = d * (self.away / np.where(facing > 0, facing, np.nan))[:, None]
        x, y = met @ self.e1, met @ self.e2
        return (facing > 0) & (self.x[0] <= x) & (x <= self.x[1]) & (self.y[0] <= y) & (y <= self.y[1])

    def drawn(self, u: Array) -> Array:
        p = np.arctan2(self.x, self.away)
        turn = p[0] + (p[1] - p[0]) * u[:, 0]
        q = self._across(turn)
        lift = q[0] + (q[1] - q[0]) * u[:, 1]
        ahead = np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn)
        return np.outer(ahead[0], self.normal) + np.outer(ahead[1], self.e1) + np.outer(np.sin(lift), self.e2)

    def chance(self, d: Array) -> Array:
        p = np.arctan2(self.x, self.away)
        q = self._across(np.arctan2(d @ self.e1, d @ self.normal))
        lift = np.arcsin(np.clip(d @ self.e2, -1, 1))
        return np.where(self.holds(d), 1 / ((p[1] - p[0]) * (q[1] - q[0]) * np.cos(lift)), 0.0)

    def _across(self, turn: Array) -> tuple[Array, Array]:
        away = self.away / np.cos(turn)
        return np.arctan2(self.y[0], away), np.arctan2(self.y[1], away)


def _at(z: Array, phi: Array) -> Array:
    r = np.sqrt(np.maximum((1 - z) * (1 + z), 0))
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z])


def _layers(loaded: LoadedTask) -> tuple[list[_Layer], list[_Layer]]:
    """Weights in painting order, the background first, and masks."""
    task, maps = loaded.task, list(loaded.maps)
    asked = task.density.required or 0.0
    every = AllRegion(shape="all")

    def layer(region: object, value: float, required: float) -> _Layer:
        mapped = not isinstance(region, AllRegion | BandRegion | ConeRegion | BoxRegion | PlaneRegion)
        return _Layer(region, maps.pop(0) if mapped else None, value, required)

    weights = [_Layer(every, None, task.density.background, asked)]
    weights += [layer(r, r.value, asked if r.required is None else r.required) for r in task.weight]
    masks = [layer(r, 1.0, 0.0) for r in task.mask]
    surface = loaded.surface
    if surface is None:
        return weights, masks
    shape, d = surface.range_m.shape, surface.directions.reshape(-1, 3)
    painted, area = np.zeros(len(d)), surface.area_per_sr().ravel()
    points = surface.points_m.reshape(-1, 3)
    for one in weights:
        if isinstance(one.region, BoxRegion):
            here = ((points >= one.region.min_m) & (points <= one.region.max_m)).all(axis=1)
            painted = np.where(here, one.value * area, painted)
        else:
            painted = np.where(one.holds(d), one.value_at(d), painted)
    lidar = loaded.lidar
    reach = lidar.practical_range_m
    in_range = (surface.range_m >= lidar.range_min_mm / 1000) & (surface.range_m <= reach)
    hidden = np.zeros(len(d), dtype=bool)
    for one in masks:
        hidden |= one.holds(d) & (one.value_at(d) > 0)
    table = np.where(in_range.ravel() & ~hidden, painted, 0.0).reshape(shape)
    return [_Layer(None, table, 1.0, asked)], []


def _drawing(layers: tuple[list[_Layer], list[_Layer]]) -> list[_Layer]:
    """Regions that directions are drawn in."""
    return [one for one in layers[0] if one.value > 0 and (one.table is None or one.table.any())]


def _about_the_lowest(cubes: list[Array], counts: Array, reach: float, rng: np.random.Generator) -> list[Array]:
    """Points of the unit cubes about those of the lowest counts: a lowest count is found so, chance seldom meets it."""
    owner = np.repeat(np.arange(len(cubes)), [len(cube) for cube in cubes])
    lowest = np.argsort(counts, kind="stable")[:LOWEST]
    near = [np.repeat(np.concatenate(cubes)[lowest[owner[lowest] == i]], LOOKS, axis=0) for i in range(len(cubes))]
    return [np.clip(cube + reach * rng.uniform(-1, 1, cube.shape), 0, 1 - 1e-12) for cube in near]


def _weighted(
    layers: tuple[list[_Layer], list[_Layer]], cubes: list[Array]
) -> tuple[Array, Array, Array, Array, Array]:
    """Directions drawn from every region; of each its weight, the area it stands for, what is required, and a phase."""
    weights, masks = layers
    drawing = _drawing(layers)
    drawn = [one.drawn(u) for one, u in zip(drawing, cubes, strict=True)]
    d = np.concatenate([directions for directions, _ in drawn])
    # as often as all regions together draw it: where they overlap each of their directions stands for less
    often = sum(len(u) * one.chance(d, area) for one, u, (_, area) in zip(drawing, cubes, drawn, strict=True))
    value, required = np.zeros(len(d)), np.zeros(len(d))
    for one in weights:
        here = one.holds(d)
        value, required = np.where(here, one.value_at(d), value), np.where(here, one.required, required)
    for one in masks:
        value = np.where(one.holds(d) & (one.value_at(d) > 0), 0.0, value)
    phase = np.concatenate(cubes)[:, 2]
    seen = often > 0  # rounding may put a direction outside the edge that it was drawn at
    return d, np.where(seen, value, 0.0), 1 / np.where(seen, often, np.inf), required, phase


def _lines(loaded: LoadedTask) -> tuple[Array, Ints, int, float]:
    """Sorted joint angles [rad, 0 .. 2 pi] of start phases, one after the other; where each begins; repeats.

    And how far the start phase turns all lines alike: a grid of phases would beat with that of the lines.
    """
    motion, rate = loaded.task.motion, loaded.lidar.scan_rate_hz
    listed, span = [], 0.0
    for s in (np.arange(PHASES) + 0.5) / PHASES if isinstance(motion, Sweep) else (0.0,):
        if isinstance(motion, Sweep):
            time = (np.arange(int(np.ceil(motion.period_s * rate - s - 1e-12))) + s) / rate
            lower, upper = motion.limits_deg
            half, a = motion.period_s / 2, motion.accel_deg_s2
            ramp = (half - np.sqrt(max(half**2 - 4 * (upper - lower) / a, 0))) / 2
            t = np.where(time > half, motion.period_s - time, time)
            middle = lower + a * ramp * (t - ramp / 2)
            degrees = np.where(
                t < ramp, lower + a * t**2 / 2, np.where(t > half - ramp, upper - a * (half - t) ** 2 / 2, middle)
            )
            angles = np.radians(degrees)
        elif isinstance(motion, StopAndGo):
            span = 2 * np.pi / motion.stops
            angles = span * np.arange(motion.stops)
        else:
            assert isinstance(motion, Spin)
            turns = motion.period_s * rate
            turns = float(round(turns)) if abs(turns - round(turns)) < 1e-9 * turns and turns > 0.5 else turns
            span = 2 * np.pi
            angles = span * np.arange(int(np.ceil(turns))) / turns
        listed.append(np.sort(angles % (2 * np.pi)))
    repeats = max(1, int(motion.dwell_s * rate + 1e-9)) if isinstance(motion, StopAndGo) else 1
    return np.concatenate(listed), np.cumsum([0, *(len(one) for one in listed)]), repeats, span


@njit(cache=True)
def _counts(
    directions: Array, beams: Array, turned: Array, listed: Ints, lines: Array, first: Ints, ball: float
) -> Ints:
    counts = np.zeros(len(directions), np.int64)
    polar = np.arccos(np.minimum(1.0, np.maximum(-1.0, beams[:, 2])))
    azimuth = np.arctan2(beams[:, 1], beams[:, 0])
    turn = 2 * np.pi
    for i in range(len(directions)):
        x, y, z = directions[i]
        t = np.arctan2(np.hypot(x, y), z)
        p = np.arctan2(y, x) - turned[i]
        mine = lines[first[listed[i]] : first[listed[i] + 1]]
        for b in range(np.searchsorted(polar, t - ball - 1e-7), len(polar)):
            if polar[b] > t + ball + 1e-7:
                break
            # |d - b|^2 = (t - t_b chord)^2 + sin t sin t_b * 4 sin^2(half the azimuth between them)
            free = 4 * (np.sin(ball / 2) ** 2 - np.sin((t - polar[b]) / 2) ** 2)
            around = 4 * np.sin(t) * np.sin(polar[b])
            if free < 0:
                continue
            if free >= around:
                counts[i] += len(mine)
                continue
            half = 2 * np.arcsin(np.sqrt(free / around))
            low = (p - azimuth[b] - half) % turn
            high = low + 2 * half
            counts[i] += np.searchsorted(mine, high, side="right") - np.searchsorted(mine, low)
            if high > turn:
                counts[i] += np.searchsorted(mine, high - turn, side="right")
    return counts


def _moments(objective: str, counts: Ints, value: Array, area: Array, required: Array) -> Array:
    """What `_joined` takes: integrals over the weight, and over what has one."""
    weight, logs = value * area, np.log(1 + counts)
    if objective == "required":
        return np.array([weight @ np.maximum(0, 1 - counts / required), weight.sum()])
    if objective == "homogeneity":
        return np.array([weight @ counts**2, weight @ counts, weight.sum()])
    if objective == "kl":
        return np.array([weight @ (np.log(value) - logs), weight.sum(), area @ (1 + counts)])
    return np.array([-(weight @ logs), weight.sum()])


def _joined(objective: str, m: Array) -> float:
    if objective == "homogeneity":
        return float(np.log(m[0] * m[2] / m[1] ** 2))
    if objective == "kl":  # int p ln(p / q), p = w / int w, q = (1 + d) / int (1 + d)
        return float(m[0] / m[1] - np.log(m[1]) + np.log(m[2]))
    return float(m[0] / m[1])
