"""De-skew and assembly: against the slow obvious loop, against laws, and against a real scanner's known geometry."""

import os
import re
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from benchmarks.firmware_io.recordings.deskew import deskew, place
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.assemble import assemble_recording
from scanwright.firmware_io.assembly.beam_outcome import Verdict
from scanwright.firmware_io.assembly.options import AssembleOptions
from scanwright.firmware_io.assembly.turns import turn_starts
from scanwright.firmware_io.clouds.ply import read_ply
from scanwright.firmware_io.poses.trajectory import Trajectory
from scanwright.firmware_io.recording.importer import import_bag
from scanwright.firmware_io.recording.recording import recording_writer
from scanwright.firmware_io.samples import JointLog, Scan

DATA = os.environ.get("SCANWRIGHT_DATA")
needs_data = pytest.mark.skipif(DATA is None, reason="SCANWRIGHT_DATA names no folder with the real recordings")
START = 1_436_377_047_737_469_125
angle_deg = st.floats(-180, 180)
length_mm = st.floats(-300, 300)


def angle_set(alpha_rot=0.0, beta_rot=0.0, alpha_laser=0.0, beta_laser=0.0, **more):
    angles = Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha_laser, beta_laser=beta_laser)
    return AngleSet(task="test", angles_deg=angles, sensor="any", servo="any", **more)


any_angles = st.builds(
    angle_set,
    angle_deg,
    angle_deg,
    angle_deg,
    angle_deg,
    delta_rotvec_rot_deg=st.tuples(angle_deg, angle_deg),
    t_rot_laser_mm=st.tuples(length_mm, length_mm, length_mm),
    t_world_rot_mm=st.tuples(length_mm, length_mm, length_mm),
)


def a_scan(seed=0, beams=50, stamp_ns=START, **more):
    rng = np.random.default_rng(seed)
    fields = {
        "stamp_ns": stamp_ns,
        "angle_min_rad": -2.0,
        "angle_increment_rad": 4.0 / beams,
        "time_increment_s": 1e-3,
        "scan_time_s": 0.1,
        "range_min_m": 0.1,
        "range_max_m": 30.0,
        "range_m": rng.uniform(0.1, 30, beams).astype(np.float32),
        "intensity": np.empty(0, np.float32),
    }
    return Scan(**{**fields, **more})


def a_log(start_rad, stop_rad, begin_ns=START - 10**9, end_ns=START + 10**9):
    return JointLog(np.array([begin_ns, end_ns]), np.array([start_rad, stop_rad], float))


def write(path, scans, log):
    with recording_writer(path, {}) as writer:
        for time_ns, position_rad in zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True):
            writer.joint(time_ns, position_rad)
        for scan in scans:
            writer.scan(scan)
    return path


@pytest.mark.parametrize(
    ("sensor", "first_deg", "last_deg", "beams", "other"),
    [
        ("UTM-30LX", -135, 135, 1081, False),
        ("UTM-30LX", -135, 134.25, 360, False),  # clusters of three
        ("UTM-30LX", -90, 90, 721, False),
        ("UTM-30LX", -119.5, 119.5, 681, True),  # a URG-04LX
        ("UTM-30LX", -180, 179.5, 720, True),
        ("UTM-30LX", 0, 0, 1, False),
        ("STL27L", -180, 179, 360, False),  # a driver's own grid
        ("STL27L", -135, 135, 1081, True),
        ("nobody's", -135, 135, 1081, False),
    ],
)
def test_the_beams_of_another_sensor_are_told(tmp_path, sensor, first_deg, last_deg, beams, other):
    step_rad = np.radians((last_deg - first_deg) / max(beams - 1, 1))
    scan = a_scan(
        beams=beams, angle_min_rad=np.radians(first_deg), angle_increment_rad=step_rad, time_increment_s=0.02 / beams
    )
    recording = write(tmp_path / "r.mcap", [scan], a_log(0.0, 1.0))
    angles = angle_set().model_copy(update={"sensor": sensor})
    said = [
        line
        for line in assemble_recording(recording, angles, tmp_path / "o.ply").notes
        if "the scanner that made it" in line
    ]
    assert len(said) == other
    assert all(sensor in line and f"from {first_deg} to {last_deg:.4g} deg" in line for line in said)


