"""Recordings as bags: what went in comes back through the importer, and a database and a header say so themselves."""

import sqlite3
import struct

import numpy as np
import pytest

from benchmarks.firmware_io.calibration import designed
from benchmarks.firmware_io.rooms import FURNISHED, Setup, Truth, simulate, write
from scanwright.firmware_io.recording.importer import import_bag
from scanwright.firmware_io.recording.recording import open_recording, recording_writer
from scanwright.firmware_io.samples import Scan

SETUP = Setup(beams=30, sweeps=((180.0, 90.0),))


@pytest.fixture
def made(tmp_path):
    return write(tmp_path / "room.mcap", simulate(FURNISHED, SETUP, Truth()))


@pytest.mark.parametrize("name", ["room.bag", "room"])
def test_a_recording_comes_back_from_its_bag(made, tmp_path, command, name):
    code, printed, _ = command("convert", made, tmp_path / name)
    assert code == 0
    before = open_recording(made)
    assert f"{before.joint_log.time_ns.size:,} of /joint_states" in printed
    import_bag(
        tmp_path / name, tmp_path / "back.mcap", scan="/scan", angle="/joint_states", angle_unit="rad", hold=False
    )
    after = open_recording(tmp_path / "back.mcap")
    np.testing.assert_array_equal(after.joint_log.time_ns, before.joint_log.time_ns)
    np.testing.assert_array_equal(after.joint_log.position_rad, before.joint_log.position_rad)
    for one, other in zip(before.scans(), after.scans(), strict=True):
        np.testing.assert_array_equal(one.time_ns, other.time_ns)
        np.testing.assert_array_equal(one.range_m, other.range_m)
        np.testing.assert_array_equal(one.bearing_rad, other.bearing_rad)


@pytest.mark.parametrize("name", ["room.bag", "room", "room.mcap"])
def test_turns_of_beams_of_their_own_come_back_with_them(tmp_path, command, name):
    rng, second = np.random.default_rng(7), 10**9
    scans = [
        Scan(
            stamp_ns=10 * second + k * second // 10, angle_min_rad=0.0, angle_increment_rad=-1.2,
            time_increment_s=0.016, scan_time_s=0.1, range_min_m=0.1, range_max_m=12.0,
            range_m=rng.uniform(1, 5, 5 + k).astype(np.float32), intensity=np.empty(0, np.float32),
            beam_bearing_rad=-np.cumsum(rng.uniform(0.5, 1.5, 5 + k)),
            beam_offset_ns=np.cumsum(rng.integers(1, 10**7, 5 + k)),
        )
        for k in range(4)
    ]  # fmt: skip
    source = tmp_path / "turns.mcap"
    with recording_writer(source, {"source": "test", "hold": "false"}) as writer:
        for scan in scans:
            writer.joint(scan.stamp_ns, scan.stamp_ns / second)
            writer.scan(scan)
        writer.joint(11 * second, 11.0)
    if name == "room.mcap":
        source.rename(tmp_path / name)
    else:
        assert command("convert", source, tmp_path / name)[0] == 0
    back = tmp_path / "back.mcap"
    import_bag(tmp_path / name, back, scan="/scan", angle="/joint_states", angle_unit="rad", hold=False)
    for one, other in zip(scans, open_recording(back).scans(), strict=True):
        np.testing.assert_array_equal(one.time_ns, other.time_ns)
        np.testing.assert_array_equal(one.bearing_rad, other.bearing_rad)


@pytest.mark.parametrize("name", ["room.bag", "room"])
def test_a_motor_that_stood_still_during_each_scan_still_does_behind_a_bag(made, tmp_path, command, name):
    source = ("--scan", "/scan", "--angle", "/joint_states", "--angle-unit", "rad")
    held, back = tmp_path / "held.mcap", tmp_path / "back.mcap"
    assert command("import", made, *source, "--hold", "-o", held)[0] == 0
    assert command("convert", held, tmp_path / name)[0] == 0
    assert command("import", tmp_path / name, *source, "-o", back)[0] == 0
    (tmp_path / "angles.json").write_text(designed(SETUP).to_json())
    clouds = []
    for recording in (held, back):
        cloud = recording.with_suffix(".ply")
        code, printed, _ = command("assemble", recording, "--angles", tmp_path / "angles.json", "-o", cloud)
        assert code == 0
        assert "held during each scan" in printed
        clouds.append(cloud.read_bytes())
    assert clouds[0] == clouds[1]


def test_the_database_of_a_ros_2_bag_holds_the_messages_as_ros_lays_them_out(made, tmp_path, command):
    assert command("convert", made, tmp_path / "room")[0] == 0
    with sqlite3.connect(tmp_path / "room" / "room.db3") as database:
        topics = dict(database.execute("select name, type from topics"))
        (data,) = database.execute(
            "select data from messages join topics on topics.id = topic_id where name = '/scan' order by timestamp"
        ).fetchone()
    database.close()
    assert topics == {
        "/scan": "sensor_msgs/msg/LaserScan",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/scanwright/note": "std_msgs/msg/String",
    }
    scan = next(open_recording(made).scans())
    seconds, nanoseconds, letters = struct.unpack_from("<iII", data, 4)  # behind the encapsulation
    assert seconds * 10**9 + nanoseconds == scan.stamp_ns
    assert data[16 : 16 + letters] == b"laser\0"
    first = (16 + letters + 3) // 4 * 4  # aligned to floats
    assert struct.unpack_from("<f", data, first)[0] == np.float32(scan.angle_min_rad)


def test_what_cannot_be_written_is_one_line_and_leaves_nothing(made, tmp_path, command):
    (tmp_path / "there").mkdir()
    for out, says in (
        ("room.ply", "name it room.bag"),
        ("there", "exists"),
        ("no/room.bag", "does not exist"),
        ("no/room", "does not exist"),
    ):
        code, _, complaints = command("convert", made, tmp_path / out)
        assert (code, len(complaints)) == (2, 1)
        assert says in complaints[0]
    made.write_bytes(made.read_bytes()[:1000])
    for out in ("room.bag", "room"):
        assert command("convert", made, tmp_path / out)[0] == 2
        assert not (tmp_path / out).exists()
    assert not list(tmp_path.glob(".*"))
