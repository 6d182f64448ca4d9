"""Bags of other programs: without chunks, of ROS 1, without metadata, several echoes, an IMU as the angle."""

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from scanwright import api
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.beam_outcome import between_surfaces
from scanwright.firmware_io.assembly.options import AssembleOptions
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.import_checks.corrections import Corrections
from scanwright.firmware_io.recording.importer import import_bag
from scanwright.firmware_io.recording.recording import open_recording
from scanwright.firmware_io.samples import Scan, blocks, with_all_echoes

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


def test_all_echoes_are_kept_and_assemble_chooses(tmp_path):
    """Three rays: two echoes (the second stronger), none, one."""
    echoes = ([[1.0, 2.0], [], [3.0]], [[10, 20], [], [30]])
    summary, recording = brought(folder(tmp_path / "in", rows(echoes=echoes)), echo="all")
    assert summary.beams == 12 * 3 * 2
    one = next(iter(recording.scans()))
    np.testing.assert_array_equal(one.range_m, [1, 2, np.inf, np.inf, 3, np.inf])
    np.testing.assert_allclose(one.bearing_rad, [-0.5, -0.5, 0, 0, 0.5, 0.5], atol=1e-6)
    np.testing.assert_allclose(np.diff(one.time_ns), [0, 7957747, 0, 7957747, 0], atol=2)
    angles = AngleSet(
        task="echo",
        angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=60, beta_laser=20),
        sensor="any",
        servo="any",
    )
    for echo, near in (("all", [1, 2, 3]), ("first", [1, 3]), ("last", [2, 3]), ("strongest", [2, 3])):
        made = api.assemble(recording.path, angles, tmp_path / f"{echo}.ply", AssembleOptions(echo=echo))
        assert made.beams == made.points + sum(made.left_out.values())
        cloud = api.read_cloud(tmp_path / f"{echo}.ply")
        lengths = np.linalg.norm(cloud.points_m, axis=1)
        np.testing.assert_allclose(np.sort(lengths), np.sort(np.tile(near, 12)), atol=1e-5)
        _, single = brought(folder(tmp_path / f"in_{echo}", rows(echoes=echoes)), echo=echo)
        kept = np.concatenate([scan.range_m for scan in single.scans()])
        np.testing.assert_array_equal(np.sort(kept[np.isfinite(kept)]), np.sort(np.tile(np.float32(near), 12)))


def test_neighbours_of_an_echo_are_the_same_echoes_of_other_rays():
    rng = np.random.default_rng(0)
    near = np.where(np.arange(40) < 20, 2.0, 4.0) + rng.normal(0, 0.001, 40)
    near[20] = 3.0
    numbers = {"angle_min_rad": 0.0, "angle_increment_rad": 0.005, "time_increment_s": 1e-5, "scan_time_s": 0.1}
    limits = {"range_min_m": 0.1, "range_max_m": 9.0, "intensity": np.empty(0, np.float32)}
    single = Scan(stamp_ns=START_NS, **numbers, **limits, range_m=near.astype(np.float32))
    both = np.stack([near, near + 1], axis=1).astype(np.float32)
    double = with_all_echoes(single, both, np.zeros_like(both), 2)
    (one,), (two,) = blocks([single]), blocks([double])
    expected = between_surfaces(one, 8.0)[0]
    assert expected.any()
    np.testing.assert_array_equal(between_surfaces(two, 8.0)[0, ::2], expected)