@pytest.mark.parametrize("whole", [True, False])
def test_an_incomplete_first_scan_does_not_condemn_the_angle_set(tmp_path, whole):
    scans = [
        a_scan(
            beams=360,
            stamp_ns=START + 2 * 10**8 * k,
            angle_min_rad=-np.pi,
            angle_increment_rad=np.radians(0.6 if not (whole and k) else 1.0),
            time_increment_s=1e-4,
        )
        for k in range(3)
    ]
    recording = write(tmp_path / "r.mcap", scans, a_log(0.0, 1.0))
    angles = angle_set().model_copy(update={"sensor": "LD19"})
    notes = assemble_recording(recording, angles, tmp_path / "o.ply").notes
    assert any("the scanner that made it" in line for line in notes) != whole


@settings(max_examples=50, deadline=None)
@given(angles=any_angles, seed=st.integers(0, 99), start=angle_deg, stop=angle_deg, lag_s=st.floats(-0.5, 0.5))
def test_the_slow_obvious_loop_agrees(angles, seed, start, stop, lag_s):
    scan, log = a_scan(seed), a_log(start, stop)
    slow = []
    for i, r in enumerate(scan.range_m.tolist()):
        bearing = scan.angle_min_rad + i * scan.angle_increment_rad
        seconds_into_log = 1.0 + i * scan.time_increment_s + lag_s
        joint = start + (stop - start) * seconds_into_log / 2.0
        slow.append((angles.T_world_laser(joint) @ [r * np.cos(bearing), r * np.sin(bearing), 0, 1])[:3])
    # our times are whole nanoseconds: each of two roundings turns the axis by speed x 0.5 ns
    atol = 1e-9 + 30 * abs(stop - start) / 2 * 1e-9
    np.testing.assert_allclose(deskew(scan, log, angles, lag_s), slow, rtol=0, atol=atol)


@settings(deadline=None)
@given(angles=any_angles, start=angle_deg, stop=angle_deg)
def test_an_axis_through_the_lidar_keeps_every_range(angles, start, stop):
    angles = angles.model_copy(update={"t_rot_laser_mm": (0, 0, 0), "t_world_rot_mm": (0, 0, 0)})
    scan = a_scan(1)
    points = deskew(scan, a_log(start, stop), angles)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), scan.range_m, rtol=1e-9)


@settings(deadline=None)
@given(angles=any_angles, joint=angle_deg, turn=st.integers(-3, 3))
def test_whole_turns_change_nothing(angles, joint, turn):
    scan = a_scan(2)
    here, there = (a_log(joint + k * 2 * np.pi, joint + k * 2 * np.pi) for k in (0, turn))
    np.testing.assert_allclose(deskew(scan, here, angles), deskew(scan, there, angles), atol=1e-9)


def test_every_beam_gets_its_verdict_and_keeps_its_row():
    ranges = [np.nan, np.inf, 0.0, 0.05, -np.inf, 31.0, 0.1, 30.0, 5.0, 5.0]
    scan = a_scan(range_m=np.array(ranges, np.float32), range_min_m=float(np.float32(0.1)), time_increment_s=0.1)
    placed = next(place([scan], a_log(0, 1, end_ns=START + 800_000_000), angle_set()))
    none, near, far, outside, point = (
        Verdict.NO_RETURN,
        Verdict.TOO_NEAR,
        Verdict.TOO_FAR,
        Verdict.OUTSIDE_JOINT_LOG,
        Verdict.POINT,
    )
    assert placed.verdict.tolist() == [none] * 3 + [near] * 2 + [far] + [point] * 3 + [outside]
    np.testing.assert_array_equal(np.isfinite(placed.points_m).all(axis=1), placed.verdict == point)
    np.testing.assert_array_equal(np.isnan(placed.points_m).all(axis=1), placed.verdict != point)


def test_a_late_joint_log_is_put_right_by_its_lag():
    scan, angles = a_scan(3), angle_set(0, 90, 0, -90)
    late = a_log(0.0, 5.0, START - 10**9 + 24_000_000, START + 10**9 + 24_000_000)
    np.testing.assert_allclose(deskew(scan, late, angles, lag_s=0.024), deskew(scan, a_log(0.0, 5.0), angles))


def test_memory_does_not_grow_with_the_number_of_scans():
    log = a_log(0, 100, end_ns=START + 10**12)

    def peak(count):
        tracemalloc.start()
        scans = (a_scan(0, 1081, START + k * 10**8) for k in range(count))
        for placed in place(scans, log, angle_set()):
            assert placed.points_m.shape == (1081, 3)
        peak_bytes = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak_bytes

    # one placed scan is 0.1 MB: 950 more of them would be 95 MB
    assert peak(1000) < peak(50) + 500_000


