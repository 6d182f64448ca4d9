"""The room of studio and live page in tiles."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scanwright.report.colours import Bands, ramp
from scanwright.report.room import Room
from scanwright.serving.density_room import ACES_IN, ACES_OUT, BLIND, TILES, density_colours, room_tiles, unlit

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


def test_colours_are_pale_exactly_where_no_beam_comes():
    colours = density_colours(np.array([0.0, 1e-12, 0.5, 10, 19, 20]), Bands((10, 20)))
    assert [tuple(colour) == BLIND for colour in colours] == [True, True, False, False, False, False]
    assert len(np.unique(colours, axis=0)) == 4
    np.testing.assert_array_equal(colours[3], colours[4])


def test_tiles_are_shown_in_the_colours_of_the_key():
    """Through the light and the tone mapping of the page, here written anew; the brightest are beyond what it shows."""
    colours = ramp(np.linspace(0, 0.9, 40))
    for normal in ([0.0, 0, -1], [0.0, 0, 1]):
        lamp = 0.7 * max(0.0, normal[2] * 2 / np.sqrt(1 + 0.36 + 4)) / np.pi
        c = unlit(colours, np.tile(normal, (40, 1))) / 255 * (1 + lamp) / 0.6 @ ACES_IN.T
        c = (c * (c + 0.0245786) - 0.000090537) / (c * (0.983729 * c + 0.4329510) + 0.238081) @ ACES_OUT.T
        c = np.clip(c, 0, 1)
        shown = 255 * np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(shown, colours, atol=12)  # of 8 bits in linear light
