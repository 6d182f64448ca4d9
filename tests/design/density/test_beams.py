"""Scan lines and beams against the formulas of the paper, written as loops."""

from math import cos, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scans import simulated_scan

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.density.beams import (
    ScanLines,
    beam_directions_rot,
    line_spacing,
    polar_and_azimuth,
    polar_of_planes,
    scan_lines,
)


@pytest.mark.parametrize(
    ("period_s", "rate_hz", "count", "last_gap"),
    [
        (18, 40, 720, 1.0),
        (2, 40, 80, 1.0),
        (0.07, 100, 7, 1.0),  # 7.000000000000001 in floats
        (0.3, 10, 3, 1.0),
        (0.31, 40, 13, 0.4),
        (2.01, 10, 21, 0.1),
        (0.025, 40, 1, 1.0),
        (0.02, 40, 1, 0.8),
        (1 + 2**-52, 1, 1, 1.0),  # one line, and a last bit over
        (3600, 40, 144_000, 1.0),
    ],
)
def test_one_turn_has_the_lines_of_design_md(period_s, rate_hz, count, last_gap):
    lines = scan_lines(period_s, rate_hz)
    assert lines.count == count
    assert lines.step_rad == pytest.approx(2 * pi / (period_s * rate_hz), rel=1e-12)
    np.testing.assert_allclose(lines.angles_rad, [2 * pi * k / (period_s * rate_hz) for k in range(count)], rtol=1e-12)
    assert (2 * pi - lines.angles_rad[-1]) / lines.step_rad == pytest.approx(last_gap, abs=1e-6)


@given(st.floats(0.001, 3600), st.floats(0.5, 100))
def test_the_last_gap_is_never_longer_than_the_others_and_never_empty(period_s, rate_hz):
    lines = scan_lines(period_s, rate_hz)
    gap = 2 * pi - (lines.count - 1) * lines.step_rad
    assert lines.count >= 1
    assert 0 < gap <= lines.step_rad * (1 + 1e-6)


def Rx(a):
    return np.array([[1, 0, 0], [0, cos(a), -sin(a)], [0, sin(a), cos(a)]])


def Ry(a):
    return np.array([[cos(a), 0, sin(a)], [0, 1, 0], [-sin(a), 0, cos(a)]])


def Rz(a):
    return np.array([[cos(a), -sin(a), 0], [sin(a), cos(a), 0], [0, 0, 1]])


@pytest.mark.parametrize("angles_deg", [(0, 0, 0, 0), (0, 90, 0, -90), (-90, 0, 90, 0), (123, -45, -67, 12.5)])
@pytest.mark.parametrize("period_s", [0.3, 0.47])
@pytest.mark.parametrize("phase", [0.0, 0.4])
def test_a_simulated_scan_is_the_double_loop_of_the_paper(angles_deg, period_s, phase):
    bearings = np.radians([-100.0, -3.0, 0.0, 50.0, 119.9])
    a_rot, b_rot, a_laser, b_laser = (radians(a) for a in angles_deg)
    lines = scan_lines(period_s, 10.0)
    slow = []
    for k in range(lines.count):
        gamma = phase + 2 * pi * k / (period_s * 10.0)
        for bearing in bearings:
            beam = Rx(a_rot) @ Ry(b_rot) @ Rz(gamma) @ Ry(b_laser) @ Rx(a_laser) @ Rz(bearing)
            slow.append(beam[:, 0])
    scan = simulated_scan(bearings, lines, np.radians(angles_deg), phase)
    np.testing.assert_allclose(scan, slow, atol=1e-12)


def test_the_paper_s_scan_has_777600_and_720_beams():
    bearings = load_catalogue().get("UTM-30LX", Lidar).bearings_rad()
    lines = scan_lines(18.0, 40.0)
    scan = simulated_scan(bearings, lines, np.radians([10, 20, 30, 40]))
    assert scan.shape == (720 * 1081, 3)
    np.testing.assert_allclose(np.linalg.norm(scan, axis=1), 1, atol=1e-12)


