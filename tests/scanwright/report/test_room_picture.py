"""The first picture of the report against what is known of single points of its room."""

import io
from base64 import b64decode

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import colormaps
from PIL import Image

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.objective.problem import problem_of
from scanwright.design.task.task import load_task
from scanwright.report.check_pictures import PlacedBody
from scanwright.report.cut_room import Room, pinhole_behind, room_about, walls_behind
from scanwright.report.density_sphere import Bands, DensitySphere, density_sphere
from scanwright.report.room_picture import room_picture

SETTING = np.radians([180.0, 55.0, 80.0, -80.0])
AHEAD_AND_DOWN = np.array([0.8, 0.0, -0.6])
BANDS = Bands((50, 100, 200, 400))
SPHERE = DensitySphere((), BANDS, (0.0, 0.0, 1.0), tuple(AHEAD_AND_DOWN), 1.0)
GROUND = {"shape": "ground", "from_m": 0.5, "to_m": 3.0, "width_m": 2.0, "height_m": 0.4}


def task(**keys):
    told = {"name": "t", "sensor": "UTM-30LX", "servo": "MX-64R", "slip_ring": "UH1256-02-0610-06S"}
    return load_task(told | {"motion": {"period_s": 18.0}, "weight": [GROUND]} | keys)


@pytest.fixture(scope="module")
def drawn():
    loaded = task(mask=[{"shape": "band", "theta_deg": [150, 180]}])
    problem = problem_of(loaded)
    box = np.array([[[0.0, -0.1, 0], [0, 0.1, 0], [0, 0, 0.2]], [[0.1, 0, 0], [-0.1, 0, 0], [0, 0, 0.2]]])
    body = PlacedBody(box, False, (1.0, 0.0, 0.0))
    room = room_picture(loaded.task, loaded.source.parent, problem, SETTING, SPHERE, [body])
    image = Image.open(io.BytesIO(b64decode(room.picture.split(",")[1]))).convert("RGBA")
    return (
        problem,
        room,
        np.asarray(image, dtype=float),
        pinhole_behind(room_about(loaded.task)[0], AHEAD_AND_DOWN, False),
    )


def colour_at(drawn, point):
    _, _, pixels, camera = drawn
    left, top = camera.shares(np.array([point]))[0]
    return pixels[int(top * pixels.shape[0]), int(left * pixels.shape[1])]


@pytest.mark.parametrize("point", [(1.3, 0.45, -0.4), (2.4, -0.6, -0.4), (2.45, 1.3, -0.4), (3.0, 0.5, 0.5)])
def test_floor_and_walls_have_the_colour_of_their_direction(drawn, point):
    problem = drawn[0]
    direction = np.array(point) / np.linalg.norm(point)
    density = mean_density_at(problem, SETTING, direction[None])[0]
    wanted = 255 * np.array(colormaps["cividis"](BANDS(density)))[:3]
    np.testing.assert_allclose(colour_at(drawn, point)[:3], wanted, atol=12)


def test_what_counts_has_a_line_around_it_and_what_is_hidden_is_grey(drawn):
    row = [colour_at(drawn, (x, 0.31, -0.4))[:3].max() for x in np.arange(0.46, 0.54, 0.002)]
    assert min(row) < 40 and max(row) > 240  # the region begins at 0.5 m: dark, with a light line beside it
    straight_down = [colour_at(drawn, (x, 0.07, -0.4))[:3] for x in np.arange(0.06, 0.15, 0.005)]
    assert np.ptp(straight_down, axis=1).max() < 12 and 100 < np.mean(straight_down) < 230


def test_the_body_stands_in_the_middle_and_beside_the_room_is_nothing(drawn):
    red = colour_at(drawn, (0.0, 0.0, 0.05))
    assert red[0] > 80 and red[1:3].max() < 15 and red[3] == 255
    assert drawn[2][0, 0, 3] == drawn[2][-1, -1, 3] == 0
    scanner, ahead = drawn[1].marks
    assert (scanner.text, ahead.text) == ("scanner", "ahead")
    left, top = drawn[3].shares(np.zeros((1, 3)))[0]
    assert (scanner.left, scanner.top) == pytest.approx((left, top), abs=1e-4)


