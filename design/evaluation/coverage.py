"""Blind and masked shares of the sphere, mean beam density, and points per square metre of a mount."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Setting, Vector
from scanwright.design.density.beams import blind_zones, polar_and_azimuth
from scanwright.design.density.spin import mean_count
from scanwright.design.density.sweep import mean_count_swept
from scanwright.design.density.visible import free_lines, mean_count_free
from scanwright.design.findings import Finding, Severity
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.holes import percent
from scanwright.design.objective.problem import Problem
from scanwright.design.scene.surface import Surface
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.sphere.directions import spiral
from scanwright.design.sphere.regions import field_of
from scanwright.design.sphere.total_weight import total_weight
from scanwright.design.task.shapes import BandRegion, OnPlane, Region
from scanwright.design.task.task import LoadedTask

CIRCLES = 10_000
TABLE = 3601  # polar angles
UNSEEN = 1e-9  # mean beams in a ball that are rounding
HIDDEN = 0.005  # masked share of a region that is not reported
MOST_HIDDEN = 0.5  # masked share of a region above which the scanner misses its purpose


def hidden_regions(loaded: LoadedTask) -> tuple[Finding, ...]:
    """Return one finding for each region of which the masks hide more than `HIDDEN`: a warning above `MOST_HIDDEN`."""
    if not loaded.task.mask:
        return ()
    findings = []
    for i, region in enumerate(loaded.task.weight):
        share = hidden_share(loaded, region) if region.value > 0 else 0.0
        if share <= HIDDEN:
            continue
        words = region.words() if isinstance(region, OnPlane | BandRegion) else f"weight.{i} ({region.shape})"
        message = f"the robot hides {percent(share)} of the directions to {words}"
        most = share > MOST_HIDDEN
        hint = "move the scanner to the robot's edge or higher up, or choose a region farther away" if most else ""
        severity: Severity = "warning" if most else "note"
        findings.append(Finding("hidden_region", severity, f"weight.{i}", message, share, MOST_HIDDEN, "1", hint))
    return tuple(findings)


def hidden_share(loaded: LoadedTask, region: Region) -> float:
    """Return the share of the weight of one region of the task that the masks hide."""
    unmasked = replace(loaded, task=loaded.task.model_copy(update={"mask": ()}))
    seen, unhidden = (
        total_weight(field_of(each, lambda other: float(other is region), background=0.0))
        for each in (loaded, unmasked)
    )
    return 1 - seen / unhidden if unhidden > 0 else 0.0


@dataclass(frozen=True, slots=True)
class Coverage:
    """Shares of solid angle."""

    blind_fraction: float  # share of the unmasked sphere that is blind at every start phase
    masked_fraction: float  # masked share of the sphere


def coverage(problem: Problem, angles_rad: Setting, shadow: SelfOcclusion | None = None) -> Coverage:
    """Return the blind and masked shares for (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad].

    Raises:
        BuildError: `shadow`, the beams that its parts block, has another number of beams.
    """
    axis = R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    if problem.sweep is not None or (shadow is not None and shadow.partly().any()):
        return _on_directions(problem, angles_rad, shadow)
    problem = problem if shadow is None else problem.behind(shadow)
    polar, _ = polar_and_azimuth(problem.beams_rot(angles_rad[2:]))
    up = np.array([0.0, 0.0, 1.0])
    open_share = _unmasked(problem, up, 0.0, np.pi)
    blind = sum(_unmasked(problem, axis, a, b) for a, b in blind_zones(problem.bearings_rad, polar, problem.ball_rad))
    return Coverage(
        blind_fraction=blind / open_share if open_share > 0 else 0.0,
        masked_fraction=max(0.0, 1.0 - open_share),
    )


def _on_directions(problem: Problem, angles_rad: Setting, shadow: SelfOcclusion | None) -> Coverage:
    """Return the coverage from directions of equal solid angle, for a density without rotational symmetry."""
    directions = spiral(CIRCLES)
    masked = problem.field.masked_at(directions)
    seen = mean_density_at(problem, angles_rad, directions[~masked], shadow) > UNSEEN
    return Coverage(float((~seen).mean()) if len(seen) else 0.0, float(masked.mean()))


def mean_density_at(
    problem: Problem, angles_rad: Setting, directions: Float[ndarray, "n 3"], shadow: SelfOcclusion | None = None
) -> Float[ndarray, " n"]:
    """Return the mean number of beams per ball at unit vectors, without the beams that `shadow` blocks.

    It is interpolated in a table over the polar angle if the axis makes full turns.
    """
    if shadow is not None:
        return _density_behind(problem, angles_rad, directions, shadow)
    R = R_world_rot(angles_rad[0], angles_rad[1])
    beams = problem.beams_rot(angles_rad[2:])
    if problem.sweep is not None:
        return mean_count_swept(directions @ R, beams, problem.sweep, problem.ball_rad)
    table = np.linspace(0, np.pi, TABLE)
    counts = mean_count(table, polar_and_azimuth(beams)[0], problem.lines, problem.ball_rad)
    return np.interp(np.arccos(np.clip(directions @ R[:, 2], -1, 1)), table, counts)


def _density_behind(
    problem: Problem, angles_rad: Setting, directions: Float[ndarray, "n 3"], shadow: SelfOcclusion
) -> Float[ndarray, " n"]:
    """Return `mean_density_at` as the sum over beams that are always free and beams that are free at some angles."""
    seen, partly = problem.behind(shadow), shadow.partly()
    if shadow.stator is None or not partly.any():
        return mean_density_at(seen, angles_rad, directions)
    always = problem.with_beams(problem.bearings_rad[~(shadow.beams | partly)], problem.lines, problem.sweep)
    R = R_world_rot(angles_rad[0], angles_rad[1])
    free = free_lines(shadow.stator[partly], problem.lines, problem.sweep)
    beams = problem.beams_rot(angles_rad[2:])[partly]
    at_times = mean_count_free(directions @ R, beams, free, problem.ball_rad)
    return mean_density_at(always, angles_rad, directions) + at_times


def points_per_m2(problem: Problem, angles_rad: Setting, surface: Surface) -> Float[ndarray, "rows columns"]:
    """Return the mean points per square metre of surface over the start phase; 0 without a surface."""
    area = surface.area_per_sr()
    density = mean_density_at(problem, angles_rad, surface.directions.reshape(-1, 3)).reshape(area.shape)
    per_sr = density / (2 * np.pi * (1 - np.cos(problem.ball_rad)))
    return np.divide(per_sr, area, out=np.zeros_like(area), where=area > 0)


def on_surfaces(problem: Problem, angles_rad: Setting, surface: Surface) -> dict[str, float]:
    """Return the lowest and the median (by area) points per square metre in the weighted region."""
    density = points_per_m2(problem, angles_rad, surface).ravel()
    directions = surface.directions.reshape(-1, 3)
    solid_angle = np.sqrt(1 - directions[:, 2] ** 2)  # of equal cells in theta and phi
    area = np.where(problem.field.weight_at(directions) > 0, surface.area_per_sr().ravel() * solid_angle, 0.0)
    order = np.argsort(density)
    seen = order[area[order] > 0]
    middle = seen[np.searchsorted(np.cumsum(area[seen]), area[seen].sum() / 2)]
    return {"lowest_points_per_m2": float(density[seen[0]]), "median_points_per_m2": float(density[middle])}


def _unmasked(problem: Problem, axis: Vector, low_rad: float, high_rad: float) -> float:
    """Return the share of the sphere between two polar angles about an axis and outside the masks."""
    height = np.cos(low_rad) - np.cos(high_rad)
    z = np.cos(low_rad) - height * (np.arange(CIRCLES) + 0.5) / CIRCLES
    _, shares = problem.field.on_circles(axis, np.arccos(np.clip(z, -1, 1)))
    return float(shares.mean() * height / 2)
