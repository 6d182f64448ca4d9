"""J by counting beams at random directions and start phases, line by line, for any weights, motion and objective.

It is independent of the closed form: rotations use Rodrigues' formula, azimuth windows the law of cosines, and weights
are painted region by region. Both share only the numbers of the task, the beam table, the hits of rays on meshes, and
the beams that parts block. Directions and phases are the points of a shifted Sobol net (Joe and Kuo 2008; its first
three dimensions); the spread of independent shifts is the error. With `quadrature = "equal_angle"` the directions are
nodes of the paper's grid.

For full turns each direction is counted at several start phases. The mean count over all phases is the sum of the
window widths, so the deviation of a count from it is a control variate: g minus its slope times that deviation has the
same mean as g and a smaller variance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit

from scanwright.design.arrays import Array, Ints, Mask, Setting
from scanwright.design.errors import TaskError
from scanwright.design.motion import Spin, StopAndGo, Sweep
from scanwright.design.objective.drawn_regions import Layer, Nodes, drawn_in, layers_of, nodes_in, value_and_required
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.sphere.directions import EMPTY
from scanwright.design.task.task import LoadedTask

COUNTED = ("log", "kl", "required", "homogeneity", "worst")  # objectives with a formula in `_moments` and `_joined`
SETS, POINTS = 8, 2**15  # shifts, and directions of each
LOWEST, TRIES, REACHES = 64, 256, (1e-2, 3e-3, 1e-3, 1e-4)  # of `worst`: lowest points, draws about each, distances
SMALL_RAD = 1e-3  # of a ball
PILOT, LEAST = 2**10, 2**4  # directions of each region: to estimate its weight; at least, for the count
PHASES = 2048  # start phases of a sweep; those of a turn are continuous
MOST_LISTED = 1_000_000  # lines of all phases of a sweep
EACH = 2  # start phases of each direction, a golden section apart
GOLDEN = (5**0.5 - 1) / 2
SPARSEST = 256.0  # largest increase of the number of directions if few have a weight
BITS = 32  # of a coordinate of the net
X, Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, slots=True)
class Counted:
    """Result of a count."""

    J: float  # the objective; for `worst` a lower bound of it
    J_error: float  # three standard errors; infinite if a set of directions has no beam, 0 for `worst`
    least: int  # lowest count of all directions
    weighted: float  # share of the drawn directions that have a weight


@dataclass(frozen=True, slots=True)
class _Sample:
    """Directions with a weight, and their counts."""

    counts: Ints  # at several start phases, shape (n, phases)
    mean: Array  # mean count over all start phases, shape (n,); NaN without a closed form
    value: Array  # weight, shape (n,)
    area: Array  # solid angle that each direction represents, shape (n,)
    required: Array  # required count, shape (n,)
    keep: Mask  # whether each drawn direction is one of these, shape (drawn,)


def counted_J(
    loaded: LoadedTask,
    angles_rad: Setting,
    seed: int,
    points: int = POINTS,
    sets: int = SETS,
    bearings_rad: Array | None = None,
    shadow: SelfOcclusion | None = None,
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Counted:
    """Return J of (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad], counted at `sets` shifts of the net.

    Each shift has about `points` directions, divided among the regions by their weight; more if few have a weight. For
    the paper's grid they are nodes, or start phases times nodes if it has fewer. `bearings_rad` replaces those of the
    lidar.

    Raises:
        TaskError: hardly any drawn direction has a weight, or the objective is not one of `COUNTED`.
    """
    if loaded.task.density.objective not in COUNTED:
        raise TaskError(f"density.objective = '{loaded.task.density.objective}': only {', '.join(COUNTED)} are counted")
    layers = layers_of(loaded)
    density = loaded.task.density
    ball = np.radians(density.ball_radius_deg)
    bearings = loaded.lidar.bearings_rad() if bearings_rad is None else bearings_rad
    blocked = np.zeros((len(bearings), 1), dtype=bool)
    if shadow is not None:
        blocked = shadow.beams[:, None] | (blocked if shadow.stator is None else shadow.stator)
    in_laser = np.stack([np.cos(bearings), np.sin(bearings), 0 * bearings], axis=1)
    alpha_rot, beta_rot, alpha_laser, beta_laser = angles_rad
    beams = _turned(_turned(in_laser, X, alpha_laser), Y, beta_laser) + lever
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    order = np.argsort(np.arccos(np.clip(beams[:, 2], -1, 1)))
    to_rot = _turned(_turned(np.eye(3), X, -alpha_rot), Y, -beta_rot)
    lines, first, repeats, span = _lines(loaded)
    objective = density.objective
    moments, least, weighted = [], np.iinfo(int).max, 0.0

    def counted(cubes: list[Array]) -> _Sample:
        directions, value, area, required, phase = (
            _weighted(layers, cubes) if nodes is None else _at_nodes(nodes, cubes)
        )
        keep = value > 0
        phases = (phase[keep, None] + GOLDEN * np.arange(each)) % 1.0
        listed = np.minimum((phases * (len(first) - 1)).astype(int), len(first) - 2)
        counts, mean = _counts(
            directions[keep] @ to_rot, beams[order], phases * span, listed, lines, first, ball, blocked[order]
        )
        if len(first) > 2 or blocked.shape[1] > 1:  # a sweep, or lines that are partly blocked: no closed form
            mean[:] = np.nan
        return _Sample(repeats * counts, repeats * mean, value[keep], area[keep], required[keep], keep)

    nodes = nodes_in(layers, density.grid_step_deg) if density.quadrature == "equal_angle" else None
    each = 1 if objective == "worst" or len(first) > 2 else EACH
    if nodes is not None:
        each = max(1, points // max(1, len(nodes.value)))
    drawing = drawn_in(layers)
    if not drawing or (nodes is not None and not len(nodes.value)):
        raise TaskError(EMPTY)
    numbers = _numbers(layers, points, seed) if nodes is None else []
    for k in range(sets):
        rng = np.random.default_rng([seed, k])
        if nodes is None:
            cubes = [_net(n, rng) for n in numbers]
        else:
            count = min(points, len(nodes.value))
            place = np.arange(count) + rng.uniform(1e-9, 1 - 1e-9, count)
            cubes = [np.column_stack([place / count, rng.uniform(size=count)])]
        sample = counted(cubes)
        if not len(sample.value):
            continue
        moments.append(_moments(objective, sample))
        weighted += float(sample.keep.mean()) / sets
        least = min(least, int(sample.counts.min()))
        for reach in REACHES if objective == "worst" else ():
            lowest = np.full(len(sample.keep), np.inf)
            lowest[sample.keep] = sample.counts.min(axis=1)
            cubes = _about_the_lowest(cubes, lowest, reach, max(1, TRIES // each), rng)
            sample = counted(cubes)
            least = min(least, int(sample.counts.min(initial=least)))
    if len(moments) < 2:
        raise TaskError(EMPTY)
    if objective == "worst":
        return Counted(-float(np.log(1 + least)), 0.0, least, weighted)
    J = _joined(objective, np.mean(moments, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):  # sets without weight or without beams
        J_error = float(3 * np.std([_joined(objective, m) for m in moments], ddof=1) / sets**0.5)
    return Counted(J, J_error if np.isfinite(J_error) else np.inf, least, weighted)


def _numbers(layers: tuple[list[Layer], list[Layer]], points: int, seed: int) -> list[int]:
    """Return the number of directions to draw in each region, by its share of the weight; powers of two."""
    regions = len(drawn_in(layers))
    rng = np.random.default_rng([seed, SETS])
    _, value, area, _, _ = _weighted(layers, [_net(PILOT, rng) for _ in range(regions)])
    points *= 1 << int(np.log2(min(SPARSEST, 1 / max((value > 0).mean(), 1e-9))))
    weight = (value * area).reshape(regions, PILOT).sum(axis=1)
    share = weight / weight.sum() if weight.sum() > 0 else np.full(regions, 1 / regions)
    return [int(2 ** np.ceil(np.log2(max(LEAST, points * one)))) for one in share]


def _turned(vectors: Array, axis: Array, angle_rad: float) -> Array:
    """Return vectors rotated about a unit axis by Rodrigues' formula."""
    along = np.outer(vectors @ axis, axis)
    return along + np.cos(angle_rad) * (vectors - along) + np.sin(angle_rad) * np.cross(axis, vectors)


