"""The optimum of a task compared with other mounts and products.

The reference mounts (`design.search.mounts.reference`) have the lidar, the servo and the period of the task. Two more
scanners, the shipped tasks `SCANNERS`, have other products, motion and angles: that of the paper and a cheap one.
All are compared by beams per ball (geometric mean, `exp(-J) - 1`) per dollar, range and noise, each over its own time.

Ready-made scanners are the `multibeam` products of the catalogue, mounted upright with x ahead. Their layers are cones
about the axis, so they are computed as a field of view whose bearings are the elevations, in a plane that contains the
axis. Each has two rows: one turn, and the complete turns within the period of the task. The speed varies by some 3 rpm,
so that the sensor "fills in the gaps" over time (VLS-128 User Manual, section 8.3.2); how evenly is not documented. As
g is convex, for any turns

    g(n mean)  <=  < g(d_1 + .. + d_n) >  <=  < g(n d_1) >,

with equality on the left if turns interlace to the mean, and on the right if they repeat. J is the middle, and half of
the difference is part of `J_error`. Not modelled: azimuth offsets of single lasers, range, dropouts.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.angles import angles_words
from scanwright.design.arrays import Array, Counts, Setting
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.products import Bearing, Belt, Multibeam
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.density.ball_count import ball_count
from scanwright.design.density.beams import ScanLines
from scanwright.design.evaluation.as_built import seen_of
from scanwright.design.evaluation.coverage import coverage
from scanwright.design.objective.ball_search import SETS
from scanwright.design.objective.named_objectives import beams_per_ball
from scanwright.design.objective.problem import NODES, Problem, with_scanner
from scanwright.design.objective.score import Score, blind_share, score_on
from scanwright.design.progress import Progress, no_progress
from scanwright.design.search.families import Family
from scanwright.design.search.mounts.reference import TunedMount
from scanwright.design.search.search import search
from scanwright.design.search.with_parts import score_with
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.sphere.directions import sample_set, spiral
from scanwright.design.task.task import LoadedTask, load_task

LAYERED = 5.0  # factor of the usual error estimate, since every layer has edges inside the segments
UPRIGHT_RAD = np.radians([0.0, 0.0, 90.0, 0.0])  # scan plane x-z that turns about z: bearings are elevations
AS_BUILT = "as built, with parts"
Bought = Lidar | Servo | SlipRing | Bearing | Belt
SCANNERS = ("ground_ahead", "low_cost")  # shipped tasks
PHASES = 4  # start phases for a scanner that sees part of a turn, so is not rotationally symmetric
DIRECTIONS = 10_000  # for the same
BLIND_DIRECTIONS = 100_000


@dataclass(frozen=True, slots=True)
class ComparisonRow:
    """One candidate over one measuring time.

    Attributes:
        name: of the candidate.
        setting: its mounting angles or orientation.
        time_s: measuring time, to which all numbers but points_per_s refer.
        turns: of the axis in that time.
        J: the objective of the task.
        J_error: bound of its error.
        blind_fraction: blind share of the unmasked sphere.
        blind_weight: blind share of the weight of the task.
        gap_deg: widest distance between neighbouring scan lines or layers, perpendicular to them.
        layers: beams of the 2D lidar, or lasers of a multibeam.
        points_per_s: measurements per second; for a multibeam as stated by its maker.
        range_stated_m: largest range as stated by the maker of the lidar; None for a multibeam (not in the catalogue).
        range_practical_m: largest range that users of the lidar get, else as stated; None likewise.
        range_sigma_mm: noise of one range; None likewise.
        beams_per_ball: exp(-J) - 1, the geometric mean; None for objectives other than `log`.
        beams_per_ball_per_usd: also None if a price is unknown.
        cost_usd: lidar, servo and slip ring, or the scanner; None if a price is unknown.
    """

    name: str
    setting: str
    time_s: float
    turns: int
    J: float
    J_error: float
    blind_fraction: float
    blind_weight: float
    gap_deg: float
    layers: int
    points_per_s: float
    range_stated_m: float | None
    range_practical_m: float | None
    range_sigma_mm: float | None
    beams_per_ball: float | None
    beams_per_ball_per_usd: float | None
    cost_usd: float | None


def compare(
    loaded: LoadedTask,
    problem: Problem,
    best: Family,
    mounts: tuple[TunedMount, ...],
    progress: Progress = no_progress,
    built: tuple[Setting, SelfOcclusion] | None = None,
) -> list[ComparisonRow]:
    """Return rows of the optimum, the reference mounts, other scanners, and every multibeam of the catalogue.

    `built`, the angles [rad] of a build and the beams that its parts block, makes the first row.
    """
    rows = [_rotating("optimum", loaded, problem, best.angles_rad, best.score)]
    if built is not None:
        setting, shadow = built
        result = score_with(problem, setting, shadow)
        rows.insert(0, _rotating(AS_BUILT, loaded, problem, setting, result, shadow))
    rows += [_rotating(mount.name, loaded, problem, mount.angles_rad, mount.score) for mount in mounts]
    for name in SCANNERS:
        other = load_task(Path(name))
        if bought(other) != bought(loaded):
            progress(name)
            on_other = with_scanner(problem, other.lidar, other.task.motion)
            family = search(on_other, other.task.angles).best[0]
            rows.append(_rotating(name, other, on_other, family.angles_rad, family.score))
    for product in loaded.products:
        if isinstance(product, Multibeam):
            progress(product.name)
            full = max(1, int(np.floor(loaded.task.motion.duration_s * product.turn_rate_hz + 1e-9)))
            rows += [ready_made(problem, product, turns) for turns in sorted({1, full})]
    return rows


def ready_made(problem: Problem, product: Multibeam, turns: int) -> ComparisonRow:
    """Return the row of a multibeam over a number of turns."""
    figures = _zonal if np.ptp(product.azimuth_deg) == 360 else sampled
    J, J_error, blind_fraction, blind_weight = figures(problem, product, turns)
    return ComparisonRow(
        name=product.name,
        setting="upright",
        time_s=turns / product.turn_rate_hz,
        turns=turns,
        J=J,
        J_error=J_error,
        blind_fraction=blind_fraction,
        blind_weight=blind_weight,
        gap_deg=float(np.diff(product.elevations_deg).max()),
        layers=len(product.elevations_deg),
        points_per_s=product.points_per_second,
        range_stated_m=None,
        range_practical_m=None,
        range_sigma_mm=None,
        **per_ball(beams_per_ball(problem.objective, J), product.price_usd),
    )


def layer_lines(product: Multibeam) -> ScanLines:
    """Return the azimuths of the measurements of each layer in one turn, with the step rounded to an integer number."""
    span = np.ptp(product.azimuth_deg)
    count = max(1, round(span / product.azimuth_step_deg))
    return ScanLines(count, float(np.radians(span / count)))


def multibeam_scan(product: Multibeam, start: float = 0.0) -> Float[ndarray, "n 3"]:
    """Return the directions of one turn, shape (lines * layers, 3); `start` is the start phase in azimuth steps."""
    lines = layer_lines(product)
    azimuth = np.radians(product.azimuth_deg[0]) + lines.angles_rad + start * lines.step_rad
    p, e = np.meshgrid(azimuth, np.radians(product.elevations_deg), indexing="ij")
    return np.stack([np.cos(e) * np.cos(p), np.cos(e) * np.sin(p), np.sin(e)], axis=-1).reshape(-1, 3)


def sampled(problem: Problem, product: Multibeam, turns: int) -> tuple[float, float, float, float]:
    """Return J, J_error, blind share of the sphere and of the weight by counting, for less than a full turn."""
    scans = [multibeam_scan(product, (i + 0.5) / PHASES) for i in range(PHASES)]

    def counts(directions: Array) -> Counts:
        return np.stack([ball_count(scan, directions, problem.ball_rad) for scan in scans])

    uppers, lowers, blind = [], [], []
    for index in range(SETS):
        upper, lower = [], []
        for moment in problem.objective.moments:
            samples = sample_set(moment.field, problem.grid_step_deg, DIRECTIONS, index)
            result = turns * counts(samples.directions)
            share = samples.weights / samples.weights.sum()
            if moment.gathered == "highest":
                upper.append(moment.g(result).max())
                lower.append(moment.g(result.mean(axis=0)).max())
            else:
                upper.append(moment.g(result).mean(axis=0) @ share)
                lower.append(moment.g(result.mean(axis=0)) @ share)
            if moment is problem.objective.moments[0]:
                blind.append(blind_share(samples.weights, result.max(axis=0) == 0))
        uppers.append(float(problem.objective.join(np.array(upper))))
        lowers.append(float(problem.objective.join(np.array(lower))) if turns > 1 else uppers[-1])
    sphere = spiral(BLIND_DIRECTIONS)
    unseen = counts(sphere[~problem.field.masked_at(sphere)]).max(axis=0) == 0
    middles = (np.array(uppers) + lowers) / 2
    J, J_error = float(middles.mean()), 0.0
    if np.isfinite([*uppers, *lowers]).all():  # else there are no beams, and the objective divides by counts
        J_error = float(np.mean(uppers) - np.mean(lowers)) / 2
        J_error += 4 * float(np.std(middles, ddof=1)) / len(middles) ** 0.5 if len(middles) > 1 else 0.0
    return J, J_error, float(unseen.mean()) if len(unseen) else 0.0, float(np.mean(blind))


def _rotating(
    name: str,
    loaded: LoadedTask,
    problem: Problem,
    angles_rad: Setting,
    judged: Score,
    shadow: SelfOcclusion | None = None,
) -> ComparisonRow:
    seen = seen_of(problem, angles_rad, judged, shadow)
    return ComparisonRow(
        name=name,
        setting=angles_words(np.degrees(angles_rad).round(2) + 0.0),
        time_s=loaded.task.motion.duration_s,
        turns=1,
        J=judged.J,
        J_error=judged.J_error,
        blind_fraction=seen.blind_fraction,
        blind_weight=seen.blind_weight,
        gap_deg=seen.line_gap_deg,
        layers=len(problem.bearings_rad),
        points_per_s=loaded.lidar.scan_rate_hz * len(problem.bearings_rad),
        range_stated_m=loaded.lidar.stated_range_m,
        range_practical_m=loaded.lidar.practical_range_m,
        range_sigma_mm=loaded.lidar.range_sigma_mm,
        **per_ball(beams_per_ball(problem.objective, judged.J), price_usd(bought(loaded))),
    )


def bought(loaded: LoadedTask) -> list[Bought]:
    """Return the products whose prices are the cost of a task."""
    ring = loaded.task.slip_ring
    return [loaded.lidar, loaded.servo, *([loaded.products.get(ring, SlipRing)] if ring else [])]


def price_usd(products: Iterable[Bought]) -> float | None:
    """Return the sum of the prices; None if one is unknown."""
    prices = [product.price_usd for product in products]
    known = [price for price in prices if price is not None]
    return sum(known) if len(known) == len(prices) else None


def per_ball(beams: float | None, cost_usd: float | None) -> dict[str, float | None]:
    """Return beams per ball, cost, and their ratio, by the names of the fields of a row; None if unknown."""
    each = None if beams is None or cost_usd is None else beams / cost_usd
    return {"beams_per_ball": beams, "beams_per_ball_per_usd": each, "cost_usd": cost_usd}


def _zonal(problem: Problem, product: Multibeam, turns: int) -> tuple[float, float, float, float]:
    """Return J, J_error, blind share of the sphere and of the weight of a multibeam with a full turn of azimuths."""
    lines = layer_lines(product)
    fan = problem.with_beams(np.radians(product.elevations_deg), replace(lines, repeats=turns))
    judged = score_on(fan, UPRIGHT_RAD, NODES)
    J, half = judged.J, LAYERED * judged.J_error
    if turns > 1:
        J, half = (judged.J + judged.J_lower) / 2, half + (judged.J - judged.J_lower) / 2
    rounding = abs(lines.step_rad / np.radians(product.azimuth_step_deg) - 1)  # of d; -ln(1 + d) changes by less
    return J, half + rounding, coverage(fan, UPRIGHT_RAD).blind_fraction, judged.blind_weight