def test_organised_and_flat_clouds_hold_the_same_points(tmp_path):
    short = a_scan(1, 40, START + 10**8, intensity=np.arange(40, dtype=np.float32))
    scans = [a_scan(0, range_m=np.array([1, np.nan, 3] * 20, np.float32)), short, a_scan(2, 50, START + 3 * 10**9)]
    recording = write(tmp_path / "r.mcap", scans, a_log(0, 1))
    organised = assemble_recording(recording, angle_set(), tmp_path / "o.ply", AssembleOptions(organised=True))
    flat = assemble_recording(recording, angle_set(), tmp_path / "f.ply")
    assert (organised.rows, flat.rows) == (180, 80)
    assert organised.lines()[-1] == f"wrote 180 rows (80 points, 60 rows a scan) to {tmp_path / 'o.ply'}"
    assert flat.lines()[-1] == f"wrote 80 points of 150 beams to {tmp_path / 'f.ply'}"
    assert (organised.width, organised.height, organised.padding, flat.width, flat.padding) == (60, 3, 30, 0, 0)
    assert organised.points == flat.points == 80
    assert organised.beams == flat.beams == 150
    assert organised.left_out == flat.left_out == {"no_return": 20, "outside_joint_log": 50}
    rows = read_ply(tmp_path / "o.ply")
    assert rows.size == 180
    np.testing.assert_array_equal(rows["ring"].reshape(3, 60), np.tile(np.arange(60), (3, 1)))
    assert rows[np.isfinite(rows["x"])].tobytes() == read_ply(tmp_path / "f.ply").tobytes()
    np.testing.assert_array_equal(rows["intensity"][60:100], np.arange(40))
    np.testing.assert_allclose(rows["time_s"][60:100], 0.1 + np.arange(40) * 1e-3, atol=1e-12)
    np.testing.assert_allclose(rows["joint_rad"][60:100], 0.55 + np.arange(40) * 5e-4, atol=1e-12)
    assert b"comment width 60\ncomment height 3\n" in (tmp_path / "o.ply").read_bytes()[:400]


def test_each_turn_becomes_a_cloud_and_together_they_are_the_recording(tmp_path):
    """2.6 turns, from an angle in the middle of a turn."""
    scans = [a_scan(k, 20, START + k * 50_000_000, time_increment_s=1e-4) for k in range(52)]
    log = a_log(1.0, 1.0 + 2.6 * 2 * np.pi, START, START + 2_600_000_000)
    recording = write(tmp_path / "r.mcap", scans, log)
    mount = angle_set(0, 90, 0, -90)
    whole = assemble_recording(recording, mount, tmp_path / "w.ply", AssembleOptions(organised=True))
    for per, heights in (("turn", [20, 20, 12]), ("half", [10, 10, 10, 10, 10, 2])):
        summary = assemble_recording(
            recording, mount, tmp_path / f"{per}.ply", AssembleOptions(per=per, organised=True)
        )
        assert [path.name for path in summary.clouds] == [f"{per}_{k:03}.ply" for k in range(len(heights))]
        assert (summary.points, summary.height) == (whole.points, whole.height)
        rows = [read_ply(path) for path in summary.clouds]
        assert [part.size for part in rows] == [20 * height for height in heights]
        assert b"".join(part.tobytes() for part in rows) == read_ply(tmp_path / "w.ply").tobytes()
        assert f"comment height {heights[-1]}\n".encode() in summary.clouds[-1].read_bytes()[:400]
        told = [line.partition(": leave it out")[0] for line in summary.notes if "leave it out" in line]
        small = ["warning: half_005 holds 2 of the usual 10 scans of half a turn"]
        assert told == (small if per == "half" else []), "12 of 20 scans are more than half of a turn"


def test_a_turn_without_a_point_is_no_cloud(tmp_path):
    ranges = [np.full(20, 5.0 if 10 <= k < 20 else np.nan, np.float32) for k in range(40)]
    scans = [a_scan(0, 20, START + k * 100_000_000, time_increment_s=1e-4, range_m=r) for k, r in enumerate(ranges)]
    log = a_log(0.0, 4 * 2 * np.pi, START, START + 4_000_000_000)
    summary = assemble_recording(
        write(tmp_path / "r.mcap", scans, log), angle_set(), tmp_path / "c.ply", AssembleOptions(per="turn")
    )
    assert [path.name for path in summary.clouds] == ["c_001.ply"]
    assert summary.left_out == {"no_return": 600}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c_001.ply", "r.mcap"]


