"""Fans of cheap sensors: all around, with a hole where a housing stands, clockwise; against the ball search."""

from math import radians

import numpy as np
import pytest
from scans import count_at, simulated_scan

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.density.beams import beam_directions_rot, is_closed, polar_and_azimuth, scan_lines
from scanwright.design.density.spin import ball_search
from scanwright.design.frames import R_world_rot
from scanwright.design.search.grid_classes import mirrors_of


def of(name):
    return load_catalogue().get(name, Lidar).bearings_rad()


def with_hole(bearings_rad, half_deg=20):
    """Without what a housing behind the sensor hides."""
    return bearings_rad[np.abs(np.degrees(bearings_rad)) < 180 - half_deg]


FANS = {
    "all around": of("LD19"),
    "all around, dense": of("STL27L"),
    "with a hole": with_hole(of("RPLIDAR C1")),
    "clockwise": -of("LD19"),
    "a turn of a wandering motor": -np.cumsum(radians(0.8) * (1 + 0.01 * np.sin(np.arange(450) / 70))),
}


@pytest.mark.parametrize("fan", FANS)
@pytest.mark.parametrize("setting_deg", [(30, -50, 20, 70)])
def test_the_density_of_a_setting_is_what_the_ball_search_finds_in_a_simulated_scan(fan, setting_deg):
    bearings_rad, ball = FANS[fan], radians(1.0)
    setting, lines = np.radians(setting_deg), scan_lines(2.3, 10.0)
    scan = simulated_scan(bearings_rad, lines, setting)
    rng = np.random.default_rng(7)
    some = scan[rng.integers(len(scan), size=30)] + rng.normal(0, ball / 2, (30, 3))
    directions = some / np.linalg.norm(some, axis=1)[:, None]
    polar, azimuth = polar_and_azimuth(beam_directions_rot(bearings_rad, *setting[2:]))
    t, p = polar_and_azimuth(directions @ R_world_rot(*setting[:2]))
    counted = [count_at(ti, pi_, polar, azimuth, lines, ball) for ti, pi_ in zip(t, p, strict=True)]
    expected = ball_search(scan, directions, ball)
    assert expected.max() > 2
    np.testing.assert_array_equal(counted, expected)


def test_both_directions_of_a_plane_are_the_same_for_a_fan_all_around():
    assert [len(mirrors_of(FANS[fan])) for fan in ("all around", "all around, dense", "clockwise")] == [4, 4, 4]
    assert [len(mirrors_of(of(name))) for name in ("UTM-30LX", "URG-04LX")] == [2, 1]
    assert len(mirrors_of(with_hole(of("LD19")))) == 2
    assert len(mirrors_of(FANS["a turn of a wandering motor"])) == 1
    assert len(mirrors_of(of("LD19")[:-1])) == 1  # of one beam less, neither half is the other's
    assert [is_closed(bearings_rad) for bearings_rad in FANS.values()] == [True, True, False, True, True]
    assert not is_closed(of("UTM-30LX"))
