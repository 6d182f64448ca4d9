"""Faults of other people's recordings are reported, harmless ones are not, and corrections correct."""

import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.firmware_io.recordings.import_mutations import AT_M, FAULTS, errors_mm, good, sample, write
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.recording.bag_clocks import Stamps
from scanwright.firmware_io.recording.bags import Message
from scanwright.firmware_io.recording.import_checks.angles import outliers
from scanwright.firmware_io.recording.import_checks.clocks import clock_findings
from scanwright.firmware_io.recording.import_checks.corrections import Corrections, radians_per
from scanwright.firmware_io.recording.import_checks.imu import imu_findings
from scanwright.firmware_io.recording.importer import import_bag
from scanwright.firmware_io.recording.recording import open_recording
from scanwright.firmware_io.recording.ros_messages import IMU


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_that_matters_is_reported_and_another_is_not(fault, tmp_path):
    one = sample(list(FAULTS).index(fault), tmp_path)
    assert not one.missed, one
    assert not one.false_alarm, one


def made(fault, tmp_path, seed=3, **corrections):
    rng = np.random.default_rng(seed)
    one = FAULTS[fault](good(rng), rng)
    write(one, tmp_path / "in.bag")
    return one, brought(tmp_path, **corrections)


def brought(tmp_path, angle="/joint:pan", angle_unit="rad", **corrections):
    return import_bag(
        tmp_path / "in.bag",
        tmp_path / "out.mcap",
        scan="/scan",
        angle=angle,
        angle_unit=angle_unit,
        hold=False,
        corrections=Corrections(**corrections),
    )


CORRECTED = {
    "time_increment off": {"time_increment": "auto"},
    "time_increment 0": {"time_increment": "auto"},
    "stamp of the last beam": {"stamp": "last"},
    "increment negative": {"bearings": "limits"},
    "angle outliers": {"drop_outliers": True},
    "angle 0 now and then": {"drop_outliers": True},
}


@pytest.mark.parametrize("fault", CORRECTED)
def test_a_correction_corrects(fault, tmp_path):
    one, summary = made(fault, tmp_path, **CORRECTED[fault])
    assert np.quantile(errors_mm(one, tmp_path / "out.mcap"), 0.99) < 5
    assert summary.warnings == ()


def test_every_warning_has_a_hint(tmp_path):
    for fault in FAULTS:
        _, summary = made(fault, tmp_path)
        (tmp_path / "in.bag").unlink()
        assert all(finding.hint for finding in summary.findings if finding.severity == "warning"), fault