@settings(deadline=None)
@given(
    first=angle_deg,
    ways_rad=st.lists(st.floats(0.1, 20), min_size=1, max_size=4),
    sign=st.sampled_from([1, -1]),
    turn_rad=st.sampled_from([np.pi, 2 * np.pi]),
    noise_rad=st.sampled_from([0.0, 0.004]),
)
def test_turns_begin_at_whole_turns_and_at_turning_points(first, ways_rad, sign, turn_rad, noise_rad):
    """There, back, there again ... at 1 rad/s; noise of the encoder is no turning point."""
    corner_s = np.concatenate([[0], np.cumsum(ways_rad)])
    signs = sign * (-1.0) ** np.arange(len(ways_rad))
    corner_rad = first + np.concatenate([[0], np.cumsum(signs * ways_rad)])
    seconds = np.union1d(np.arange(0, corner_s[-1], 0.01), corner_s)
    noise = np.random.default_rng(0).uniform(-noise_rad, noise_rad, seconds.size)
    time_ns = START + np.rint(seconds * 1e9).astype(np.int64)
    log = JointLog(
        *(
            found[np.unique(time_ns, return_index=True)[1]]
            for found in (time_ns, np.interp(seconds, corner_s, corner_rad) + noise)
        )
    )
    expected = list(corner_s[1:-1])
    for begin_s, way_rad in zip(corner_s[:-1], ways_rad, strict=True):
        expected += [begin_s + k * turn_rad for k in range(1, int(way_rad / turn_rad) + 1)]
    found_s = (turn_starts(log, int(time_ns[0]), turn_rad) - START) / 1e9
    # a whole turn that ends within the noise of a turning point may be seen or not
    sure = [t for t in expected if np.abs(corner_s[1:] - t).min() > 0.03 or t in corner_s]
    assert all(np.abs(found_s - t).min() < 0.02 for t in sure)
    assert all(np.abs(np.array([*expected, *corner_s]) - t).min() < 0.02 for t in found_s)


def test_own_body_and_poses_are_reasons_of_their_own(tmp_path, command):
    scans = [a_scan(0, 40, START + k * 100_000_000, range_m=np.full(40, 5, np.float32)) for k in range(8)]
    write(tmp_path / "r.mcap", scans, a_log(0.0, 0.0))
    (tmp_path / "angles.json").write_text(angle_set(0, 90, 0, -90).to_json())
    bearing_rad = a_scan(0, 40).bearing_rad
    hidden = bearing_rad > 1.7  # three of 40
    stator = np.zeros((40, 360), bool)
    stator[10, :3] = stator[11, 180] = True  # beam 10 at 0, 1 and 2 deg, beam 11 opposite; the axis stands at 0
    np.savez(tmp_path / "own_body.npz", beams=hidden, stator=stator, bearing_rad=bearing_rad)
    seconds = np.array([-1, 0.5])  # five scans and a beam; beam i is i ms late
    lines = [
        f"{(START + round(t * 1e9)) // 10**9}.{(START + round(t * 1e9)) % 10**9:09} {t} 0 0 0 0 0 1" for t in seconds
    ]
    (tmp_path / "poses.tum").write_text("\n".join(lines))
    words = ["assemble", tmp_path / "r.mcap", "--angles", tmp_path / "angles.json", "-o", tmp_path / "c.ply"]
    code, printed, complaints = command(*words, "--poses", tmp_path / "poses.tum", "--columns", "ring,time_s")
    assert (code, complaints) == (0, [])
    assert f"left out {8 * 4} beams: own body" in printed
    assert f"left out {3 * 36 - 1} beams: outside poses" in printed
    assert "poses: 2, usually 1.5 s apart" in printed
    rows = read_ply(tmp_path / "c.ply")
    assert rows.dtype.names == ("x", "y", "z", "time_s", "ring")
    assert not {10, *np.flatnonzero(hidden)} & set(rows["ring"].tolist())
    bearing, late_s = bearing_rad[rows["ring"]], rows["time_s"]
    # rolling: R_world_laser = Rx(joint), and the joint stands at 0; the platform drives along x at 1 m/s
    np.testing.assert_allclose(rows["x"], 5 * np.cos(bearing) + late_s, atol=2e-6)
    np.testing.assert_allclose(rows["y"], 5 * np.sin(bearing), atol=2e-6)


