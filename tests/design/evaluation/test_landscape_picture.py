"""The picture of a search: what is where on it, and the option that draws it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from scanwright.design.errors import BuildError, TaskError
from scanwright.design.evaluation.landscape_picture import landscape_picture
from scanwright.design.objective.problem import problem_of
from scanwright.design.search.search import search
from scanwright.design.task.task import load_task


@pytest.fixture(scope="module")
def fixed():
    """The search of a task that fixes all four angles: one family, one row in each table."""
    loaded = load_task(Path("rolling"))
    return search(problem_of(loaded), loaded.task.angles)


def grid(J_of, low, high):
    a, b = np.meshgrid(np.linspace(*low, 13), np.linspace(*high, 13), indexing="ij")
    return np.column_stack([a.ravel(), b.ravel(), J_of(a, b).ravel()])


@pytest.mark.parametrize(("sign_x", "sign_y"), [(-1, -1), (-1, 1), (1, -1), (1, 1)])
def test_the_lowest_J_is_bright_and_where_its_angles_are(fixed, tmp_path, sign_x, sign_y):
    planes = grid(lambda a, b: -np.hypot(a + sign_x * 90, b + sign_y * 90), (-90, 90), (-90, 90))
    landscape_picture(tmp_path / "J.png", replace(fixed, planes=planes), "one corner")
    picture = imread(tmp_path / "J.png")[:, :, :3].mean(axis=2)
    height, width = picture.shape
    at = {
        (x, y): np.median(picture[int(height * (0.5 - 0.19 * y)) :][:40, int(width * (0.5 + 0.27 * x)) :][:, :40])
        for x in (-1, 1)
        for y in (-1, 1)
    }
    assert max(at, key=at.__getitem__) == (sign_x, sign_y)


def test_what_breaks_a_limit_is_left_white_and_equal_J_are_said(fixed, tmp_path):
    planes = grid(lambda a, b: a * 0 + b * 0 - 4.0, (-90, 90), (-90, 90))[::2]
    axes = grid(lambda a, b: a - b, (-180, 180), (-90, 90))[:100]
    landscape_picture(tmp_path / "J.png", replace(fixed, planes=planes, axes=axes), "holes")
    assert (tmp_path / "J.png").stat().st_size > 10_000


def test_one_free_angle_is_a_curve(fixed, tmp_path):
    axes = grid(lambda a, b: a + np.cos(np.radians(b)), (0, 0), (-90, 90))[:13]
    landscape_picture(tmp_path / "J.png", replace(fixed, axes=axes), "a curve")
    assert (tmp_path / "J.png").stat().st_size > 10_000


def test_nothing_free_is_nothing_to_map(fixed, tmp_path):
    with pytest.raises(TaskError, match="fixes all four"):
        landscape_picture(tmp_path / "J.png", fixed, "nothing")
    assert not (tmp_path / "J.png").exists()


def test_optimise_draws_it(command, tmp_path):
    code, out, _ = command("optimise", "ceiling", "--picture", tmp_path / "new/J.png")
    assert code == 0
    assert "searched 1,369 mounts" in out
    assert f"wrote {tmp_path / 'new/J.png'}" in out.splitlines()
    assert imread(tmp_path / "new/J.png").std() > 0.1


def test_a_name_without_a_suffix_is_a_png_and_a_place_where_none_can_be_is_one_line(fixed, tmp_path):
    curve = replace(fixed, axes=grid(lambda a, b: a + b, (0, 0), (-90, 90))[:13])
    assert landscape_picture(tmp_path / "J", curve, "a curve") == tmp_path / "J.png"
    assert [path.name for path in tmp_path.iterdir()] == ["J.png"]
    with pytest.raises(BuildError, match=r"J\.png/no\.png: cannot write the picture: (Not a directory|File exists)$"):
        landscape_picture(tmp_path / "J.png" / "no.png", curve, "a curve")
