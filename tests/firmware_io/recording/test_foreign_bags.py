"""Bags of other programs: without chunks, of ROS 1, without metadata, several echoes, an IMU as the angle."""

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.import_checks.corrections import Corrections
from scanwright.firmware_io.recording.importer import import_bag
from scanwright.firmware_io.recording.recording import open_recording

START_NS = 1_700_000_000 * 10**9
STORE = get_typestore(Stores.ROS2_JAZZY)
RANGES = np.random.default_rng(0).uniform(1, 4, (12, 3)).astype(np.float32)


def make(kind, **fields):
    return STORE.types[kind](**fields)


def header(time_ns):
    stamp = make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id="x")


def scan(k, echoes=None):
    kind = "sensor_msgs/msg/LaserScan" if echoes is None else "sensor_msgs/msg/MultiEchoLaserScan"
    head = {"angle_min": -0.5, "angle_max": 0.5, "angle_increment": 0.5, "time_increment": 0.05 / (2 * np.pi)}
    limits = {"scan_time": 0.1, "range_min": 0.1, "range_max": 9.0}
    ranges, intensities = RANGES[k], np.empty(0, np.float32)
    if echoes is not None:
        ranges = [make("sensor_msgs/msg/LaserEcho", echoes=np.array(each, np.float32)) for each in echoes[0]]
        intensities = [make("sensor_msgs/msg/LaserEcho", echoes=np.array(each, np.float32)) for each in echoes[1]]
    time_ns = START_NS + k * 10**8 + 10**7
    return kind, time_ns, make(kind, header=header(time_ns), **head, **limits, ranges=ranges, intensities=intensities)


def joint(k):
    time_ns, kind = START_NS + k * 2 * 10**7, "sensor_msgs/msg/JointState"
    empty = np.empty(0)
    fields = {"name": ["pan"], "position": np.array([0.03 * k]), "velocity": empty, "effort": empty}
    return kind, time_ns, make(kind, header=header(time_ns), **fields)


def imu(k):
    time_ns, kind, zero = START_NS + k * 2 * 10**7, "sensor_msgs/msg/Imu", np.zeros(9)
    x, y, z, w = Rotation.from_euler("z", 0.03 * k).as_quat()
    none = make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    turned = {"orientation": make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w), "orientation_covariance": zero}
    rates = {"angular_velocity": none, "angular_velocity_covariance": zero}
    pulls = {"linear_acceleration": none, "linear_acceleration_covariance": zero}
    return kind, time_ns, make(kind, header=header(time_ns), **turned, **rates, **pulls)


def rows(angle=joint, echoes=None):
    """Scans first, then angles: two topics are not in one order of time."""
    scans = [("/scan", *scan(k, echoes)) for k in range(12)]
    return scans + [("/angle", *angle(k)) for k in range(65)]


def mcap(path, profile="ros2", use_chunking=False):
    with path.open("wb") as stream:
        writer = Writer(stream, use_chunking=use_chunking)
        writer.start(profile=profile)
        channels = {}
        for topic, kind, time_ns, message in rows():
            if topic not in channels:
                schema = writer.register_schema(kind, "ros2msg", ros_messages.definition(kind).encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            data = bytes(STORE.serialize_cdr(message, kind))
            writer.add_message(channels[topic], log_time=time_ns + 80_000_000, publish_time=time_ns, data=data)
        writer.finish()
    return path


def folder(path, messages):
    with Writer2(path, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topics = {}
        for topic, kind, time_ns, message in messages:
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=STORE)
            late_ns = 80_000_000 if topic == "/scan" else 1_000_000
            writer.write(topics[topic], time_ns + late_ns, STORE.serialize_cdr(message, kind))
    return path


def brought(bag, angle="/angle:pan", unit="rad", **corrections):
    out = bag.with_suffix(".out.mcap")
    chosen = Corrections(**corrections)
    summary = import_bag(bag, out, scan="/scan", angle=angle, angle_unit=unit, hold=False, corrections=chosen)
    return summary, open_recording(out)


def check(recording):
    np.testing.assert_array_equal([scan.range_m for scan in recording.scans()], RANGES)
    np.testing.assert_allclose(np.diff(recording.joint_log.position_rad), 0.03, atol=1e-9)


def test_mcap_without_chunks_is_read(tmp_path):
    check(brought(mcap(tmp_path / "in.mcap"))[1])


def test_mcap_of_ros_1_is_named(tmp_path):
    with pytest.raises(RecordingError, match="holds ROS 1 messages: name the"):
        brought(mcap(tmp_path / "in.mcap", "ros1", use_chunking=True))


def test_a_folder_without_metadata_is_the_bag_in_it(tmp_path):
    bag = folder(tmp_path / "in", rows())
    (bag / "metadata.yaml").unlink()
    check(brought(bag)[1])
    (bag / "other.db3").write_bytes(b"")
    with pytest.raises(RecordingError, match=r"name one of in\.db3, other\.db3"):
        brought(bag)


def test_the_orientation_of_an_imu_is_an_angle(tmp_path):
    bag = folder(tmp_path / "in", rows(imu))
    check(brought(bag, "/angle:orientation", None)[1])
    with pytest.raises(RecordingError, match=r"not a number; did you mean '/angle:orientation'\?"):
        brought(bag, "/angle")


ECHOES = ([[1.0, 2.0, 3.0], [], [2.5]], [[5.0, 9.0, 7.0], [], [1.0]])


@pytest.mark.parametrize(
    ("echo", "ranges"), [("first", [1, np.inf, 2.5]), ("last", [3, np.inf, 2.5]), ("strongest", [2, np.inf, 2.5])]
)
def test_one_of_several_echoes_is_the_range(tmp_path, echo, ranges):
    summary, recording = brought(folder(tmp_path / "in", rows(echoes=ECHOES)), echo=echo)
    assert summary.scans == 12
    for each in recording.scans():
        np.testing.assert_array_equal(each.range_m, ranges)
        assert each.intensity.size == 3