def _net(count: int, rng: np.random.Generator) -> Array:
    """Return the first points of a Sobol net in the unit cube, with a random digital shift, shape (count, 3)."""
    return ((_digits(count) ^ rng.integers(1 << BITS, size=3, dtype=np.uint64)) + 0.5) / float(1 << BITS)


@lru_cache(maxsize=16)
def _digits(count: int) -> Array:
    bits = np.arange(BITS, dtype=np.uint64)
    numbers = [[1, 1, 1], [1, 3, 3]]
    for k in range(2, BITS):
        (_, _, before), (_, second, third) = numbers[k - 2 :]
        numbers.append([1, 2 * second ^ second, 2 * third ^ 4 * before ^ before])
    directions = np.array(numbers, dtype=np.uint64) << (BITS - 1 - bits)[:, None]
    points = np.zeros((count, 3), dtype=np.uint64)
    index = np.arange(count, dtype=np.uint64)
    for bit in range(count.bit_length()):
        points ^= np.where(((index >> np.uint64(bit)) & np.uint64(1))[:, None] > 0, directions[bit], np.uint64(0))
    return points


def _about_the_lowest(
    cubes: list[Array], counts: Array, reach: float, tries: int, rng: np.random.Generator
) -> list[Array]:
    """Return points of the unit cubes drawn near those with the lowest counts, where a lower count is likely."""
    owner = np.repeat(np.arange(len(cubes)), [len(cube) for cube in cubes])
    lowest = np.argsort(counts, kind="stable")[:LOWEST]
    near = [np.repeat(np.concatenate(cubes)[lowest[owner[lowest] == i]], tries, axis=0) for i in range(len(cubes))]
    moved = [cube + reach * rng.uniform(-1, 1, cube.shape) for cube in near]
    if near[0].shape[1] == 2:  # nodes of the grid are fixed: draw their phases
        moved = [np.column_stack([cube[:, 0], rng.uniform(0, 1, len(cube))]) for cube in near]
    return [np.clip(cube, 0, 1 - 1e-12) for cube in moved]


