"""The fast ball count against the obvious one: identical."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scans import simulated_scan

from scanwright.design.density.ball_count import ball_count
from scanwright.design.density.beams import scan_lines
from scanwright.design.density.spin import ball_search
from scanwright.design.sphere.directions import equal_angle_grid, spiral

FAN = np.radians(np.arange(-540, 541) * 0.25)


def on_sphere(rng, n):
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), ball_deg=st.floats(0.01, 180), beams=st.integers(1, 400))
def test_random_beams(seed, ball_deg, beams):
    rng = np.random.default_rng(seed)
    scan, directions = on_sphere(rng, beams), on_sphere(rng, 50)
    np.testing.assert_array_equal(
        ball_count(scan, directions, np.radians(ball_deg)), ball_search(scan, directions, np.radians(ball_deg))
    )


@pytest.mark.parametrize("ball_deg", [0.5, 2.0, 45.0])
@pytest.mark.parametrize("angles_deg", [(0, 0, 0, -90), (0, 0, 90, 0), (0, 0, 0, 0), (20, -55, -80, 75)])
def test_a_scan_with_its_focus_points_and_seams(angles_deg, ball_deg):
    scan = simulated_scan(FAN, scan_lines(0.5, 40.0), np.radians(angles_deg))
    # 0.31 deg off the grid: on it, beams lie exactly on the rim and either answer is right
    directions = np.concatenate([spiral(400), equal_angle_grid(30.0) @ np.linalg.qr(np.eye(3) + 0.005)[0]])
    np.testing.assert_array_equal(
        ball_count(scan, directions, np.radians(ball_deg)), ball_search(scan, directions, np.radians(ball_deg))
    )


def test_poles_and_the_cut_of_the_azimuth():
    directions = np.array([[0, 0, 1], [0, 0, -1], [-1, 0, 0], [-1, 1e-12, 0], [-1, -1e-12, 0]], dtype=float)
    beams = np.concatenate([directions, spiral(5000)])
    for ball_deg in (0.3, 5.0, 89.0, 91.0, 179.0):
        np.testing.assert_array_equal(
            ball_count(beams, directions, np.radians(ball_deg)), ball_search(beams, directions, np.radians(ball_deg))
        )


def test_a_ball_of_the_whole_sphere_holds_every_beam():
    assert set(ball_count(spiral(1000), spiral(20), np.pi)) == {1000}