def test_a_mask_of_another_sensor_is_matched_by_bearing_and_says_what_it_does_not_know(tmp_path, command):
    write(tmp_path / "r.mcap", [a_scan(0, 40, range_m=np.full(40, 5, np.float32))], a_log(0.0, 0.0))
    (tmp_path / "angles.json").write_text(angle_set().to_json())
    fine_rad = np.linspace(-1.95, 1.0, 400) + 2 * np.pi  # the same bearings, counted one turn further
    np.savez(tmp_path / "own_body.npz", beams=np.abs(fine_rad - 2 * np.pi) < 0.25, bearing_rad=fine_rad)
    words = ["assemble", tmp_path / "r.mcap", "--angles", tmp_path / "angles.json", "-o", tmp_path / "c.ply"]
    code, _, complaints = command(*words, "--organised")
    bearing_rad = a_scan(0, 40).bearing_rad
    assert code == 0
    unknown = np.sum((bearing_rad < -1.96) | (bearing_rad > 1.01))
    assert complaints[0].startswith(f"warning: {unknown} of 40 beams have no bearing")
    np.testing.assert_array_equal(np.isnan(read_ply(tmp_path / "c.ply")["x"]), np.abs(bearing_rad) < 0.25)


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"beams": np.zeros(3, bool)}, "bearing_rad: two or more numbers"),
        ({"beams": np.zeros(3, bool), "bearing_rad": np.zeros(3)}, "finite and increasing"),
        (
            {"beams": np.zeros(2, bool), "bearing_rad": np.arange(3.0)},
            r"beams: shape \(2,\), bool: \(3,\) and bool",
        ),
        ({"beams": np.array(["a", "b"]), "bearing_rad": np.arange(2.0)}, "an array of <U1: numbers only"),
        (None, r"own_body.npz: not an archive of NumPy, or damaged: "),
    ],
)
def test_a_wrong_mask_is_one_line(tmp_path, command, arrays, says):
    if arrays is None:
        (tmp_path / "own_body.npz").write_bytes(b"PK\3\4 cut off")
    else:
        np.savez(tmp_path / "own_body.npz", **arrays)
    (tmp_path / "angles.json").write_text(angle_set().to_json())
    code, _, complaints = command("assemble", "r", "--angles", tmp_path / "angles.json", "-o", tmp_path / "c.ply")
    assert code == 2
    assert len(complaints) == 1
    assert re.search(says, complaints[0])


def test_a_gyro_says_how_the_platform_turned_between_two_poses(tmp_path, command):
    """Poses a second apart see nothing of a platform that turns to and fro about z in between; the gyro does."""
    scans = [a_scan(0, 40, START + k * 50_000_000, range_m=np.full(40, 5, np.float32)) for k in range(19)]
    write(tmp_path / "r.mcap", scans, a_log(0.0, 0.0))
    (tmp_path / "angles.json").write_text(angle_set(0, 90, 0, -90).to_json())
    seconds = np.arange(-1, 1.01, 0.005)
    yaw_rad_s = 0.2 * 2 * np.pi * np.cos(2 * np.pi * seconds)
    gyro = [f"{START + round(t * 1e9)},0,0,{rate}" for t, rate in zip(seconds, yaw_rad_s, strict=True)]
    (tmp_path / "imu.csv").write_text("time_ns,wx,wy,wz\n" + "\n".join(gyro))
    poses = [f"{START // 10**9 + k}.{START % 10**9:09} 0 0 0 0 0 0 1" for k in (-1, 0, 1)]
    (tmp_path / "poses.tum").write_text("\n".join(poses))
    words = ["assemble", tmp_path / "r.mcap", "--angles", tmp_path / "angles.json", "-o", tmp_path / "c.ply"]
    words += ["--imu", tmp_path / "imu.csv"]
    posed = [*words, "--poses", tmp_path / "poses.tum"]
    assert "`--imu` requires `--poses`" in command(*words)[2][0]
    assert "pass its orientation on the platform as --imu-rpy-deg" in command(*posed)[2][0]
    code, printed, complaints = command(*posed, "--imu-rpy-deg", 0, 0, 0)
    assert (code, complaints) == (0, [])
    assert "poses: 3, usually 1 s apart, going straight between them is off by 0 mm at most" in printed
    assert "gyro: orientation between poses" in printed
    rows = read_ply(tmp_path / "c.ply")
    bearing = a_scan(0, 40).bearing_rad[rows["ring"]] + 0.2 * np.sin(2 * np.pi * rows["time_s"])
    np.testing.assert_allclose(rows["x"], 5 * np.cos(bearing), atol=1e-3)
    np.testing.assert_allclose(rows["y"], 5 * np.sin(bearing), atol=1e-3)


