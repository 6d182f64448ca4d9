"""Calibration of scanners whose errors are known, in simulated rooms that share no code with it."""

import json
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from benchmarks.firmware_io.calibration import calibrated, designed, faulty, mount_of, strays
from benchmarks.firmware_io.rooms import (
    CORRIDOR,
    EMPTY_HALL,
    FURNISHED,
    NAMES,
    Room,
    Setup,
    Simulated,
    Truth,
    bound,
    faces,
    simulate,
    write,
)
from scanwright.design.angles import load_angles
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.assemble import assemble_recording
from scanwright.firmware_io.calibration import entropy
from scanwright.firmware_io.calibration.calibrate import calibrate_recordings
from scanwright.firmware_io.calibration.estimate import estimate
from scanwright.firmware_io.calibration.model import PARAMETERS, gather
from scanwright.firmware_io.recording.importer import import_bag
from scanwright.firmware_io.recording.recording import open_recording

KEYS = [parameter.name for parameter in PARAMETERS]
TRUTH = Truth(*np.radians([2.0, -1.0]), 0.01, -0.008, 0.005, *np.radians([0.2, -0.3, 0.1, 0.05]))
QUICK = Setup(beams=180)


@pytest.fixture(autouse=True)
def few_points(monkeypatch):
    """The entropy of fewer points: the pairs of them grow with the square."""
    monkeypatch.setattr(entropy, "_SAMPLE", 1500)


