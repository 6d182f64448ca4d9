"""An objective of an installed package: named in a task, searched, and checked, without a change of this project."""

import sys

import numpy as np
import pytest

from scanwright.design.errors import TaskError
from scanwright.design.objective.counted import counted_J
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.objective.self_check import require_counted
from scanwright.design.task.task import load_task

MODULE = '''
import numpy as np

from scanwright.design.objective.named_objectives import Moment, Objective


def seldom(field, loaded):
    """J = mean_w exp(-d / r): share of the directions that few beams meet."""
    scale = loaded.task.density.ball_radius_deg * 10
    return Objective("seldom", field, (Moment(field, lambda d: np.exp(-d / scale)),), lambda m: m[0])
'''
TASK = {
    "name": "t",
    "sensor": "UTM-30LX",
    "servo": "MX-64R",
    "slip_ring": "UH1256-02-0610-06S",
    "motion": {"period_s": 2.0},
    "density": {"objective": "seldom"},
    "weight": [{"shape": "band", "theta_deg": [60, 120]}],
}
SETTING = np.radians([30, -50, 20, 70])


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Put a package with one entry point on the path, as `pip install` does."""

    def put(module):
        (tmp_path / "acme_objectives.py").write_text(module)
        metadata = tmp_path / "acme-1.dist-info"
        metadata.mkdir()
        (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1\n")
        (metadata / "entry_points.txt").write_text("[scanwright.objectives]\nseldom = acme_objectives:seldom\n")
        monkeypatch.syspath_prepend(tmp_path)

    yield put
    sys.modules.pop("acme_objectives", None)


def test_a_package_adds_an_objective(install):
    install(MODULE)
    loaded = load_task(TASK)
    problem = problem_of(loaded)
    found = score(problem, SETTING)
    assert problem.objective.name == "seldom" and 0 < found.J < 1
    assert found.J < score(problem, np.zeros(4)).J  # a tilted scan plane meets more of the band
    require_counted(loaded, SETTING, found)
    with pytest.raises(TaskError, match="'seldom': only log, kl"):
        counted_J(loaded, SETTING, 0)


def test_without_the_package_the_objective_is_unknown():
    with pytest.raises(TaskError, match=r"density.objective = 'seldom': no objective of that name; known: homogeneity"):
        load_task(TASK)


def test_a_package_that_cannot_be_imported_is_named(install):
    install("import none_of_that_name")
    with pytest.raises(TaskError, match=r"acme_objectives:seldom .*none_of_that_name"):
        problem_of(load_task(TASK))