def test_a_finding_states_what_it_costs_and_what_corrects_it(tmp_path):
    one, summary = made("stamp of the last beam", tmp_path)
    (finding,) = [finding for finding in summary.findings if finding.code == "scan_stamp_not_first_beam"]
    assert finding.hint.startswith('stamp = "last"')
    stated_mm = float(finding.message.split(", ")[-1].split(" mm")[0].replace(",", ""))
    speed = np.median(np.abs(np.gradient(one.angle_rad, one.angle_ns / 1e9)))
    late_s = one.true_time_increment * (one.beams - 1)
    assert stated_mm == pytest.approx(1000 * AT_M * speed * late_s, rel=0.05)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("drift_s", "stalled", "seen"), [(0.002, False, True), (0.0, False, False), (0.0, True, False)]
)
def test_a_clock_that_drifts_by_two_milliseconds_is_seen_and_a_stall_is_no_drift(drift_s, stalled, seen, seed):
    rng = np.random.default_rng(seed)
    true_ns = 10**18 + np.arange(80) * 25_000_000
    late_ns = rng.integers(1_000_000, 4_000_000, 80) + np.where(stalled & (np.arange(80) // 5 == 7), 80_000_000, 0)
    stamp_ns = true_ns + np.rint(1e9 * drift_s * np.arange(80) / 80).astype(np.int64)
    angle_ns = 10**18 + np.arange(200) * 10_000_000
    scans = Stamps(stamp_ns, np.maximum.accumulate(true_ns + late_ns))
    angles = Stamps(angle_ns, angle_ns + rng.integers(300_000, 3_000_000, 200))
    found = [one.code for one in clock_findings(scans, angles, np.zeros(80, np.int64), 3.0, same_clock=False)]
    assert found == ["clock_offset_unknown", *["clocks_drift"] * seen]


def test_what_a_clock_offset_that_cannot_be_seen_costs_is_noted(tmp_path):
    _, summary = made("none", tmp_path)
    (finding,) = [finding for finding in summary.findings if finding.code == "clock_offset_unknown"]
    assert (finding.severity, finding.value) == ("note", 0.01)
    assert re.search(r"less than 10 ms cannot be seen here: up to \d+ mm at 5 m", finding.message)
    assert summary.warnings == ()


def test_ranges_that_mean_no_return_become_none(tmp_path):
    one, summary = made("no return is far", tmp_path)
    (finding,) = [finding for finding in summary.findings if finding.code == "longest_range_repeats"]
    brought(tmp_path, no_return_from_m=finding.value)
    ranges = np.concatenate([scan.range_m for scan in open_recording(tmp_path / "out.mcap").scans()])
    np.testing.assert_array_equal(np.isinf(ranges), one.ranges.ravel() >= np.float32(finding.value))


@pytest.mark.parametrize(
    ("scale", "zero", "unit"), [(-1.0, 0.0, "rad"), (0.75, 0.1, "rad"), (1.0, 30.0, "deg"), (-0.5, 100.0, "4096/turn")]
)
def test_angles_of_a_motor_become_angles_of_the_axis(tmp_path, scale, zero, unit):
    one = good(np.random.default_rng(8))
    motor = one.angle_rad / scale / radians_per(unit) + zero
    turn = 2 * math.pi / radians_per(unit)
    wrapped = motor % turn if scale == int(scale) else motor
    write(replace(one, angle_rad=wrapped), tmp_path / "in.bag")
    brought(tmp_path, angle_unit=unit, angle_scale=scale, angle_zero=zero)
    log = open_recording(tmp_path / "out.mcap").joint_log
    off = log.position_rad - one.angle_rad
    np.testing.assert_allclose(off - off[0], 0, atol=1e-6)
    assert math.sin(off[0]) == pytest.approx(0, abs=1e-6)


def test_the_parts_of_a_split_recording_are_one(tmp_path):
    one = good(np.random.default_rng(4))
    half = one.scan_receive_ns[40]
    for name, early in (("a.bag", True), ("b.bag", False)):
        scans = (one.scan_receive_ns < half) == early
        angles = (one.angle_receive_ns < half) == early
        part = replace(
            one,
            **{
                key: getattr(one, key)[scans]
                for key in ("scan_ns", "scan_receive_ns", "time_increment", "ranges", "true_ns")
            },
            **{key: getattr(one, key)[angles] for key in ("angle_ns", "angle_receive_ns", "angle_rad")},
        )
        write(part, tmp_path / name)
    parts = [tmp_path / "b.bag", tmp_path / "a.bag"]
    summary = import_bag(parts, tmp_path / "out.mcap", scan="/scan", angle="/joint", angle_unit="rad", hold=False)
    assert (summary.scans, summary.warnings) == (80, ())
    assert errors_mm(one, tmp_path / "out.mcap").max() < 5


def test_a_joint_that_is_not_there_is_one_line_with_the_others(tmp_path):
    write(good(np.random.default_rng(1)), tmp_path / "in.bag")
    with pytest.raises(RecordingError, match=r"/joint: no joint 'pann'; did you mean 'pan'\?; known: pan$"):
        brought(tmp_path, angle="/joint:pann")


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"angle_scale": 0.0}, "angle_scale = 0"),
        ({"angle_zero": math.nan}, "angle_zero = nan"),
        ({"time_increment": 2.0}, "time_increment = 2"),
        ({"no_return_from_m": -1.0}, "no_return_from_m = -1"),
    ],
)
def test_corrections_out_of_bounds_are_one_line(wrong, says):
    with pytest.raises(RecordingError, match=says):
        Corrections(**wrong)


