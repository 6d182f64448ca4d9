"""The pictures of densities: what their pixels are."""

import numpy as np
import pytest

from scanwright.design.angles import STANDARD_DEG
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.evaluation.density_picture import STEP_DEG, density_figure
from scanwright.design.objective.problem import problem_of
from scanwright.design.task.task import load_task

SETTINGS = {
    "found: J = -6.1": np.radians([180, 55.9, 78.1, -80.3]),
    "rolling: J = -5.8": np.radians(STANDARD_DEG["rolling"]),
}


@pytest.fixture(scope="module")
def drawn():
    problem = problem_of(load_task("ground_ahead"))
    figure = density_figure(problem, SETTINGS, "both")
    titles = {axis.get_title(loc="left"): axis for axis in figure.axes if axis.images}
    return problem, titles, figure


def at(axis, theta_deg, phi_deg):
    return axis.images[0].get_array()[int(theta_deg / STEP_DEG), int((phi_deg + 180) / STEP_DEG)]


def density(problem, name, theta_deg, phi_deg):
    t, p = np.radians([theta_deg + STEP_DEG / 2, phi_deg + STEP_DEG / 2])
    direction = np.array([[np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)]])
    return mean_density_at(problem, SETTINGS[name], direction)[0]


@pytest.mark.parametrize("place", [(120, 10), (100, 0), (60, -100), (150, 59)])
def test_the_last_map_is_the_first_one_over_the_second(drawn, place):
    problem, axes, _ = drawn
    own, other = (density(problem, name, *place) for name in SETTINGS)
    assert at(axes["found: J = -6.1"], *place) == pytest.approx(own)
    assert at(axes["found over rolling: how many times the beams"], *place) == pytest.approx(own / other)


def test_where_one_of_them_sees_nothing_there_is_no_ratio(drawn):
    problem, axes, _ = drawn
    ratio = axes["found over rolling: how many times the beams"]
    assert density(problem, "rolling: J = -5.8", 90, 179) == 0 < density(problem, "found: J = -6.1", 130, 179)
    assert at(ratio, 90, 179) is np.ma.masked and at(ratio, 45, 179) is np.ma.masked


def test_as_many_beams_are_in_the_middle_of_the_colours_and_the_bar_says_factors(drawn):
    _, axes, figure = drawn
    norm = axes["found over rolling: how many times the beams"].images[0].norm
    assert norm(1.0) == pytest.approx(0.5) and norm.vmax == pytest.approx(1 / norm.vmin)
    words = [label.get_text() for label in figure.axes[-1].get_yticklabels()]
    assert "1/1.5" in words and "1" in words and "2" in words


def test_one_map_is_drawn_alone():
    figure = density_figure(problem_of(load_task("ceiling")), {"rolling": SETTINGS["rolling: J = -5.8"]}, "one")
    assert [len(axis.images) for axis in figure.axes] == [1, 0]  # the map and its bar