def _at_nodes(nodes: Nodes, cubes: list[Array]) -> tuple[Array, Array, Array, Array, Array]:
    """Return the result of `_weighted` for nodes of the paper's grid, which have equal areas."""
    at = (cubes[0][:, 0] * len(nodes.value)).astype(int)
    value = nodes.value[at]
    return nodes.directions[at], value, np.ones(len(at)), nodes.required[at], cubes[0][:, 1]


def _weighted(layers: tuple[list[Layer], list[Layer]], cubes: list[Array]) -> tuple[Array, Array, Array, Array, Array]:
    """Return directions drawn in all regions, with their weights, areas, required counts and phases."""
    drawing = drawn_in(layers)
    drawn = [one.drawn(u) for one, u in zip(drawing, cubes, strict=True)]
    d = np.concatenate([directions for directions, _ in drawn])
    # directions per steradian of all regions together, since regions can overlap
    per_sr = sum(len(u) * one.chance(d, area) for one, u, (_, area) in zip(drawing, cubes, drawn, strict=True))
    value, required = value_and_required(layers, d)
    phase = np.concatenate(cubes)[:, 2]
    inside = per_sr > 0  # rounding can put a direction outside the edge of its region
    return d, np.where(inside, value, 0.0), 1 / np.where(inside, per_sr, np.inf), required, phase


def _lines(loaded: LoadedTask) -> tuple[Array, Ints, int, float]:
    """Return the joint angles [0 .. 2 pi] of all lines, sorted within each start phase, and how they repeat.

    Also the index of the first line of each phase, the measurements of each line, and the angle over which a continuous
    start phase turns all lines (a grid of phases would beat with the grid of lines).
    """
    motion, rate = loaded.task.motion, loaded.lidar.scan_rate_hz
    listed, span = [], 0.0
    phases = int(np.clip(MOST_LISTED / (motion.duration_s * rate), 64, PHASES)) if isinstance(motion, Sweep) else 1
    for s in (np.arange(phases) + 0.5) / phases:
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


@njit(cache=True, error_model="numpy")
def _before(lines: Array, angle: float, step: float) -> int:
    """Return the number of lines before an angle; `step` is their distance, or 0 if it varies."""
    return min(len(lines), int(np.ceil(angle / step))) if step > 0 else int(np.searchsorted(lines, angle))


@njit(cache=True, error_model="numpy")
def _free(lines: Array, first: int, last: int, turned: float, blocked: Mask) -> int:
    """Return the number of the lines first .. last at whose joint angle the beam is free."""
    steps = len(blocked)
    if steps == 1:
        return last - first
    free = 0
    for k in range(first, last):
        free += not blocked[int(np.rint((lines[k] + turned) * steps / (2 * np.pi))) % steps]
    return free