@pytest.mark.parametrize("unit", ["grad", "0/turn", "/turn", "4096"])
def test_a_unit_that_is_none_is_one_line(unit):
    with pytest.raises(RecordingError, match="write deg or rad, or counts"):
        radians_per(unit)


def test_outliers_are_neither_turning_points_nor_steps_of_an_axis_that_stops():
    back_and_forth = np.abs(np.arange(400) % 80 - 40) * 0.06
    stops = np.repeat(np.arange(30) * 0.4, 12)
    for angle in (back_and_forth, stops, np.arange(300) * 0.06, np.cumsum(np.linspace(0, 0.1, 200))):
        time_ns = 10_000_000 * np.arange(angle.size)
        assert not outliers(time_ns, angle)[0].any()
        spiked = angle.copy()
        spiked[[50, 51, 90]] += [1.0, 1.0, -2.0]
        assert {50, 51, 90} >= set(np.flatnonzero(outliers(time_ns, spiked)[0]).tolist()) >= {90}


def test_an_outlier_of_half_a_turn_is_one():
    angle = 0.01 * np.arange(3000)
    angle[1500] += np.pi
    assert np.flatnonzero(outliers(10_000_000 * np.arange(3000), angle)[0]).tolist() == [1500]


def test_every_code_of_a_check_is_in_the_table_of_the_page():
    root = Path(__file__).parents[3]
    recording = root / "firmware_io" / "recording"
    checks = [recording / "importer.py", *(recording / "import_checks").glob("*.py")]
    called = re.compile(r'(?:Finding|_warning|_remark)\(\s*"(\w+)"')
    codes = {code for path in checks for code in called.findall(path.read_text())}
    page = (root / "docs" / "how-to" / "a-bag.md").read_text().partition("| code | fault | what to do |")[2]
    first_cells = [row.split("|")[1] for row in page.splitlines() if row.startswith("|")]
    assert codes == set(re.findall(r"`(\w+)`", " ".join(first_cells)))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("motion", "expected"), [("at rest", False), ("on the axis", False), ("platform", True)])
def test_an_imu_that_turns_otherwise_than_the_axis_is_evidence_of_a_moved_platform(motion, expected, seed):
    rng = np.random.default_rng(seed)
    t = np.arange(0, 40, 0.01)
    axis = 0.5 * np.sin(0.4 * t)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    rate = np.radians(rng.uniform(-1, 1, 3)) + np.radians(0.2) * rng.normal(size=(t.size, 3))
    turned = {"at rest": 0 * t, "on the axis": -axis, "platform": np.radians(15) * (t > 20) * np.sin(t / 3)}[motion]
    rate += np.gradient(turned, t)[:, None] * direction
    axes = [SimpleNamespace(angular_velocity=SimpleNamespace(x=x, y=y, z=z)) for x, y, z in rate]
    messages = [Message("/imu", 10**18 + round(1e9 * when), body) for when, body in zip(t, axes, strict=True)]
    bag = SimpleNamespace(topics={"/imu": IMU, "/scan": "x"}, messages=lambda _: iter(messages))
    found = list(imu_findings(bag, 10**18 + np.rint(1e9 * t[::3]).astype(np.int64), axis[::3]))
    assert [one.code for one in found] == ["platform_moved"] * expected


def test_one_angle_a_scan_and_a_sweep_away_from_zero_are_reported(tmp_path):
    one = good(np.random.default_rng(5))
    sweep = 1.6 + 0.4 * np.sin(np.linspace(0, 6, one.scan_ns.size))
    angles = {"angle_ns": one.scan_ns, "angle_receive_ns": one.scan_receive_ns, "angle_rad": sweep}
    write(replace(one, **angles), tmp_path / "in.bag")
    found = {finding.code: finding for finding in brought(tmp_path).findings}
    assert found["angles_sparse"].hint.startswith("hold = true")
    assert found["zero_outside"].hint.startswith("angle_zero = 1.5708 ")
    moved = {finding.code for finding in brought(tmp_path, angle_zero=1.57).findings}
    assert "angles_sparse" in moved and "zero_outside" not in moved