def test_the_room_is_that_of_the_task():
    room, words = room_about(task().task)
    np.testing.assert_allclose(room.low, [-1.0, -2.0, -0.4])
    np.testing.assert_allclose(room.high, [3.0, 2.0, 2.1])
    assert words == "The room is 4 x 4 x 2.5 m, the scanner 0.4 m over its floor"
    assert "names no height" in room_about(load_task("ground_ahead").task)[1]


@given(
    st.tuples(*[st.floats(0.3, 9)] * 6),
    st.tuples(*[st.floats(-1, 1)] * 3),
    st.booleans(),
)
def test_every_corner_is_on_the_picture_and_rays_end_on_walls(sizes, middle, looks_up):
    room = Room(-np.array(sizes[:3]), np.array(sizes[3:]))
    camera = pinhole_behind(room, np.array(middle), looks_up)
    assert camera.eye[2] < room.low[2] if looks_up else camera.eye[2] > room.high[2]
    shares = camera.shares(room.corners())
    assert (shares > 0).all() and (shares < 1).all()
    inward = (np.vstack([room.corners(), [[0.0, 0, 0]]]) * 0.999) - camera.eye
    walls = walls_behind(room, camera, inward / np.linalg.norm(inward, axis=1, keepdims=True))
    assert walls.inside.all()
    on = np.column_stack([walls.points_m - room.low, room.high - walls.points_m])
    assert (on > -1e-9).all()
    ends = np.where(walls.face % 2 == 1, room.high[walls.face // 2], room.low[walls.face // 2])
    np.testing.assert_allclose(walls.points_m[np.arange(9), walls.face // 2], ends, atol=1e-9)
    # the wall that is drawn is never nearer than what stands in the room
    assert (walls.away_m >= np.linalg.norm(inward, axis=1) - 1e-9).all()


@pytest.mark.parametrize(("theta_deg", "below"), [([0, 60], 0.0), ([0, 120], 1 / 3), ([90, 180], 1.0)])
def test_a_task_that_looks_up_only_is_seen_from_below(theta_deg, below):
    problem = problem_of(task(weight=[{"shape": "band", "theta_deg": theta_deg}]))
    flat = Angles(alpha_rot=0, beta_rot=0, alpha_laser=90, beta_laser=0)
    angles = AngleSet(task="t", angles_deg=flat, sensor="UTM-30LX", servo="MX-64R")
    sphere = density_sphere(problem, angles, (), None, 5.0)
    assert sphere.below == pytest.approx(below, abs=0.01)


def test_a_robot_is_drawn_where_its_mesh_is(tmp_path):
    import trimesh

    mesh = trimesh.creation.box((0.6, 0.4, 0.2))
    mesh.apply_translation([0, 0, 0.1])
    mesh.export(tmp_path / "robot.stl")
    mask = {"shape": "mesh", "file": str(tmp_path / "robot.stl"), "sensor_m": [0.2, 0.0, 0.4]}
    loaded = task(mask=[mask])
    room = room_picture(loaded.task, tmp_path, problem_of(loaded), SETTING, SPHERE, [])
    image = Image.open(io.BytesIO(b64decode(room.picture.split(",")[1]))).convert("RGBA").convert("RGB")
    camera = pinhole_behind(room_about(loaded.task)[0], AHEAD_AND_DOWN, False)
    left, top = camera.shares(np.array([[-0.35, 0.1, -0.2]]))[0]  # on its back
    grey = np.array(image.getpixel((int(left * image.width), int(top * image.height))), dtype=float)
    assert np.ptp(grey) < 8 and 50 < grey[0] < 160
