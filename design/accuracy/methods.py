"""Error against run time of every way to compute J: what the numerical defaults are chosen from.

Each method is a function (problem, angles, knob) -> J and each knob value one point of the diagram. The reference is
none of them: it cuts the polar angle at every single place where a beam enters or leaves the ball, and integrates the
smooth pieces between by Gauss-Legendre; its own error is the difference of two orders.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.special import roots_legendre

from design.accuracy.front import undominated
from design.arrays import Array, Setting
from design.density.ball_count import ball_count
from design.density.beams import beam_directions_rot, polar_and_azimuth, simulated_scan
from design.density.spin import ball_search, mean_count, zones
from design.errors import ScanwrightError, TaskError
from design.frames import R_world_rot
from design.motion import Sweep
from design.objective.named_objectives import log_density
from design.objective.problem import Problem
from design.objective.quadrature import polar_rule
from design.objective.score import quick_J
from design.sphere.directions import equal_angle_grid
from design.sphere.polar_rule import breaks_of
from design.task.task import LoadedTask

REPEATS = 5
SLOW_S = 2.0  # a point slower than this is timed once
ORDERS = 12, 20  # of the reference's Gauss-Legendre pieces
LOOK_DEG = 2.0  # how far around the setting a method's own minimum is looked for

Method = Callable[[Problem, Array, int], float]
Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Point:
    """One method at one setting of its knob; NaN and a word in `failed` where it gave no answer.

    Attributes:
        method: its name.
        setting: the knob and its value.
        J: its answer.
        J_error: distance from the reference.
        argmin_error_deg: distance of its minimum over beta_laser from that of the reference.
        seconds: of the repeats, shortest to longest.
        peak_mb: highest memory that Python and NumPy asked for.
        failed: why there is no answer.
    """

    method: str
    setting: str
    J: float
    J_error: float
    argmin_error_deg: float
    seconds: tuple[float, ...]
    peak_mb: float
    failed: str = ""


@dataclass(frozen=True, slots=True)
class Reference:
    """J to compare with, and the difference of its two orders."""

    J: float
    J_error: float


def as_log(loaded: LoadedTask) -> LoadedTask:
    """The task with the objective `log`: the report is about densities and their quadrature, whatever is minimised.

    Raises:
        TaskError: the servo sweeps; the ways compared here are those for axes that turn all around.
    """
    if isinstance(loaded.task.motion, Sweep):
        raise TaskError(
            f"{loaded.source}: motion.mode = 'sweep': the report compares ways to compute J of a turning scanner; of a "
            "sweep, `evaluate` prints the spread of J beside its ball search"
        )
    density = loaded.task.density.model_copy(update={"objective": "log"})
    return replace(loaded, task=loaded.task.model_copy(update={"density": density}))


def reference(problem: Problem, angles_rad: Setting) -> Reference:
    """J of a setting from smooth pieces; see the head of this file.

    Raises:
        TaskError: no direction has a weight.
    """
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    polar, azimuth = polar_and_azimuth(beam_directions_rot(problem.bearings_rad, angles_rad[2], angles_rad[3]))
    breaks = breaks_of(problem.field, axis, np.concatenate([polar - problem.ball_rad, polar + problem.ball_rad]))
    J = []
    for order in ORDERS:
        t, width = smooth_pieces(breaks, order)
        weight = width * np.sin(t) * problem.field.on_circles(axis, t)[0]
        seen = weight > 0
        g = zones(t[seen], polar, azimuth, problem.lines, problem.ball_rad, problem.tables[0]).mean_g
        J.append(float(weight[seen] @ g / weight[seen].sum()))
    return Reference(J[1], abs(J[1] - J[0]))


def smooth_pieces(breaks: Float[ndarray, " n"], order: int) -> tuple[Array, Array]:
    """Gauss-Legendre nodes between each two breaks, with their widths, for pieces that end in square roots."""
    x, w = roots_legendre(order)
    s = (x + 1) * np.pi / 2  # t = a + (b - a) sin^2(s / 2): square roots at both ends become smooth
    a, b = breaks[:-1, None], breaks[1:, None]
    t = a + (b - a) * np.sin(s / 2) ** 2
    return t.ravel(), ((b - a) * np.sin(s) * w * np.pi / 4).ravel()


def by_segments(problem: Problem, angles_rad: Setting, nodes: int) -> float:
    """What the program uses: exact counts on nodes that gather at the ends of segments (`design.objective.score`)."""
    return quick_J(problem, angles_rad, nodes)


def by_mean_count(problem: Problem, angles_rad: Setting, nodes: int) -> float:
    """As `by_segments`, with g of the mean count: the bound, which cannot see the gaps of a fast scan."""
    rule, polar, _ = polar_rule(problem, angles_rad, nodes)
    g = log_density(mean_count(rule.polar_rad, polar, problem.lines, problem.ball_rad))
    return float(rule.fine @ g / rule.fine.sum())


def by_rings(problem: Problem, angles_rad: Setting, rings: int) -> float:
    """Exact counts on evenly spaced rings about the axis, no thought of edges."""
    t = (np.arange(rings) + 0.5) * np.pi / rings
    return _from_rings(problem, angles_rad, t, np.sin(t))


def by_rings_single(problem: Problem, angles_rad: Setting, rings: int) -> float:
    """As `by_rings`, product and sum in single precision, as the search makes it."""
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    t = (np.arange(rings) + 0.5) * np.pi / rings
    weight = (problem.field.on_circles(axis, t)[0] * np.sin(t)).astype(np.float32)
    return float((weight / weight.sum(dtype=np.float32)) @ _zonal(problem, angles_rad, t).astype(np.float32))


def by_gauss(problem: Problem, angles_rad: Setting, nodes: int) -> float:
    """Exact counts on Gauss-Legendre nodes of the whole polar axis: best for smooth densities, which these are not."""
    z, w = roots_legendre(nodes)
    return _from_rings(problem, angles_rad, np.arccos(z), w)


def by_harmonics(problem: Problem, angles_rad: Setting, band: int) -> float:
    """Zonal harmonics of density and weight up to a degree (Funk-Hecke), their coefficients from Gauss nodes."""
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    z, w = roots_legendre(2 * band + 2)
    t = np.arccos(z)
    basis = np.polynomial.legendre.legvander(z, band)
    of_g = basis.T @ (w * _zonal(problem, angles_rad, t))
    of_weight = basis.T @ (w * problem.field.on_circles(axis, t)[0])
    degrees = 2 * np.arange(band + 1) + 1
    return float((degrees * of_g * of_weight).sum() / (2 * of_weight[0]))


def by_ball_search(problem: Problem, angles_rad: Setting, directions: int) -> float:
    """The paper's way: a simulated scan, a KD-tree, an equal-angle grid; solid angles put right, one start phase."""
    return _on_a_grid(problem, angles_rad, directions, ball_search)