def test_a_rolling_scanner_sees_all_with_half_a_turn_and_its_focus_points_lie_ahead_and_behind():
    bearings = np.radians(np.arange(-180, 180, 90.0))
    lines = ScanLines(count=2, step_rad=pi / 2)
    scan = simulated_scan(bearings, lines, np.radians([0, 90, 0, -90])).reshape(2, 4, 3)
    np.testing.assert_allclose(scan[0], [[-1, 0, 0], [0, -1, 0], [1, 0, 0], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(scan[1], [[-1, 0, 0], [0, 0, -1], [1, 0, 0], [0, 0, 1]], atol=1e-12)


@given(st.floats(0, pi), st.floats(-pi, pi))
def test_polar_angle_and_azimuth_invert_the_direction(polar, azimuth):
    d = np.array([[sin(polar) * cos(azimuth), sin(polar) * sin(azimuth), cos(polar)]])
    t, p = polar_and_azimuth(d)
    assert t[0] == pytest.approx(polar, abs=1e-15, rel=1e-12)
    assert sin(polar) * sin(p[0] - azimuth) == pytest.approx(0, abs=1e-12)


def test_polar_angles_next_to_a_pole_keep_their_digits():
    t, _ = polar_and_azimuth(np.array([[1e-12, 0, 1.0], [0, 1e-9, -1.0]]))
    np.testing.assert_allclose(t, [1e-12, pi - 1e-9], rtol=1e-12)


@given(st.floats(-pi, pi), st.floats(-pi, pi))
def test_all_beams_lie_in_the_scan_plane(alpha, beta):
    beams = beam_directions_rot(np.radians([-120.0, -10.0, 0.0, 77.0]), alpha, beta)
    normal = (Ry(beta) @ Rx(alpha))[:, 2]
    np.testing.assert_allclose(beams @ normal, 0, atol=1e-12)
    np.testing.assert_allclose(beams[2], (Ry(beta) @ Rx(alpha))[:, 0], atol=1e-12)


BEARINGS = np.radians([-120.0, -10.0, 0.0, 77.0])
lever_arms = st.tuples(*[st.floats(-0.2, 0.2)] * 3)


@given(st.floats(-pi, pi), st.floats(-pi, pi), lever_arms)
def test_with_a_lever_arm_beams_point_from_the_axis_to_where_they_end(alpha, beta, lever):
    seen = beam_directions_rot(BEARINGS, alpha, beta, lever)
    for direction, bearing in zip(seen, BEARINGS, strict=True):
        end = (Ry(beta) @ Rx(alpha) @ Rz(bearing))[:, 0] + lever
        np.testing.assert_allclose(direction, end / sum(end**2) ** 0.5, atol=1e-12)


@given(st.floats(-pi, pi), st.floats(-pi, pi))
def test_the_polar_angles_of_many_planes_are_those_of_each(alpha, beta):
    planes = np.array([[alpha, beta], [0.3, -0.2]])
    found = polar_of_planes(BEARINGS, planes)
    for row, (a, b) in zip(found, planes, strict=True):
        np.testing.assert_allclose(row, polar_and_azimuth(beam_directions_rot(BEARINGS, a, b))[0], atol=1e-12)


@given(st.floats(-pi, pi), st.floats(-pi, pi))
def test_lines_are_as_far_apart_as_a_beam_leaves_its_plane_in_one_step(alpha, beta):
    beams, step = beam_directions_rot(BEARINGS, alpha, beta), 1e-6
    normal = (Ry(beta) @ Rx(alpha))[:, 2]
    apart = max(abs((Rz(step) @ beam) @ normal) / step for beam in beams)
    assert line_spacing(beams, (alpha, beta)) == pytest.approx(apart, abs=1e-5)
