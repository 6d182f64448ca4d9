"""The chance to hit a pole, against a slow loop over poles and rays, and laws."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scanwright.design.density.beams import ScanLines, scan_lines
from scanwright.design.errors import TaskError
from scanwright.design.evaluation.poles import Pole, pole_chances, require_in_range
from scanwright.design.frames import R_rot_laser, R_world_rot, Rz
from scanwright.design.objective.problem import problem_of
from scanwright.design.sphere.painting import COLUMNS, VALUE
from scanwright.design.task.task import Task, load_task

PARALLEL = np.radians([0, 0, 0, -90])  # the scan plane holds the upright axis: lines run along the poles
CROSSING = np.radians([0, 0, 45, 0])
TILTED = np.radians([20, 35, -50, 35])


def turning(name, period_s=2.0, lines=None):
    problem = problem_of(load_task(Path(name)))
    return problem.with_beams(problem.bearings_rad[::6], lines or scan_lines(period_s, 40.0))


def by_rays(problem, angles_rad, pole, draws, seed):
    """One pole and one start at a time; every beam of every line is a ray past an upright line."""
    rng = np.random.default_rng(seed)
    counts = []
    while len(counts) < draws:
        where, heights = rng.uniform(-np.pi, np.pi), rng.uniform(-0.5, 0.5) * pole.height_m
        foot = np.array([np.cos(where), np.sin(where), 0.0]) * pole.range_m
        point = np.array([*foot[:2], heights])
        if (
            rng.random() >= problem.field.weight_at(point[None] / np.linalg.norm(point))[0]
        ):  # all weights here are 0 or 1
            continue
        if problem.sweep is None:
            joints = problem.lines.angles_rad + rng.uniform(0, 2 * np.pi)
        else:
            joints = problem.sweep.angles_rad(rng.random())
        R = R_world_rot(*angles_rad[:2], joints) @ R_rot_laser(*angles_rad[2:])
        rays = (R[:, None] @ Rz(problem.bearings_rad))[..., 0].reshape(-1, 3)
        level = np.hypot(*rays.T[:2])
        ahead = rays @ foot > 0
        passes = np.abs(rays[:, 0] * foot[1] - rays[:, 1] * foot[0]) <= pole.width_m / 2 * level
        there = np.abs(rays[:, 2]) * pole.range_m <= pole.height_m / 2 * level
        hit = rays[ahead & passes & there]
        hits = int((~problem.field.masked_at(hit)).sum())
        counts.append(hits * problem.lines.repeats)
    return np.array(counts)


swept = problem_of(load_task(Path("indoor_urg")))
swept = swept.with_beams(swept.bearings_rad[::3], swept.lines, swept.sweep)
ahead = load_task(Path("uniform"))
hidden = {"mask": [{"shape": "band", "theta_deg": [90, 180]}]}
hidden = problem_of(replace(ahead, task=Task.model_validate(ahead.task.model_dump() | hidden)))
hidden = hidden.with_beams(hidden.bearings_rad[::6], scan_lines(1.0, 40.0))
CASES = {
    "lines along the pole": (turning("uniform"), PARALLEL, Pole(0.1, 1.0, 5.0)),
    "lines across, the turn not of whole lines": (turning("uniform", 1.03), CROSSING, Pole(0.03, 1.0, 5.0)),
    "a region and a mask": (turning("ground_ahead"), TILTED, Pole(0.1, 2.0, 3.0)),
    "lower halves hidden": (hidden, TILTED, Pole(0.1, 2.0, 5.0)),
    "stop and go": (turning("uniform", lines=ScanLines(40, np.pi / 20, 2)), TILTED, Pole(0.05, 1.0, 3.0)),
    "a sweep": (swept, TILTED, Pole(0.01, 0.2, 3.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_against_one_ray_at_a_time(name):
    problem, angles, pole = CASES[name]
    counts = by_rays(problem, angles, pole, 250, seed=5)
    for found in pole_chances(problem, angles, pole).chances:
        hit = counts >= found.beams
        noise = 4 * np.sqrt(max(hit.mean() * (1 - hit.mean()), 1 / len(hit)) / len(hit))
        assert abs(hit.mean() - found.chance) <= noise + found.error


def test_poles_between_upright_lines_are_missed_by_the_width_of_the_gap():
    """80 upright lines 4.5 deg apart: a pole 1 deg wide is hit where one is within 0.5 deg of its middle."""
    problem = turning("uniform")
    one_degree = 2 * 5.0 * np.sin(np.radians(0.5))
    chances = pole_chances(problem, PARALLEL, Pole(one_degree, 1.0, 5.0)).chances
    assert chances[0].chance == pytest.approx(1 / 4.5, abs=chances[0].error)
    assert chances[0].error < 2e-3


def test_crossing_lines_hit_what_parallel_ones_miss():
    """The paper's Fig. 3."""
    problem, pole = turning("uniform"), Pole(0.1, 1.0, 5.0)
    parallel, crossing = (pole_chances(problem, angles, pole).chances[0].chance for angles in (PARALLEL, CROSSING))
    assert parallel < 0.5
    assert crossing > 0.99


