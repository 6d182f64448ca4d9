"""The search of a sweep whose best mounts lie on the limit of those that see all of the region."""

from pathlib import Path

import numpy as np
import pytest

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import blind_to_sweep
from scanwright.design.search.search import search
from scanwright.design.search.space import SearchSpace
from scanwright.design.sphere.directions import weighted_samples
from scanwright.design.sphere.outline import just_inside
from scanwright.design.task.task import Limits, LoadedTask, Task

RANGES = {"alpha_rot_deg": 0, "beta_rot_deg": 0, "alpha_laser_deg": [-60, 60], "beta_laser_deg": [-60, 60]}


def sweep(heading_deg, height_m):
    """Return a task that sees the ground ahead and a wall on the left, and its problem."""
    ground = {"shape": "ground", "from_m": 0.15, "to_m": 3, "width_m": 4, "height_m": height_m}
    wall = {"shape": "wall", "distance_m": 1, "width_m": 2, "height_m": height_m, "bottom_m": 0, "top_m": 0.5}
    task = Task.model_validate(
        {
            "name": "t",
            "sensor": "LD19",
            "servo": "XL430-W250",
            "motion": {"mode": "sweep", "limits_deg": [-90, 90], "period_s": 4.0},
            "angles": RANGES | {"step_deg": 15},
            "density": {"ball_radius_deg": 4.0},
            "weight": [ground | {"heading_deg": heading_deg}, wall | {"heading_deg": 90}],
        }
    )
    return task, problem_of(LoadedTask(task, Path(), load_catalogue(), ()))


@pytest.mark.parametrize(("heading_deg", "height_m"), [(-20, 0.3)])
def test_no_mount_of_a_fine_grid_sees_all_and_is_much_better(heading_deg, height_m):
    task, problem = sweep(heading_deg, height_m)
    found = search(problem, task.angles).best[0]
    assert found.score.blind_weight == 0
    space = SearchSpace(problem, task.angles, Limits(), avoid_holes=True)
    fine = [np.array([0.0, 0.0, a, b]) for a in np.arange(-60, 61, 6.0) for b in np.arange(40, 61, 5.0)]
    seeing = [space.score(setting) for setting in fine if np.isfinite(space.J(setting, 243))]
    assert len(seeing) > 3
    assert found.score.J < min(each.J for each in seeing if each is not None) + 0.01


def test_a_mount_that_sees_the_outline_of_a_region_sees_all_of_it():
    rng = np.random.default_rng(1)
    _, problem = sweep(20, 0.4)
    directions = weighted_samples(problem.field, 40_000).directions
    edge = just_inside(problem.field)
    assert (problem.field.weight_at(edge) > 0).all()
    seen = 0
    for _ in range(60):
        angles_rad = np.radians([0.0, 0.0, *rng.uniform(-80, 80, 2)])
        R, beams = R_world_rot(*angles_rad[:2]), problem.beams_rot(angles_rad[2:])
        inside, outline = (blind_to_sweep(problem, each @ R, beams).any() for each in (directions, edge))
        seen += not outline
        assert outline or not inside
    assert 5 < seen < 55