def by_ball_count(problem: Problem, angles_rad: Setting, directions: int) -> float:
    """As `by_ball_search`, with the counts from a grid on the sphere (`design.density.ball_count`)."""
    return _on_a_grid(problem, angles_rad, directions, ball_count)


METHODS: dict[str, tuple[Method, str, tuple[int, ...]]] = {
    "segments": (by_segments, "nodes", (81, 243, 729, 2187, 6561, 19683, 59049)),
    "mean count": (by_mean_count, "nodes", (243, 2187, 19683)),
    "rings": (by_rings, "rings", (90, 180, 360, 720, 2880, 11520, 46080)),
    "rings, single precision": (by_rings_single, "rings", (181, 361, 2880, 46080)),
    "Gauss-Legendre": (by_gauss, "nodes", (64, 256, 1024, 2048)),
    "harmonics": (by_harmonics, "degree", (32, 128, 512)),
    "ball search": (by_ball_search, "grid rows", (30, 60, 90, 180, 360)),
    "ball count": (by_ball_count, "grid rows", (30, 60, 90, 180, 360, 720)),
}


def measure_methods(problem: Problem, angles_rad: Setting, progress: Progress) -> tuple[Reference, list[Point]]:
    """All methods at all their knobs on one setting, against the reference."""
    truth = reference(problem, angles_rad)
    nearby = LOOK_DEG * np.linspace(-1, 1, 9)
    true_minimum = _minimum(nearby, [reference(problem, _turned(angles_rad, d)).J for d in nearby])
    points = []
    for name, (method, knob, values) in METHODS.items():
        for value in values:
            progress(f"{name}, {value} {knob}")
            points.append(_point(problem, angles_rad, truth, nearby, true_minimum, name, method, knob, value))
    return truth, points


