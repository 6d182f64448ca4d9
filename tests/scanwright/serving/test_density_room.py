"""The walls of studio and live page as pictures."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scanwright.report.colours import Bands
from scanwright.report.room import Room
from scanwright.serving.density_room import BLIND, FINER, NODES, DensityRoom, density_colours
from scanwright.serving.page_server import guarded_server

sizes = st.tuples(*[st.floats(0.4, 8)] * 6)


@pytest.fixture(scope="module")
def scene():
    with guarded_server("a page") as (server, _):
        yield server.scene


@settings(max_examples=20)
@given(sizes)
def test_pictures_lie_on_the_walls_face_the_room_and_show_each_band_where_it_is(scene, sizes):
    room = Room(-np.array(sizes[:3]), np.array(sizes[3:]))
    walls = DensityRoom(scene, room)
    assert NODES / 2 < len(walls.directions) < 2 * NODES
    walls.colour(np.where(walls.directions[:, 0] > 0, 15.0, 0.0), Bands((10, 20)))
    for wall in (each.handle for each in walls.walls):
        R = Rotation.from_quat(wall.wxyz, scalar_first=True).as_matrix()
        assert R[:, 2] @ wall.position > 0  # the front, at -z, is towards the scanner
        rows, columns = wall.image.shape[:2]
        row, column = np.meshgrid(np.linspace(-0.5, 0.5, rows), np.linspace(-0.5, 0.5, columns), indexing="ij")
        across = np.stack([column * wall.render_width, row * wall.render_height, 0 * row], axis=-1)
        points = across @ R.T + wall.position
        on = np.isclose(points, room.low) | np.isclose(points, room.high)
        assert on.any(axis=-1).all()
        inner = wall.image[1:-1, 1:-1]  # within the edges of the room
        points, blind = points[1:-1, 1:-1], (inner[..., :3] == BLIND).all(axis=-1)
        step_m = 1.01 * max(wall.render_width / (columns / FINER - 1), wall.render_height / (rows / FINER - 1))
        assert blind[points[..., 0] < -step_m].all() and not blind[points[..., 0] > step_m].any()


@given(sizes, st.tuples(*[st.floats(-1, 1, allow_subnormal=False)] * 3), st.floats(0.01, 0.9))
def test_a_ray_from_outside_meets_the_far_wall(sizes, target, along):
    room = Room(-np.array(sizes[:3]), np.array(sizes[3:]))
    inside = np.where(np.array(target) > 0, room.high, room.low) * np.abs(target) * 0.9
    eye = 3 * room.walls_along(np.array([np.cos(along), np.sin(along), along]))
    far = room.beyond(eye, inside - eye)
    point = room.walls_along(far)
    np.testing.assert_allclose(np.cross(point - eye, inside - eye), 0, atol=1e-6)
    assert (point - eye) @ (inside - eye) >= (inside - eye) @ (inside - eye) - 1e-9  # beyond what is inside
    assert room.beyond(eye, eye) is None and room.beyond(eye, np.zeros(3)) is None


def test_rays_along_an_axis_meet_the_wall_across_it():
    room = Room(np.array([-1.0, -2, -3]), np.array([4.0, 5, 6]))
    np.testing.assert_allclose(room.walls_along(np.eye(3)), np.diag([4.0, 5, 6]))
    np.testing.assert_allclose(room.walls_along(-np.eye(3)), -np.diag([1.0, 2, 3]))


def test_colours_are_pale_exactly_where_no_beam_comes():
    colours = density_colours(np.array([0.0, 1e-12, 0.5, 10, 19, 20]), Bands((10, 20)))
    assert [tuple(colour) == BLIND for colour in colours] == [True, True, False, False, False, False]
    assert len(np.unique(colours, axis=0)) == 4
    np.testing.assert_array_equal(colours[3], colours[4])
