"""Points of whole turns while they come: the turns of `assemble --per turn`, each scan once, in its own row."""

import numpy as np
import pytest

from scanwright.design.angles import Angles, AngleSet
from scanwright.firmware_io.assembly.streaming import ScanPoints
from scanwright.firmware_io.assembly.turns import turn_starts
from scanwright.firmware_io.ros import point_rows
from scanwright.firmware_io.ros.point_rows import Turns, in_rot, turn_rows
from scanwright.firmware_io.samples import JointLog, Scan

STEP_NS = 25_000_000
ANGLES = AngleSet(
    task="turns",
    angles_deg=Angles(alpha_rot=10, beta_rot=-30, alpha_laser=60, beta_laser=20),
    t_rot_laser_mm=(3, 4, 0),
    t_world_rot_mm=(1, 2, 130),
    sensor="URG-04LX",
    servo="MX-64R",
    motion={"mode": "spin", "period_s": 5.0},
)


def line(k, joint_rad, beams=3):
    ranges = np.full(beams, 2.0, np.float32)
    scan = Scan(
        stamp_ns=k * STEP_NS,
        angle_min_rad=0.0,
        angle_increment_rad=0.1,
        time_increment_s=1e-4,
        scan_time_s=0.025,
        range_min_m=0.1,
        range_max_m=30.0,
        range_m=ranges,
        intensity=np.empty(0, np.float32),
    )
    points_m = np.tile(np.float32([k, 0, 0]), (beams, 1))
    return ScanPoints(scan, points_m, np.full(beams, joint_rad), np.zeros(beams, np.uint8), np.nan)


def gathered(joint_rad):
    found = Turns()
    out = [turn for k, joint in enumerate(joint_rad) for turn in found.push(line(k, joint))]
    return [[one.scan.stamp_ns // STEP_NS for one in turn] for turn in [*out, *found.finish()]]


def offline(joint_rad):
    time_ns = np.arange(joint_rad.size) * STEP_NS
    return turn_starts(JointLog(time_ns, joint_rad), 0, 2 * np.pi) / STEP_NS


@pytest.mark.parametrize("speed", [0.1234, -0.1234, 7.0])
def test_turns_of_a_spin_are_those_of_the_recording(speed):
    joint_rad = speed * np.arange(300)
    found = gathered(joint_rad)
    assert [k for turn in found for k in turn] == list(range(300))
    if abs(speed) < 2 * np.pi:
        assert [turn[0] for turn in found] == [0, *np.ceil(offline(joint_rad)).astype(int)]


def test_turns_of_a_sweep_end_where_the_axis_turns_back():
    k = np.arange(800)
    noise = np.random.default_rng(3).normal(0, np.radians(0.05), k.size)
    joint_rad = 1.5 * np.sin(2 * np.pi * k / 200) + noise
    found = gathered(joint_rad)
    assert [one for turn in found for one in turn] == k.tolist()
    begins = np.array([turn[0] for turn in found[1:]])
    assert begins.size == 8
    np.testing.assert_allclose(begins, offline(joint_rad), atol=1)


def test_an_axis_that_stands_gives_its_scans_out_all_the_same(monkeypatch):
    monkeypatch.setattr(point_rows, "MOST_BEAMS", 30)
    found = gathered(np.where(np.arange(45) == 20, np.nan, 0.3))
    assert [len(turn) for turn in found] == [10, 10, 10, 10, 5]


def test_a_turn_is_organised_a_row_for_every_beam_of_every_scan():
    rows = turn_rows([line(0, 0.0, 3), line(8000, 0.1, 2)])
    assert rows.shape == (2, 3)
    np.testing.assert_allclose(rows["time"], [[0, 1e-4, 2e-4], [200.0, 200.0001, np.nan]])
    np.testing.assert_array_equal(rows["x"], [[0, 0, 0], [8000, 8000, np.nan]])
    assert rows["ring"].tolist() == [[0, 1, 2]] * 2


def test_points_in_rot_are_where_tf_puts_them_into_the_world():
    scan = line(2, 0.7)
    turned = in_rot(scan, ANGLES)
    homogeneous = np.column_stack([turned.points_m, np.ones(3)])
    np.testing.assert_allclose((ANGLES.T_world_rot(0.7) @ homogeneous.T)[:3].T, scan.points_m, atol=1e-6)
    assert not np.allclose(turned.points_m, scan.points_m)
