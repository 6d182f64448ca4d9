"""The room of the studio in tiles."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scanwright.report.cut_room import Room
from scanwright.studio.view.room_tiles import TILES, room_tiles

sizes = st.tuples(*[st.floats(0.4, 8)] * 6)


@given(sizes)
def test_tiles_lie_on_the_walls_and_look_into_the_room(sizes):
    room = Room(-np.array(sizes[:3]), np.array(sizes[3:]))
    tiles = room_tiles(room)
    on = np.isclose(tiles.middles_m, room.low) | np.isclose(tiles.middles_m, room.high)
    assert on.any(axis=1).all()
    inward = Rotation.from_quat(tiles.wxyz, scalar_first=True).apply([0, 0, 1])
    np.testing.assert_allclose(tiles.normals, inward, atol=1e-12)
    assert (np.sum(inward * tiles.middles_m, axis=1) < 0).all()  # the scanner is on their front
    np.testing.assert_allclose(room.walls_along(tiles.directions), tiles.middles_m, atol=1e-9)


@given(sizes)
def test_no_seam_shows_and_no_tile_reaches_far_out(sizes):
    room = Room(-np.array(sizes[:3]), np.array(sizes[3:]))
    tiles = room_tiles(room)
    assert TILES <= len(tiles.middles_m) < 1.5 * TILES
    half = tiles.corners_m.max()
    seeds = np.random.default_rng(1).uniform(room.low, room.high, (300, 3))
    seeds[:, 2] = room.low[2]
    floor = tiles.middles_m[tiles.normals[:, 2] > 0.5]
    away = abs(seeds[:, None, :2] - floor[None, :, :2]).max(axis=2).min(axis=1)
    assert (away <= half).all()
    assert (abs(tiles.middles_m) <= np.maximum(-room.low, room.high) + 1e-9).all()


def test_rays_along_an_axis_meet_the_wall_across_it():
    room = Room(np.array([-1.0, -2, -3]), np.array([4.0, 5, 6]))
    np.testing.assert_allclose(room.walls_along(np.eye(3)), np.diag([4.0, 5, 6]))
    np.testing.assert_allclose(room.walls_along(-np.eye(3)), -np.diag([1.0, 2, 3]))