def errors(found, truth):
    """Errors in standard deviations, one for each parameter that was found."""
    off = found.x - [getattr(truth, name) for name in NAMES]
    return off[found.choice.free] / np.sqrt(np.diag(found.covariance))


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A recording of a faulty scanner, and its designed angle set."""
    folder = tmp_path_factory.mktemp("room")
    (folder / "angles.json").write_text(designed(QUICK).to_json())
    (folder / "scanner.urdf").write_text(
        '<robot name="r"><joint name="servo_mount"><origin xyz="0 0 0"/></joint>'
        '<joint name="laser_mount"><origin xyz="0 0 0"/></joint></robot>'
    )
    return write(folder / "room.mcap", simulate(FURNISHED, QUICK, TRUTH)), folder / "angles.json"


def test_the_command_writes_an_angle_set_that_assembles_straight_walls(room, tmp_path, command):
    recording, angles = room
    out = tmp_path / "angles.calibrated.json"
    code, printed, complaints = command("calibrate", recording, "--angles", angles, "-o", out, "-v")
    assert (code, complaints) == (0, [])
    assert "not estimated: one direction at one speed" in printed
    assert "warning" not in printed
    found = load_angles(out)
    assert found.source == "calibration"
    assert found.angles_deg == load_angles(angles).angles_deg
    x, y, _ = ElementTree.parse(tmp_path / "scanner.calibrated.urdf").find("joint[2]/origin").get("xyz").split()
    assert [float(x) * 1e3, float(y) * 1e3] == pytest.approx(found.t_rot_laser_mm[:2])
    assert "--frame-id rot --child-frame-id laser\nas parameters of a launch file:\n  servo_mount_xyz:='" in printed
    covariance = np.array(found.covariance)
    off = np.radians(found.delta_rotvec_rot_deg) - [TRUTH.tilt_x_rad, TRUTH.tilt_y_rad]
    off = np.append(off, np.array(found.t_rot_laser_mm[:2]) / 1e3 - [TRUTH.offset_x_m, TRUTH.offset_y_m])
    assert off @ np.linalg.solve(covariance, off) < chi2.ppf(0.999, 4)
    best = np.sqrt(np.diag(bound(FURNISHED, QUICK, TRUTH, NAMES[:9])))[:4]
    assert (np.sqrt(np.diag(covariance)) < 2 * best).all()

    record = json.loads((tmp_path / "angles.calibrated.report.json").read_text())
    values = {one["name"]: (one["value"], one["sd"]) for one in record["parameters"]}
    assert list(values) == KEYS[:9]
    assert values["range_bias_m"] == (pytest.approx(5.0, abs=0.5), pytest.approx(0.1, rel=0.5))
    assert values["sin_1_rad"][0] == pytest.approx(-0.3, abs=0.03)
    residual, walls = record["residual_mm"], record["wall_straightness_mm"]
    assert residual["before"] > 5 * residual["after"]
    assert residual["after"] == pytest.approx(10, rel=0.03)
    assert residual["after"] < residual["as_assembled"] < 12
    assert max(walls["after"]) < 1.0 < 10 < min(walls["before"])
    assert record["entropy"]["after"] < record["entropy"]["before"]
    assert len(record["singular_values"]) == 9
    assert assemble_recording(recording, found, tmp_path / "room.ply").points > 100_000

    code, printed, _ = command("calibrate", recording, "--angles", out, "-o", tmp_path / "again.json", "--json")
    again = json.loads(printed)
    assert code == 0
    assert again["parameters"][0]["start"] == pytest.approx(found.delta_rotvec_rot_deg[0])
    assert again["parameters"][0]["value"] == pytest.approx(values["delta_x_rad"][0], abs=values["delta_x_rad"][1])


def test_errors_are_as_large_as_stated_and_the_start_may_be_far_off():
    """Of one scanner; of dozens: `python -m benchmarks.firmware_io.calibration`."""
    truth = faulty(1)
    found, *_ = calibrated(QUICK, truth, 1)
    off = (found.x - [getattr(truth, name) for name in NAMES])[:4]
    assert chi2.ppf(0.0005, 4) < off @ np.linalg.solve(found.covariance[:4, :4], off) < chi2.ppf(0.9995, 4)
    # a hundred beams of the other side of edges, in flat tiles, pull as far as a third of what is stated
    stray, used = strays(found, faces(FURNISHED, QUICK, truth, found.tiles.beams.time_ns))
    assert stray < 2e-4 * used
    assert used > 0.95 * found.tiles.count[found.grouping.used].sum()


def test_a_late_log_is_found_where_the_axis_turns_both_ways():
    setup = Setup(beams=120, sweeps=((20.0, 360.0), (-20.0, 360.0)))
    truth = Truth(lag_s=0.024, backlash_rad=float(np.radians(1 / 3)))
    found, *_ = calibrated(setup, truth, 0)
    assert KEYS.index("lag_s") in found.choice.free
    inside_s = 1 / 3 / 2 / 20  # half the backlash, at 20 deg/s
    assert found.x[KEYS.index("lag_s")] == pytest.approx(0.024 - inside_s, abs=2e-4)
    # one speed does not tell it from a lag, so what is stated covers it; the mounting errors are known all the same
    stated = np.sqrt(np.diag(found.covariance))
    assert stated[found.choice.free.tolist().index(KEYS.index("lag_s"))] == pytest.approx(inside_s, rel=0.02)
    assert (stated[:4] < [5e-4, 5e-4, 1e-3, 1e-3]).all()
    assert np.abs(errors(found, truth)).max() < 4
    assert [fixed.why for fixed in found.choice.fixed] == [
        "both ways at one speed: half of it, divided by the speed, is inside the time offset, whose stated error "
        "allows for 0.33 deg of it"
    ]


def test_backlash_is_told_from_a_late_log_by_a_second_speed():
    setup = Setup(beams=120, sweeps=((20.0, 360.0), (-20.0, 360.0), (60.0, 360.0), (-60.0, 360.0)))
    truth = Truth(lag_s=-0.01, backlash_rad=float(np.radians(1 / 3)))
    found, *_ = calibrated(setup, truth, 0)
    assert found.choice.fixed == ()
    assert found.x[KEYS.index("lag_s")] == pytest.approx(-0.01, abs=3e-4)
    assert np.degrees(found.x[KEYS.index("backlash_rad")]) == pytest.approx(1 / 3, abs=0.02)


def seen(setup, room, folder):
    recording = open_recording(write(folder / "r.mcap", simulate(room, setup, Truth())))
    beams, _ = gather([recording], one_place=True)
    return estimate(beams, *mount_of(setup))


HALF = Setup(beams=180, laser_deg=(90.0, 0.0), fov_deg=180.0, sweeps=((20.0, 180.0),))
LOW = {"beams": 180, "position_m": (0.2, 0.1, 1.2)}


@pytest.mark.parametrize(
    ("setup", "room", "says"),
    [
        (Setup(beams=180, laser_deg=(0.5, 0.0)), FURNISHED, r"flat fan: the scan plane is 0\.50 deg from"),
        (HALF, FURNISHED, r"too little is seen twice: .* turned 180 deg"),
        (Setup(**LOW), EMPTY_HALL, r"does not show .*offset along x .*: empty hall: .*\(0\.00, 0\.00, 1\.00\)"),
        (Setup(**LOW), Room(EMPTY_HALL.walls, range_max_m=1.0), "none of the"),
    ],
)
def test_what_cannot_be_seen_is_refused_with_its_reason(tmp_path, setup, room, says):
    with pytest.raises(RecordingError, match=says):
        seen(setup, room, tmp_path)


def test_a_corridor_is_flagged(tmp_path):
    found = seen(Setup(**LOW), CORRIDOR, tmp_path)
    assert any(note.startswith("corridor: no surface faces along (1.00, 0.00, 0.00)") for note in found.choice.notes)
    assert np.abs(errors(found, Truth())).max() < 4


def test_what_the_scanner_sees_of_itself_does_not_count(tmp_path, command):
    setup, truth = Setup(beams=180, noise_m=0.002), faulty(0)
    made = simulate(FURNISHED, setup, truth)
    bearing_rad = made.scans[0].bearing_rad
    fan = Rotation.from_euler("xy", setup.laser_deg, degrees=True)
    direction = fan.apply(np.column_stack([np.cos(bearing_rad), np.sin(bearing_rad), np.zeros(180)]))
    hidden = direction[:, 2] < -0.75
    # a plate that turns with the laser, askew by 1 deg: a disc that swings
    plate_m = -0.6 / (direction @ [np.sin(np.radians(1.0)), 0.0, np.cos(np.radians(1.0))])
    plate_m = plate_m + np.random.default_rng(1).normal(0, setup.noise_m, (len(made.scans), 180))
    seen = [np.where(hidden, at_m, scan.range_m) for scan, at_m in zip(made.scans, plate_m, strict=True)]
    scans = [replace(scan, range_m=row.astype(np.float32)) for scan, row in zip(made.scans, seen, strict=True)]
    write(tmp_path / "r.mcap", Simulated(scans, made.log))
    (tmp_path / "angles.json").write_text(designed(setup).to_json())
    words = ("calibrate", tmp_path / "r.mcap", "--angles", tmp_path / "angles.json", "-o", tmp_path / "a.json")
    np.savez(tmp_path / "own_body.npz", bearing_rad=bearing_rad, beams=hidden)
    code, printed, _ = command(*words)
    assert code == 0
    assert f"dropped {hidden.sum() * len(scans):,} beams: own body" in printed
    found = load_angles(tmp_path / "a.json")
    off = np.radians(found.delta_rotvec_rot_deg) - [truth.tilt_x_rad, truth.tilt_y_rad]
    off = np.append(off, np.array(found.t_rot_laser_mm[:2]) / 1e3 - [truth.offset_x_m, truth.offset_y_m])
    assert off @ np.linalg.solve(np.array(found.covariance), off) < chi2.ppf(0.999, 4)
    (tmp_path / "own_body.npz").unlink()
    code, _, complaints = command(*words)  # now the plate passes for most of the room
    assert code == 2
    assert "too little is seen twice" in complaints[0]


def test_recordings_of_two_places_are_two_scenes(room, tmp_path):
    recording, _ = room
    elsewhere = Setup(beams=180, position_m=(-4.0, -2.0, 1.0))
    other = write(tmp_path / "other.mcap", simulate(FURNISHED, elsewhere, TRUTH, 1))
    beams, _ = gather([open_recording(path) for path in (recording, other)], one_place=False)
    found = estimate(beams, *mount_of(QUICK))
    assert np.abs(errors(found, TRUTH)).max() < 4
    places = {int(s): set(found.tiles.middle.place[found.grouping.surface == s]) for s in range(len(found.grouping.q))}
    assert all(len(place) <= 1 for place in places.values())
    assert set().union(*places.values()) == {0, 1}


@pytest.mark.parametrize(
    ("out", "says"), [("a.txt", r"name it a\.json"), ("no/a.json", "the folder .* does not exist")]
)
def test_wrong_input_is_one_line(room, tmp_path, command, out, says):
    code, _, complaints = command("calibrate", room[0], "--angles", room[1], "-o", tmp_path / out)
    assert (code, len(complaints)) == (2, 1)
    assert re.search(says, complaints[0])
    assert not list(tmp_path.rglob("*.json"))


def test_the_same_beams_do_not_count_twice(room, tmp_path, command):
    code, _, complaints = command("calibrate", room[0], room[0], "--angles", room[1], "-o", tmp_path / "a.json")
    assert (code, len(complaints)) == (2, 1)
    assert "given twice" in complaints[0]


def test_scans_of_another_lidar_than_that_of_the_angle_set_are_named(tmp_path):
    recording = write(tmp_path / "r.mcap", simulate(FURNISHED, HALF, Truth()))
    angles = designed(HALF).model_copy(update={"sensor": "URG-04LX"})
    with pytest.raises(RecordingError, match=r"seen twice: .* of URG-04LX from .*: use the angle set of the scanner"):
        calibrate_recordings([recording], angles, tmp_path / "a.json")


def test_the_real_tilting_scanner_sees_nothing_twice(data, tmp_path, command):
    source = {"scan": "/slice:laserScan", "angle": "/slice:stepAngle"}
    import_bag(data / "tilting/first_scan.bag", tmp_path / "r.mcap", **source, angle_unit="deg", hold=True)
    angles = "design/angle_sets/tilting_urg.json"
    code, _, complaints = command("calibrate", tmp_path / "r.mcap", "--angles", angles, "-o", tmp_path / "a.json")
    assert (code, len(complaints)) == (2, 1)
    assert "too little is seen twice" in complaints[0]
    assert "turned 60 deg" in complaints[0]
    assert not (tmp_path / "a.json").exists()