def test_far_poses_and_gaps_between_them_are_told(tmp_path):
    recording = write(tmp_path / "r.mcap", [a_scan()], a_log(0.0, 1.0))
    time_ns = START + np.append(np.arange(-30, 0), [50, 51]) * 100_000_000
    poses = Trajectory(time_ns, np.full((32, 3), 5e5), np.tile([0, 0, 0, 1.0], (32, 1)))
    said = assemble_recording(recording, angle_set(), tmp_path / "c.ply", platform=poses).notes
    assert said[1].startswith("note: sensor 'any' is no lidar of the catalogue: ")
    assert "going straight between them is off by 0 mm and 0 deg at most" in said[2]
    assert "between two poses lie up to 5.10 s" in said[3]
    assert "500 km from 0, where float32 steps by 1 mm or more" in said[4]


def test_the_steps_of_the_encoder_are_smoothed_unless_the_motor_stopped_or_one_asks(tmp_path):
    step = 2 * np.pi / 4096
    seconds = np.arange(-1, 5, 0.01)
    log = JointLog(START + np.rint(seconds * 1e9).astype(np.int64), np.rint(0.35 * seconds / step) * step)
    scans = [a_scan(k, 60, START + k * 100_000_000, range_m=np.full(60, 20, np.float32)) for k in range(40)]
    off_m = {}
    for name, note, options in (("smooth", {}, {}), ("asked", {}, {"smooth": False}), ("held", {"hold": "true"}, {})):
        with recording_writer(tmp_path / "r.mcap", note) as writer:
            for sample in zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True):
                writer.joint(*sample)
            for scan in scans:
                writer.scan(scan)
        summary = assemble_recording(
            tmp_path / "r.mcap", angle_set(0, 90, 0, -90), tmp_path / "c.ply", AssembleOptions(**options)
        )
        rows = read_ply(summary.out)
        off_m[name] = 20 * np.abs(rows["joint_rad"] - 0.35 * rows["time_s"]).max()
    assert off_m["smooth"] < 0.004
    assert off_m["asked"] == off_m["held"] > 0.012


@pytest.mark.parametrize("hold", ["true", "false"])
def test_time_without_a_scan_is_said_but_not_the_way_between_two_stops(tmp_path, hold):
    """Scans of 0.1 s; 2 s without one, in which angles came or did not."""
    times_s = [0.1 * k for k in range(30) if not 10 <= k < 29]
    for stops in (True, False):
        joints_s = np.arange(-0.1, 3, 0.01) if stops else np.array([-0.1, *times_s, 3])
        log = JointLog(START + np.rint(joints_s * 1e9).astype(np.int64), 0.1 * joints_s)
        with recording_writer(tmp_path / "r.mcap", {"hold": hold}) as writer:
            for sample in zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True):
                writer.joint(*sample)
            for k, time_s in enumerate(times_s):
                writer.scan(a_scan(k, stamp_ns=START + round(time_s * 1e9)))
        summary = assemble_recording(tmp_path / "r.mcap", angle_set(0, 90, 0, -90), tmp_path / "c.ply")
        told = [line for line in summary.notes if "without a scan" in line]
        expected = (
            [] if stops and hold == "true" else ["warning: 2.0 s without a scan at 0.9 s (usually 0.100 s apart)"]
        )
        assert told == expected


def test_a_recording_without_a_single_point_is_refused(tmp_path):
    recording = write(tmp_path / "r.mcap", [a_scan(stamp_ns=START + 2 * 10**9)], a_log(0, 1))
    with pytest.raises(RecordingError, match="none of the 50 beams becomes a point: 50 outside_joint_log"):
        assemble_recording(recording, angle_set(), tmp_path / "o.ply")
    assert [path.name for path in tmp_path.iterdir()] == ["r.mcap"]


