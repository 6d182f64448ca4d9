"""The two references agree, whatever is minimised: one integrates smooth pieces, the other draws directions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from quick_tests import samples

from scanwright.design.accuracy.methods import METHODS
from scanwright.design.accuracy.reference import is_smooth, reference, smooth_reference
from scanwright.design.objective.counted import counted_J
from scanwright.design.objective.problem import problem_of
from scanwright.design.task.task import load_task

ANGLES = np.radians([0.0, 0.0, -50.0, 35.0])


def aimed(objective, motion=None):
    loaded = load_task(Path("ground_ahead"))
    density = loaded.task.density.model_copy(update={"objective": objective, "required": 600.0})
    changed = {"density": density} | ({"motion": motion} if motion else {})
    return replace(loaded, task=loaded.task.model_copy(update=changed))


@pytest.mark.parametrize("objective", samples(["log", "required", "kl", "homogeneity"], ["required", "kl"]))
def test_both_references_and_what_the_program_uses_are_one(objective):
    loaded = aimed(objective)
    problem = problem_of(loaded)
    exact, drawn = smooth_reference(problem, ANGLES), counted_J(loaded, ANGLES, seed=3, points=2**12)
    assert exact.J_error < 1e-7 and 0 < drawn.J_error < 1e-3
    assert abs(exact.J - drawn.J) <= 1.5 * drawn.J_error  # three standard errors, and a half for the unlucky seed
    for name in ("segments", "rings", "Gauss-Legendre", "harmonics"):
        method, _, values = METHODS[name]
        assert method(problem, ANGLES, values[-1]) == pytest.approx(exact.J, abs=3e-3), name


def test_what_is_not_smooth_is_drawn(monkeypatch):
    monkeypatch.setattr("scanwright.design.accuracy.reference.DRAWN", 2**10)
    turning = aimed("log").task.motion
    seam, worst = aimed("log", turning.model_copy(update={"period_s": 2.0125})), aimed("worst")
    for loaded in (seam, worst):
        problem = problem_of(loaded)
        assert not is_smooth(problem)
        assert reference(loaded, problem, ANGLES).J == counted_J(loaded, ANGLES, seed=0, points=2**10).J