@pytest.mark.parametrize("angles", [PARALLEL, TILTED])
def test_wider_higher_or_slower_is_no_worse_and_more_beams_are_rarer(angles):
    problem = turning("ground_ahead")
    slow = problem.with_beams(problem.bearings_rad, scan_lines(4.0, 40.0))
    base = pole_chances(problem, angles, Pole(0.05, 1.0, 3.0)).chances
    wider = pole_chances(problem, angles, Pole(0.1, 1.0, 3.0)).chances
    slower = pole_chances(slow, angles, Pole(0.05, 1.0, 3.0)).chances
    assert base[0].chance >= base[1].chance
    for before, after in zip(base * 2, wider + slower, strict=True):
        assert after.chance >= before.chance - before.error - after.error


def test_a_pole_outside_the_region_stands_anywhere_that_is_not_hidden():
    problem = turning("ground_ahead")
    assert pole_chances(problem, TILTED, Pole(0.1, 0.2, 10.0)).stands == "unmasked"
    assert pole_chances(problem, TILTED, Pole(0.1, 2.0, 3.0)).stands == "weighted"
    masked = turning("uniform")
    hidden = replace(problem.field.mask, rows=np.eye(1, COLUMNS, VALUE))  # all is hidden
    blind = masked.with_objective(replace(masked.objective, field=replace(masked.field, mask=hidden)))
    with pytest.raises(TaskError, match="hides every azimuth"):
        pole_chances(blind, TILTED, Pole(0.1, 0.2, 10.0))


@pytest.mark.parametrize(
    ("sizes", "complaint"),
    [
        ((0.02, -1.0, 5.0), "height_m = -1: must be above 0"),
        ((np.nan, 1.0, 5.0), "width_m = nan"),
        ((0.02, 1.0, 50.0), "measures from 0.1 to 15 m"),
        ((10.0, 1.0, 5.0), "inside the pole"),
    ],
)
def test_a_pole_that_cannot_be_measured_is_refused(sizes, complaint):
    lidar = load_task(Path("uniform")).lidar
    require_in_range(Pole(9.0, 1.0, 5.0), lidar)
    with pytest.raises(TaskError, match=complaint):
        require_in_range(Pole(*sizes), lidar)


@pytest.mark.parametrize("text", ["20,1000", "20,x,5", ""])
def test_the_text_of_a_pole_is_three_numbers(command, text):
    code, _, complaints = command("evaluate", "ceiling", "--angles=0,0,0,-90", f"--pole={text}")
    assert (code, len(complaints)) == (2, 1)
    assert f"--pole = '{text}': must be WIDTH_MM,HEIGHT_MM,RANGE_M, such as 20,1000,5" in complaints[0]


def test_evaluate_tells_of_a_pole(command):
    code, out, _ = command("evaluate", "ceiling", "--angles=0,0,0,-90", "--pole=20,1000,5")
    assert code == 0
    lines = [line.split() for line in out.splitlines() if line.startswith("pole")]
    problem = problem_of(load_task(Path("ceiling")))
    expected = pole_chances(problem, PARALLEL, Pole(0.02, 1.0, 5.0)).chances
    assert [line[1] for line in lines] == [f"{chance.chance:.2%}" for chance in expected]
    code, _, complaints = command("evaluate", "ceiling", "--angles=0,0,0,-90", "--pole=20,1000,500")
    assert code == 2
    assert len(complaints) == 1


def test_a_pole_is_hit_from_where_the_optical_centre_is():
    problem = problem_of(load_task(Path("ceiling")))
    setting, pole = np.radians([0.0, 0.0, 0.0, -90.0]), Pole(0.02, 1.0, 5.0)
    on_axis, off_axis = (
        pole_chances(moved, setting, pole).chances[0].chance
        for moved in (problem, replace(problem, lever=(0.2, 0.0, 0.0)))
    )
    assert abs(on_axis - off_axis) > 1e-3
