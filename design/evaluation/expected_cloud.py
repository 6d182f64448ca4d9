"""The expected cloud of a mount: error of its points, widest gap, and points on the planes of the task."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Setting
from scanwright.design.catalogue.servo import most_backlash_deg
from scanwright.design.evaluation.coverage import hidden_regions
from scanwright.design.evaluation.gaps import wide_gap
from scanwright.design.evaluation.metres import AT_M, PlaneFigures, free_beams, on_planes, rounded
from scanwright.design.evaluation.missed_object import missed_object
from scanwright.design.findings import Finding, sentence
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import Score
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.sphere.directions import weighted_samples
from scanwright.design.task.task import LoadedTask

FAR_M = 5.0  # the second range of the error
DIRECTIONS = 5000  # of the region, for the mean distance from the axis


@dataclass(frozen=True, slots=True)
class ExpectedError:
    """Root mean square error of a point over the region, with calibrated mounting angles."""

    at_m: float  # range of the point
    range_noise_mm: float  # noise of the lidar, along the beam
    encoder_mm: float  # steps of the servo's encoder, before `assemble` smooths them
    # half of the servo's backlash, if it moves points relative to each other; null if unknown
    backlash_mm: float | None
    backlash_calibrated: bool  # whether `calibrate` can correct it: the servo turns both ways, without load by gravity
    bending_mm: float | None  # largest bending by gravity that changes over a turn; null without a build
    total_mm: float  # root of the sum of the squares of the known errors
    most_mm: float  # the same with the largest backlash of the catalogue in place of an unknown one

    def words(self) -> str:
        """Return the error and its parts as text."""
        parts = [f"range noise {_figure(self.range_noise_mm)}"]
        if self.backlash_mm is None:
            parts.append("servo backlash unknown")
        elif self.backlash_mm:
            until = " until calibrated" if self.backlash_calibrated else ""
            parts.append(f"servo backlash {_figure(self.backlash_mm)}{until}")
        parts.append(f"encoder steps {_figure(self.encoder_mm)}")
        bending = "unknown" if self.bending_mm is None else _figure(self.bending_mm)
        parts.append(f"bending {bending}")
        return f"expect {self.short()} ({', '.join(parts)})"

    def short(self) -> str:
        """Return the error and its range."""
        known = rounded(self.total_mm)
        figure = f"{known} to {rounded(self.most_mm)}" if self.backlash_mm is None else f"about {known}"
        return f"{figure} mm at {self.at_m:g} m"


@dataclass(frozen=True, slots=True)
class ExpectedCloud:
    """The cloud of one full scan. Console, report and JSON print this record; its fields are keys of the JSON."""

    expected_error: ExpectedError  # error of a point to expect at 3 m
    expected_error_far: ExpectedError | None  # the same at 5 m; null if the lidar does not reach it
    wide_gap: Finding | None  # warning of a gap much wider than the spacing of lines; null if there is none
    # warning that an object as wide as a ball of the task can get no beam; null if none can
    missed_object: Finding | None
    planes: tuple[PlaneFigures, ...]  # points on ground, walls and ceilings of the task
    empty_areas: tuple[Finding, ...]  # warning for each plane of which a part gets no points
    hidden_regions: tuple[Finding, ...]  # regions that the robot hides in part

    def lines(self) -> list[str]:
        """Return the record as lines of text."""
        far = "" if self.expected_error_far is None else f", {self.expected_error_far.short()}"
        return [
            f"{self.expected_error.words()}{far}",
            *(f"one full scan, {plane.words()}" for plane in self.planes),
            *(f"warning: {sentence(each)}" for each in (self.missed_object, self.wide_gap) if each is not None),
            *(f"{each.severity}: {sentence(each)}" for each in (*self.empty_areas, *self.hidden_regions)),
        ]


def expected_cloud(
    loaded: LoadedTask,
    problem: Problem,
    angles_rad: Setting,
    own: Score,
    shadow: SelfOcclusion | None = None,
    checks: Sequence[Finding] = (),
) -> ExpectedCloud:
    """Return the expected cloud of (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad], which has the score `own`.

    `shadow` are the beams that its parts block and `checks` the checks of these parts, if it was built.
    """
    far = expected_error(loaded, problem, angles_rad, checks, FAR_M)
    planes = on_planes(loaded, problem, angles_rad, shadow)
    return ExpectedCloud(
        expected_error(loaded, problem, angles_rad, checks),
        far if far.at_m == FAR_M else None,
        wide_gap(problem, angles_rad, free_beams(problem, angles_rad, shadow)),
        missed_object(loaded, angles_rad, own, shadow),
        planes,
        tuple(warning for plane in planes if (warning := plane.empty(problem.ball_rad)) is not None),
        hidden_regions(loaded),
    )


def expected_error(
    loaded: LoadedTask, problem: Problem, angles_rad: Setting, checks: Sequence[Finding] = (), at_m: float = AT_M
) -> ExpectedError:
    """Return the expected error of a point at a range, or at the lidar's practical range if that is shorter.

    An error of the joint angle moves a point in proportion to its distance from the axis; the root mean square distance
    over the region is used. Arguments as for `expected_cloud`.
    """
    lidar, servo = loaded.lidar, loaded.servo
    at_m = min(at_m, lidar.practical_range_m)
    samples = weighted_samples(problem.field, DIRECTIONS)
    along = samples.directions @ R_world_rot(angles_rad[0], angles_rad[1])[:, 2]
    off_mm = 1000 * at_m * math.sqrt(float(np.average(1 - along**2, weights=samples.weights)))
    by_code = {check.code: check for check in checks}
    sweeps, flanks, bend = problem.sweep is not None, by_code.get("flanks"), by_code.get("deflection_turning")
    by_gravity = flanks is not None and flanks.severity != "ok"
    # "ok" without a limit: gravity keeps the gears on one flank in both directions of a sweep
    loose = by_gravity or (sweeps and (flanks is None or flanks.limit is not None))
    backlash_mm: float | None = 0.0
    if loose:
        backlash_mm = None if servo.backlash_deg is None else off_mm * math.radians(servo.backlash_deg / 2)
    bending_mm = None if bend is None or bend.value is None else 1000 * at_m * math.radians(bend.value)
    noise_mm = float(lidar.sigma_mm(1000 * at_m))
    encoder_mm = off_mm * math.radians(servo.position_step_deg) / math.sqrt(12)
    most_mm = backlash_mm if backlash_mm is not None else off_mm * math.radians(most_backlash_deg(loaded.products) / 2)
    others_mm = noise_mm, encoder_mm, bending_mm or 0.0
    return ExpectedError(
        at_m=at_m,
        range_noise_mm=noise_mm,
        encoder_mm=encoder_mm,
        backlash_mm=backlash_mm,
        backlash_calibrated=loose and sweeps and not by_gravity,
        bending_mm=bending_mm,
        total_mm=math.hypot(*others_mm, backlash_mm or 0.0),
        most_mm=math.hypot(*others_mm, most_mm),
    )


def _figure(value_mm: float) -> str:
    return rounded(round(value_mm, 1))