@njit(cache=True, error_model="numpy")
def _counts(
    directions: Array,
    beams: Array,
    turned: Array,
    listed: Ints,
    lines: Array,
    first: Ints,
    ball: float,
    blocked: Mask,
) -> tuple[Ints, Array]:
    """Return the free beams within the ball of each direction at its phases, (n, phases), and the mean count, (n,).

    `blocked` is at equal steps of the axis angle, (beams, steps). The mean is over all start phases of a turn without
    blocked lines.
    """
    counts, mean = np.zeros(turned.shape, np.int64), np.zeros(len(directions))
    polar = np.arccos(np.minimum(1.0, np.maximum(-1.0, beams[:, 2])))
    azimuth = np.arctan2(beams[:, 1], beams[:, 0])
    flat, upright, cos_ball = np.sin(polar), np.cos(polar), np.cos(ball)
    turn, count = 2 * np.pi, first[1]
    step = lines[1] - lines[0] if len(first) == 2 and count > 1 else 0.0  # lines of a sweep are not evenly spaced
    for i in range(len(directions)):
        x, y, z = directions[i]
        across = np.hypot(x, y)
        t = np.arctan2(across, z)
        p = np.arctan2(y, x)
        for b in range(np.searchsorted(polar, t - ball - 1e-7), len(polar)):
            if polar[b] > t + ball + 1e-7:
                break
            if blocked.shape[1] == 1 and blocked[b, 0]:
                continue
            # the law of cosines: cos(ball) = z z_b + across across_b cos(azimuth between them at the edge of the ball)
            free = 2 * (z * upright[b] + across * flat[b] - cos_ball)
            if ball < SMALL_RAD:  # without a difference of cosines, which loses digits
                free = 4 * (np.sin(ball / 2) ** 2 - np.sin((t - polar[b]) / 2) ** 2)
            around = 4 * across * flat[b]
            if free < 0:
                continue
            half = np.pi if free >= around else 2 * np.arcsin(np.sqrt(free / around))
            start = p - azimuth[b] - half
            mean[i] += count * half / np.pi
            for k in range(turned.shape[1]):
                phase_lines = lines[first[listed[i, k]] : first[listed[i, k] + 1]]
                low = (start - turned[i, k]) % turn
                high = low + 2 * half
                before = _before(phase_lines, low, step), _before(phase_lines, high, step)
                counts[i, k] += _free(phase_lines, *before, turned[i, k], blocked[b])
                if high > turn:
                    counts[i, k] += _free(
                        phase_lines, 0, _before(phase_lines, high - turn, step), turned[i, k], blocked[b]
                    )
    return counts, mean


def _moments(objective: str, sample: _Sample) -> Array:
    """Return the integrals that `_joined` combines to J."""
    value, area = sample.value, sample.area
    required = sample.required[:, None]
    weight = value * area

    def mean_of(g: Callable[[Array], Array]) -> Array:
        """Return the mean of g over the start phases, shape (n,); the deviation of the count is a control variate."""
        mean = sample.mean[:, None]
        slope = g(mean + 0.5) - g(mean - 0.5)
        control = np.where(np.isnan(mean), 0.0, slope * (sample.counts - mean))
        return np.asarray((g(sample.counts) - control).mean(axis=1))

    if objective == "required":
        return np.array([weight @ mean_of(lambda d: np.maximum(0, 1 - d / required)), weight.sum()])
    if objective == "homogeneity":
        return np.array([weight @ mean_of(np.square), weight @ mean_of(lambda d: 1.0 * d), weight.sum()])
    logs = mean_of(np.log1p)
    if objective == "kl":
        return np.array([weight @ (np.log(value) - logs), weight.sum(), area @ mean_of(lambda d: 1.0 + d)])
    return np.array([-(weight @ logs), weight.sum()])


def _joined(objective: str, m: Array) -> float:
    if objective == "homogeneity":
        return float(np.log(m[0] * m[2] / m[1] ** 2)) if m[1] > 0 else np.inf
    if objective == "kl":  # int p ln(p / q), p = w / int w, q = (1 + d) / int (1 + d)
        return float(m[0] / m[1] - np.log(m[1]) + np.log(m[2]))
    return float(m[0] / m[1])
