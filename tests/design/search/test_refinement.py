"""The simplex against scipy's: same steps, fewer values, nothing beyond the bounds; and where it walks."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize, rosen

from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import problem_of
from scanwright.design.progress import no_progress
from scanwright.design.search import families
from scanwright.design.search.families import MOST_RUNS
from scanwright.design.search.grid_classes import plane_key
from scanwright.design.search.refinement import NARROW, _Chart, _on_the_grid, descended, lowest_by_simplex
from scanwright.design.search.search import search
from scanwright.design.task.angle_ranges import NAMES, AngleRanges
from scanwright.design.task.task import Limits, load_task

CORNERS = np.array([[-1.2, 0.8, 0.5], [-0.7, 0.8, 0.5], [-1.2, 0.4, 0.5], [-1.2, 0.8, 0.9]])


def ended(values, size=1e-6, spread=1e-9):
    """A walk that takes at most some values for each coordinate."""
    return replace(NARROW, size_deg=size, spread=spread, values=values)


@pytest.mark.parametrize("bounds", [[-9.0, 9.0], [-2.0, 0.9]])
def test_it_goes_where_that_of_scipy_goes(bounds):
    bounds = np.array([bounds] * 3)
    values = np.array([rosen(corner) for corner in CORNERS])
    found, _ = lowest_by_simplex(rosen, CORNERS, values, bounds, ended(2000))
    options = {"initial_simplex": CORNERS, "xatol": 1e-6, "fatol": 1e-9}
    theirs = minimize(rosen, CORNERS[0], method="Nelder-Mead", bounds=bounds, options=options)
    assert found == pytest.approx(theirs.x, abs=1e-9)


@pytest.mark.parametrize("most", [2, 3, 11, 21])
def test_it_takes_no_more_values_than_it_may(most):
    taken = []

    def counted(point):
        taken.append(point)
        return rosen(point)

    values = np.array([rosen(corner) for corner in CORNERS])
    found, lowest = lowest_by_simplex(counted, CORNERS, values, np.array([[-9.0, 9.0]] * 3), ended(most))
    assert len(taken) <= max(3 * most - 4, 0) + len(CORNERS) - 1, "only a simplex that shrinks is brought to its end"
    assert rosen(found) == lowest == min([*values, *(rosen(point) for point in taken)])


@pytest.mark.filterwarnings("error")
def test_a_simplex_whose_mounts_are_all_rejected_ends():
    corners = np.array([[3.0, 3.0], [3.001, 3.0], [3.0, 3.001]])
    _, lowest = lowest_by_simplex(
        lambda _: np.inf, corners, np.full(3, np.inf), np.array([[-9.0, 9.0]] * 2), ended(200, 0.01, 1e-3)
    )
    assert lowest == np.inf


def test_what_is_refused_is_kept_off():
    """The lowest value lies at the edge of what is allowed; beyond it the values would be lower still."""

    def value(point):
        return point.sum() if (point >= 1).all() else np.inf

    corners = np.array([[3.0, 3.0], [2.5, 3.0], [3.0, 2.5]])
    found, _ = lowest_by_simplex(
        value, corners, corners.sum(axis=1), np.array([[-9.0, 9.0]] * 2), ended(200, 1e-3, 1e-3)
    )
    assert found == pytest.approx([1, 1], abs=0.05)


@given(st.tuples(st.floats(-180, 180), st.floats(-90, 90), st.floats(-90, 90), st.floats(-90, 90)), st.integers(0, 3))
def test_a_step_of_a_coordinate_is_as_long_on_its_sphere_also_at_a_pole(angles, which):
    limits = np.array([[-180.0, 180.0], [-90.0, 90.0], [-90.0, 90.0], [-90.0, 90.0]])
    chart = _Chart(np.array(angles), np.ones(4, dtype=bool), limits, on_spheres=True)
    before, after = (
        np.radians(chart.setting(moved)) for moved in (np.zeros(4), np.where(np.arange(4) == which, 3.0, 0.0))
    )
    axes = [R_world_rot(*setting[:2])[:, 2] for setting in (before, after)]
    keys = [np.append(key, np.sqrt(max(1 - key @ key, 0))) for key in plane_key(np.array([before[2:], after[2:]]))]
    apart = np.degrees([np.linalg.norm(axes[0] - axes[1]), np.linalg.norm(keys[0] - keys[1])])
    moved, still = (0, 1) if which < 2 else (1, 0)
    assert apart[still] < 1e-5
    assert apart[0] == pytest.approx(3.0, abs=1e-3) if moved == 0 else apart[1] <= 3.001  # q may be mirrored back


def test_an_optimum_beside_a_pole_is_found_from_any_grid(monkeypatch):
    """The simplex over angles stopped at beta_laser = -90, where alpha moves nothing: J = -6.1848 on a grid of 10."""
    monkeypatch.setattr(families, "FAMILIES", 3)
    loaded = load_task(Path("ground_ahead"))
    cones = (((0.365, 0.294, 0.028), 36.0), ((-0.163, -0.482, 0.599), 15.0))
    weight = [{"shape": "cone", "axis": axis, "half_angle_deg": half} for axis, half in cones]
    task = loaded.task.model_validate(loaded.task.model_dump() | {"weight": weight, "mask": []})
    for step in (20.0, 10.0):
        found = search(problem_of(replace(loaded, task=task)), task.angles.model_copy(update={"step_deg": step}))
        assert found.best[0].score.J < -6.189


def test_an_angle_that_is_nearly_one_of_the_grid_is_that_one_unless_J_minds():
    free = np.array([True, True, True, False])
    limits = np.array([[-180.0, 180.0], [-90.0, 90.0], [-88.0, 90.0], [30.01, 30.01]])
    asked = np.array([0.07, -54.9, -87.9, 30.01])
    indifferent = _on_the_grid(asked, free, limits, 5.0, lambda _: 0.0)
    assert indifferent.tolist() == [0.0, -55.0, -88.0, 30.01], "no further than the limits, and what is fixed stays"
    minds = _on_the_grid(asked, free, limits, 5.0, lambda setting: 1e-2 * abs(setting[1] + 54.9))
    assert minds.tolist() == [0.0, -54.9, -88.0, 30.01]


class Valley:
    """J of a region that a turning plane sees only about its equator: a valley of axes, narrow and long."""

    limits = Limits(min_density=1)
    problem = SimpleNamespace(sweep=None)
    ranges = AngleRanges()

    def J(self, angles_deg, *_):
        u = R_world_rot(*np.radians(angles_deg[:2]))[:, 2]
        off = [u @ np.array([0.6, 0.8, 0.0]), *np.radians(angles_deg[2:])]
        return float(20 * (np.hypot(off, 0.02) - 0.02).sum()) - float(u[2])


@pytest.mark.parametrize("start", [[-40.0, 55.0, 5.0, 15.0], [-50.0, 65.0, -15.0, 0.0]])
def test_walks_go_on_along_a_valley_that_is_narrower_than_the_grid(start):
    """One simplex ends up to 0.4 above the lowest J, -1 with an upright axis."""
    first = descended(Valley(), [(np.array(start), False)], 1, no_progress)
    assert first[0].J > -0.9
    found = descended(Valley(), [(np.array(start), False)], MOST_RUNS[2], no_progress)
    assert found[0].J < -0.999
    assert found[0].J == Valley().J(found[0].angles_deg, 0)


@pytest.mark.parametrize("most", [1, 16])
def test_what_gains_nothing_is_walked_from_once(most):
    flat = []

    class Plateau(Valley):
        def J(self, angles_deg, *_):
            flat.append(bool(angles_deg[3] > 45))
            return 5.0 if flat[-1] else super().J(angles_deg, 0)

    starts = [(np.array(start), False) for start in ([-50.0, 65.0, -15.0, 0.0], [-50.0, 65.0, -15.0, 70.0])]
    found = descended(Plateau(), starts, most, no_progress)
    assert [descent.start for descent in found] == [0, 1]
    assert sum(flat) < 60


def test_a_task_that_fixes_all_angles_is_not_walked_from():
    fixed = Valley()
    fixed.ranges = AngleRanges(**{f"{name}_deg": 5.0 for name in NAMES})
    found = descended(fixed, [(np.full(4, 5.0), False)], 16, no_progress)
    assert found[0].angles_deg.tolist() == [5.0] * 4
    assert found[0].J == Valley().J(found[0].angles_deg, 0)