@pytest.mark.parametrize(
    ("recording", "out", "lag_s", "says"),
    [
        ("none.mcap", "o.ply", 0.0, "none.mcap: no such file"),
        ("r.mcap", "o.pcd", 0.0, r"name it o\.ply"),
        ("r.mcap", "o.ply", np.nan, "lag nan s"),
        ("r.mcap", "no/o.ply", 0.0, "does not exist"),
    ],
)
def test_wrong_input_is_one_line_and_leaves_no_file(tmp_path, recording, out, lag_s, says):
    write(tmp_path / "r.mcap", [a_scan()], a_log(0, 1))
    with pytest.raises(RecordingError, match=says):
        assemble_recording(tmp_path / recording, angle_set(), tmp_path / out, AssembleOptions(lag_s=lag_s))
    assert [path.name for path in tmp_path.iterdir()] == ["r.mcap"]


# The scanner of the real recordings: tilts about +y, the sensor 0.08 m above the axis.
TILTING = {"alpha_rot": -90, "beta_rot": 0, "alpha_laser": 90, "beta_laser": 0}


def tilting(lever_mm=(0, -80, 0), **changed):
    return angle_set(**{**TILTING, **changed}, t_rot_laser_mm=lever_mm)


def test_the_tilting_angle_set_is_the_pitching_alignment():
    for joint in (0.0, 0.3, -2.0):
        c, s = np.cos(joint), np.sin(joint)
        expected = [[c, 0, s, 0.08 * s], [0, 1, 0, 0], [-s, 0, c, 0.08 * c], [0, 0, 0, 1]]
        np.testing.assert_allclose(tilting().T_world_laser(joint), expected, atol=1e-12)


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """The recording of room_240, and its points by the data README, read from the bag without our code."""
    bag = Path(DATA) / "tilting/room_240.bag"
    recording = tmp_path_factory.mktemp("room") / "room.mcap"
    import_bag(bag, recording, scan="/slice:laserScan", angle="/slice:stepAngle", angle_unit="deg", hold=True)
    points = []
    store = get_typestore(Stores.EMPTY)
    with Reader(bag) as reader:
        store.register(get_types_from_msg(reader.connections[0].msgdef.data, reader.connections[0].msgtype))
        for connection, _, raw in reader.messages():
            message = store.deserialize_ros1(raw, connection.msgtype)
            scan, tilt = message.laserScan, np.radians(message.stepAngle)
            r = np.where(np.isfinite(scan.ranges), scan.ranges, np.nan)
            bearing = scan.angle_min + np.arange(r.size) * scan.angle_increment
            xs, y = r * np.cos(bearing), r * np.sin(bearing)
            x = xs * np.cos(tilt) + 0.08 * np.sin(tilt)
            z = -xs * np.sin(tilt) + 0.08 * np.cos(tilt)
            points.append(np.stack([x, y, z], axis=1))
    return recording, np.concatenate(points)


def distance_m(room, angles, out, **more):
    recording, expected = room
    assemble_recording(recording, angles, out, AssembleOptions(organised=True), **more)
    rows = read_ply(out)
    points = np.stack([rows[name] for name in "xyz"], axis=1)
    np.testing.assert_array_equal(np.isnan(points), np.isnan(expected))
    distance = np.linalg.norm(points - expected, axis=1)
    return distance[np.isfinite(distance)]


@needs_data
def test_the_real_room_is_where_its_geometry_says(room, tmp_path):
    distance = distance_m(room, tilting(), tmp_path / "room.ply")
    assert distance.size > 460_000
    assert distance.max() < 0.008
    assert np.percentile(distance, 95) < 0.003


@needs_data
@pytest.mark.parametrize(
    "wrong",
    [
        tilting(lever_mm=(0, 80, 0)),
        tilting(lever_mm=(0, 0, 0)),
        tilting(lever_mm=(80, 0, 0)),
        tilting(alpha_rot=90),
        tilting(alpha_rot=90, alpha_laser=-90, lever_mm=(0, 80, 0)),
        tilting(alpha_laser=-90),
    ],
)
def test_the_real_room_tells_a_flipped_lever_arm_or_sign(room, tmp_path, wrong):
    distance = distance_m(room, wrong, tmp_path / "room.ply")
    assert np.percentile(distance, 95) > 0.05
