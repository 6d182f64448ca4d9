"""Points while the scanner turns: those of the whole recording, in time, in bounded memory, and nothing lost."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.firmware_io.rooms import FURNISHED, Setup, Truth, simulate, write
from benchmarks.firmware_io.streaming import turning
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly import axis_window
from scanwright.firmware_io.assembly.assemble import assemble_recording
from scanwright.firmware_io.assembly.axis_curve import smooth
from scanwright.firmware_io.assembly.beam_outcome import Verdict
from scanwright.firmware_io.assembly.deskew_kernel import place_block
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.assembly.streaming import MOST_WAITING, Assembler
from scanwright.firmware_io.clouds.ply import read_ply
from scanwright.firmware_io.poses.trajectory import trajectory_of
from scanwright.firmware_io.recording.importer import import_bag
from scanwright.firmware_io.recording.recording import open_recording
from scanwright.firmware_io.samples import JointLog, JointSample, PoseSample, Scan, blocks

DATA = os.environ.get("SCANWRIGHT_DATA")
START = 1_700_000_000_000_000_000
ANGLES = AngleSet(
    task="streaming",
    angles_deg=Angles(alpha_rot=10, beta_rot=-55, alpha_laser=-80, beta_laser=75),
    sensor="UTM-30LX",
    servo="MX-64R",
    t_rot_laser_mm=(12.0, -7.0, 3.0),
)


def scan_at(index, beams=40, **more):
    rng = np.random.default_rng(index)
    range_m = rng.uniform(0.2, 20, beams).astype(np.float32)
    range_m[::7] = np.inf
    fields = {
        "stamp_ns": START + 25_000_000 * index,
        "angle_min_rad": -2.3,
        "angle_increment_rad": 4.6 / (beams - 1),
        "time_increment_s": 18e-3 / beams,
        "scan_time_s": 0.025,
        "range_min_m": 0.1,
        "range_max_m": 30.0,
        "range_m": range_m,
        "intensity": range_m[:0],
    }
    return Scan(**{**fields, **more})


def angles_of(log):
    return [JointSample(*pair) for pair in zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True)]


def when(thing):
    return int(thing.time_ns[-1]) if isinstance(thing, Scan) else thing.time_ns


def streamed(assembler, things, by=when):
    lines = [line for thing in sorted(things, key=by) for line in assembler.push(thing)]
    return lines + assembler.finish()


def assert_same(lines, scans, offline):
    """`offline` places a block; every scan comes out once, in its order, with the bits of the offline cloud."""
    assert [line.scan.stamp_ns for line in lines] == [scan.stamp_ns for scan in scans]
    at = 0
    for block in blocks(scans):
        placed = offline(block)
        for row in range(block.stamp_ns.size):
            np.testing.assert_array_equal(lines[at].points_m, placed.points_m[row])
            np.testing.assert_array_equal(lines[at].verdict, placed.verdict[row])
            np.testing.assert_array_equal(lines[at].joint_rad, placed.joint_rad[row])
            at += 1


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10**6), lag_s=st.sampled_from([0.0, 0.013, -0.2]), moving=st.booleans())
def test_straight_between_samples_the_points_are_those_of_assemble_bit_for_bit(seed, lag_s, moving):
    rng = np.random.default_rng(seed)
    scans = [scan_at(k, beams=int(rng.integers(30, 32))) for k in range(60)]
    log_ns = START + np.cumsum(rng.integers(2e6, 3e7, 150))
    log = JointLog(log_ns, np.cumsum(rng.normal(0.02, 0.01, 150)))
    numbers = np.hstack([rng.normal(size=(40, 3)), rng.normal(size=(40, 4))])
    numbers[:, 3:] /= np.linalg.norm(numbers[:, 3:], axis=1, keepdims=True)
    numbers = numbers.round(4)  # as files print them
    pose_ns = (START + np.cumsum(rng.integers(1e7, 6e7, 40))).tolist()
    hidden = OwnBody(np.linspace(-2.3, 2.3, 80), rng.random(80) < 0.1, rng.random((80, 36)) < 0.1)
    trajectory = trajectory_of(pose_ns, numbers.tolist()) if moving else None
    poses = [PoseSample(t, tuple(row[:3]), tuple(row[3:])) for t, row in zip(pose_ns, numbers.tolist(), strict=True)]
    assembler = Assembler(ANGLES, lag_s=lag_s, own_body=hidden, smooth=False, with_poses=moving)
    late_ns = {id(thing): int(rng.integers(0, 10**8)) for thing in scans}  # a network that keeps no order
    order = sorted(scans, key=lambda scan: when(scan) + late_ns[id(scan)])
    things = [*angles_of(log), *(poses if moving else []), *scans]
    lines = streamed(assembler, things, lambda thing: when(thing) + late_ns.get(id(thing), 0))
    assert_same(lines, order, lambda block: place_block(block, log, ANGLES, lag_s, poses=trajectory, own_body=hidden))
    assert any((line.verdict == Verdict.POINT).any() for line in lines)
    assert not assembler.left_out


@pytest.mark.skipif(DATA is None, reason="SCANWRIGHT_DATA names no folder with the real recordings")
def test_a_real_recording_comes_out_as_assemble_writes_it(tmp_path):
    bag, recording = Path(DATA) / "tilting/room_240.bag", tmp_path / "room.mcap"
    import_bag(bag, recording, scan="/slice:laserScan", angle="/slice:stepAngle", angle_unit="deg", hold=True)
    pitching = ANGLES.model_copy(update={"angles_deg": Angles(alpha_rot=-90, beta_rot=0, alpha_laser=90, beta_laser=0)})
    assemble_recording(recording, pitching, tmp_path / "room.ply")
    source = open_recording(recording)
    lines = streamed(Assembler(pitching, smooth=False), [*source.scans(), *angles_of(source.joint_log)])
    points = np.concatenate([line.points_m[line.verdict == Verdict.POINT] for line in lines])
    rows = read_ply(tmp_path / "room.ply")
    assert len(points) > 400_000
    np.testing.assert_array_equal(points, np.stack([rows[axis] for axis in "xyz"], axis=1))


def test_smoothed_the_points_are_those_of_assemble_within_the_errors_that_both_state(tmp_path):
    setup = Setup(beams=60, sweeps=((30.0, 180.0),), step_deg=360 / 4096, noise_m=0.0)
    path = write(tmp_path / "r.mcap", simulate(FURNISHED, setup, Truth()))
    assemble_recording(path, ANGLES, tmp_path / "r.ply")
    rows, source = read_ply(tmp_path / "r.ply"), open_recording(path)
    lines = streamed(Assembler(ANGLES), [*source.scans(), *angles_of(source.joint_log)])
    there = np.concatenate([line.verdict for line in lines]) == Verdict.POINT
    found = np.concatenate([line.joint_rad for line in lines])[there]
    stated = np.concatenate([np.full(line.joint_rad.size, line.axis_error_rad) for line in lines])[there]
    assert np.isfinite(stated).mean() > 0.95  # all but the first few, which have nothing to be fitted with
    known = np.isfinite(stated)
    whole = smooth(source.joint_log)
    apart = np.sqrt(np.mean((found - rows["joint_rad"])[known] ** 2))
    assert 0 < apart < 1.5 * np.sqrt(np.mean(stated[known] ** 2) + whole.error_rad**2)
    points = np.concatenate([line.points_m for line in lines])[there]
    off_m = np.linalg.norm(points - np.stack([rows[axis] for axis in "xyz"], axis=1), axis=1)
    range_m = np.concatenate([line.scan.range_m for line in lines])[there]
    assert np.all(off_m <= range_m * np.abs(found - rows["joint_rad"]) + 1e-4)


@pytest.mark.parametrize("speed_deg_s", [20.0, 60.0, 180.0])
def test_the_angles_are_as_near_to_the_truth_as_is_stated_and_nearer_than_straight_lines(speed_deg_s):
    scanner = turning(speed_deg_s, 8.0)
    lines = [line for line in streamed(Assembler(ANGLES), scanner.in_order()) if line.axis_error_rad > 0]
    assert len(lines) > 250
    off = np.concatenate([line.joint_rad - scanner.true_rad(line.scan.time_ns) for line in lines])
    stated = np.sqrt(np.mean([line.axis_error_rad**2 for line in lines]))
    error = np.sqrt(np.nanmean(off**2))
    assert stated / 3 < error < 1.5 * stated
    straight = [scanner.log.angle_at(line.scan.time_ns) - scanner.true_rad(line.scan.time_ns) for line in lines]
    assert error < np.sqrt(np.nanmean(np.concatenate(straight) ** 2)) / 2


@pytest.mark.parametrize(("smoothed", "latency_s"), [(True, 0.35), (False, 0.0)])
def test_a_scan_comes_with_the_first_angle_after_its_latency(smoothed, latency_s):
    assembler, scanner = Assembler(ANGLES, smooth=smoothed), turning(20.0, 4.0)
    assert assembler.latency_s == latency_s
    delays_s = []
    for thing in scanner.in_order():
        for line in assembler.push(thing):
            assert isinstance(thing, JointSample)
            delays_s.append((thing.time_ns - int(line.scan.time_ns[-1])) / 1e9)
    assert len(delays_s) > 80
    assert latency_s <= min(delays_s) and max(delays_s) < latency_s + 0.02  # the servo is asked every 10 ms or so


def test_what_cannot_be_taken_is_counted_and_does_no_harm():
    assembler = Assembler(ANGLES, smooth=False, with_poses=True)
    for time_ns, angle in ((0, 0.0), (10, np.nan), (10, 1.0), (5, 0.0), (10, 2.0), (20, 1e12)):
        assembler.push(JointSample(START + time_ns, angle))
    still = (0.0, 0.0, 0.0, 1.0)
    for time_ns, position in ((0, (0, 0, 0)), (0, (1, 0, 0)), (5, (np.nan, 0, 0)), (7, (0, 0, 0))):
        assembler.push(PoseSample(START + time_ns, position, still))
    assembler.push(PoseSample(START + 9, (0, 0, 0), (0, 0, 0, 2.0)))
    assert assembler.left_out == {
        "angles that are no number of an axis": 2,
        "angles not later than the one before": 2,
        "poses not later than the one before": 1,
        "poses that are none": 2,
    }


@pytest.mark.parametrize("with_poses", [False, True])
def test_without_angles_scans_wait_no_longer_than_the_bound_and_none_is_lost(with_poses):
    assembler = Assembler(ANGLES, with_poses=with_poses)
    scans = [scan_at(k, beams=3) for k in range(MOST_WAITING + 50)]
    early = [line for scan in scans for line in assembler.push(scan)]
    assert len(early) == 50
    lines = early + assembler.finish()
    assert [line.scan for line in lines] == scans
    assert {*np.concatenate([line.verdict for line in lines])} == {Verdict.NO_RETURN, Verdict.OUTSIDE_JOINT_LOG}
    assert assembler.finish() == []


def test_angles_without_poses_place_nothing_on_a_map():
    assembler = Assembler(ANGLES, smooth=False, with_poses=True)
    lines = streamed(assembler, [scan_at(0), JointSample(START - 1, 0.0), JointSample(START + 10**9, 1.0)])
    assert {*lines[0].verdict} == {Verdict.NO_RETURN, Verdict.OUTSIDE_POSES}


def test_memory_is_bounded_by_time_and_by_number(monkeypatch):
    monkeypatch.setattr(axis_window, "_MOST_SAMPLES", 700)
    assembler = Assembler(ANGLES, smooth=False, with_poses=True)
    for k in range(3000):
        assembler.push(JointSample(START + k * 10_000_000, 0.001 * k))
        assembler.push(PoseSample(START + k * 10_000_000, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    assert len(assembler._axis._time_ns) == 401 == len(assembler._poses._time_ns)  # four seconds
    for k in range(3000):
        assembler.push(JointSample(START + 3 * 10**10 + k * 1000, 3.0))
    assert len(assembler._axis._time_ns) == 700


@pytest.mark.parametrize("wrong", [{"lag_s": np.nan}, {"lag_s": 11.0}, {"look_ahead_s": -0.1}])
def test_times_that_make_no_sense_are_refused(wrong):
    with pytest.raises(RecordingError, match=next(iter(wrong))):
        Assembler(ANGLES, **wrong)
    with pytest.raises(RecordingError, match="with_poses"):
        Assembler(ANGLES).push(PoseSample(START, (0, 0, 0), (0, 0, 0, 1)))