def best_points(points: list[Point], reference_error: float) -> list[bool]:
    """Whether no other point is both faster and nearer; errors below the reference's own count as equal."""
    costs = np.array([[_median(p), max(p.J_error, reference_error)] for p in points])
    answered = np.isfinite(costs[:, 1])
    return (undominated(np.where(answered[:, None], costs, np.inf)) & answered).tolist()


def _point(
    problem: Problem,
    angles_rad: Setting,
    truth: Reference,
    nearby_deg: Array,
    true_minimum_deg: float,
    name: str,
    method: Method,
    knob: str,
    value: int,
) -> Point:
    setting = f"{value} {knob}"
    try:
        J = method(problem, angles_rad, value)  # and warms up
        tracemalloc.start()
        method(problem, angles_rad, value)
        peak = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
    except (ScanwrightError, MemoryError, np.linalg.LinAlgError) as error:
        return Point(name, setting, np.nan, np.nan, np.nan, (), np.nan, str(error))
    seconds: list[float] = []
    while len(seconds) < REPEATS and (not seconds or seconds[0] < SLOW_S):
        start = time.perf_counter()
        method(problem, angles_rad, value)
        seconds.append(time.perf_counter() - start)
    around = [method(problem, _turned(angles_rad, d), value) for d in nearby_deg] if seconds[0] < SLOW_S else []
    moved = abs(_minimum(nearby_deg, around) - true_minimum_deg) if around else np.nan
    return Point(name, setting, J, abs(J - truth.J), moved, tuple(sorted(seconds)), peak)


def _median(point: Point) -> float:
    return float(np.median(point.seconds)) if point.seconds else np.inf


def _turned(angles_rad: Setting, degrees: float) -> Setting:
    return angles_rad + np.array([0.0, 0.0, 0.0, np.radians(degrees)])


def _minimum(x: Array, y: list[float]) -> float:
    """Where the parabola through the lowest sample and its neighbours is lowest."""
    i = int(np.clip(np.argmin(y), 1, len(y) - 2))
    a, b, c = y[i - 1], y[i], y[i + 1]
    bend = a - 2 * b + c
    return float(x[i] + (0 if bend <= 0 else np.clip((a - c) / (2 * bend), -1, 1)) * (x[1] - x[0]))


def _zonal(problem: Problem, angles_rad: Setting, t: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    polar, azimuth = polar_and_azimuth(beam_directions_rot(problem.bearings_rad, angles_rad[2], angles_rad[3]))
    return zones(t, polar, azimuth, problem.lines, problem.ball_rad, problem.tables[0]).mean_g


def _from_rings(problem: Problem, angles_rad: Setting, t: Float[ndarray, " n"], width: Float[ndarray, " n"]) -> float:
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    weight = problem.field.on_circles(axis, t)[0] * width
    return float(weight @ _zonal(problem, angles_rad, t) / weight.sum())


def _on_a_grid(
    problem: Problem, angles_rad: Setting, rows: int, count: Callable[[Array, Array, float], Array]
) -> float:
    grid = equal_angle_grid(180 / rows)
    weight = problem.field.weight_at(grid) * np.sqrt(np.maximum(1 - grid[:, 2] ** 2, 0))
    scan = simulated_scan(problem.bearings_rad, problem.lines, angles_rad)
    seen = weight > 0
    return float(weight[seen] @ log_density(count(scan, grid[seen], problem.ball_rad)) / weight[seen].sum())
