"""Reading MCAP: the same messages in the same order as the format's own reader, and any CDR byte order."""

import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from scanwright.design import frames
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.mcap_chunks import read_messages, read_note, read_topics

TOPICS = ("/a", "/b", "/c")


def write(path, messages, **options):
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start()
        writer.add_metadata("scanwright", {"hold": "true"})
        schema = writer.register_schema("some/Type", "ros2msg", b"")
        channels = {topic: writer.register_channel(topic, "cdr", schema) for topic in TOPICS}
        for topic, log_ns, data in messages:
            writer.add_message(channels[topic], log_ns, data, log_ns)
        writer.finish()
    return path


@settings(max_examples=40, deadline=None)
@given(
    messages=st.lists(st.tuples(st.sampled_from(TOPICS), st.integers(0, 50), st.binary(max_size=40)), max_size=60),
    chunk_size=st.sampled_from([1, 200, 10**6]),
    compression=st.sampled_from(CompressionType),
    chunked=st.booleans(),
)
@example(  # chunks that overlap, with equal times in both
    messages=[("/a", 1, b"1"), ("/a", 1, b"2"), ("/a", 1, b"3"), ("/a", 1, b"4"), ("/a", 0, b"5")],
    chunk_size=200,
    compression=CompressionType.NONE,
    chunked=True,
)
def test_messages_come_as_the_formats_own_reader_gives_them(
    tmp_path_factory, messages, chunk_size, compression, chunked
):
    path = tmp_path_factory.mktemp("m") / "m.mcap"
    write(path, messages, chunk_size=chunk_size, compression=compression, use_chunking=chunked)
    with path.open("rb") as stream:
        expected = make_reader(stream).iter_messages(topics=["/a", "/c"], log_time_order=True)
        expected = [(channel.topic, message.data) for _, channel, message in expected]
    assert list(read_messages(path, {"/a", "/c"})) == expected


def test_topics_and_notes_are_found(tmp_path):
    path = write(tmp_path / "m.mcap", [("/a", 1, b"")])
    assert read_topics(path) == dict.fromkeys(TOPICS, "some/Type")
    assert read_note(path) == {"hold": "true"}


@pytest.mark.parametrize("where", [0.2, 0.5, 0.8])
def test_a_flipped_bit_is_found(tmp_path, where):
    rng = np.random.default_rng(0)
    messages = [("/a", k, rng.bytes(100)) for k in range(100)]
    path = write(tmp_path / "m.mcap", messages, compression=CompressionType.NONE)
    data = bytearray(path.read_bytes())
    data[round(where * 10_000)] ^= 1
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"m\.mcap: damaged") as caught:
        list(read_messages(path, {"/a"}))
    assert "\n" not in str(caught.value)


def test_only_overlapping_chunks_are_held(tmp_path):
    path = write(tmp_path / "m.mcap", (("/a", k, bytes(10_000)) for k in range(3000)), compression=CompressionType.NONE)
    tracemalloc.start()
    assert sum(1 for _ in read_messages(path, {"/a"})) == 3000
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak_bytes < 6_000_000  # of 30 MB, in chunks of 1 MB


@pytest.mark.parametrize("name", ["", "spin_joint", "laser_frame"])
def test_either_byte_order_and_any_frame_name_is_read(name):
    store = get_typestore(Stores.ROS2_JAZZY)
    stamp = store.types["builtin_interfaces/msg/Time"](sec=7, nanosec=9)
    header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id=name)
    numbers = dict(
        zip(("angle_min", "angle_max", "angle_increment", "time_increment"), (1.0, 2.0, 0.5, 0.25), strict=True)
    )
    numbers |= dict(zip(("scan_time", "range_min", "range_max"), (0.125, 4.0, 8.0), strict=True))
    ranges, intensities = np.arange(5, dtype=np.float32), np.arange(5, 10, dtype=np.float32)
    laser_scan = store.types[ros_messages.LASER_SCAN](header=header, **numbers, ranges=ranges, intensities=intensities)
    joints = store.types[ros_messages.JOINT_STATE](
        header=header,
        name=["other", "spin_joint"],
        position=np.array([1.5, 2.5]),
        velocity=np.empty(0),
        effort=np.ones(3),
    )
    for little in (True, False):
        scan = ros_messages.decode_scan(
            bytes(store.serialize_cdr(laser_scan, ros_messages.LASER_SCAN, little_endian=little))
        )
        assert (scan.stamp_ns, scan.angle_min_rad, scan.range_max_m) == (7_000_000_009, 1.0, 8.0)
        np.testing.assert_array_equal([scan.range_m, scan.intensity], [ranges, intensities])
        joint = bytes(store.serialize_cdr(joints, ros_messages.JOINT_STATE, little_endian=little))
        assert ros_messages.decode_joint(joint) == (7_000_000_009, 2.5)
        nobody = store.types[ros_messages.JOINT_STATE](header, ["spin_joint"], np.empty(0), np.empty(0), np.empty(0))
        assert np.isnan(
            ros_messages.decode_joint(
                bytes(store.serialize_cdr(nobody, ros_messages.JOINT_STATE, little_endian=little))
            )[1]
        )


@pytest.mark.parametrize("size", [3, 20, 50])
def test_a_message_that_is_cut_off_is_an_error_and_not_a_value(size):
    store = get_typestore(Stores.ROS2_JAZZY)
    data = ros_messages.encode_joint(5, 1.0)
    assert len(data) > size
    with pytest.raises((ValueError, IndexError, struct.error, SerdeError)):
        ros_messages.decode_joint(data[:size])
    assert store.deserialize_cdr(data, ros_messages.JOINT_STATE).position[0] == 1.0


def test_a_frame_of_tf_is_the_pose_that_it_was_made_of():
    T = frames.rigid(frames.Rz(0.3) @ frames.Rx(-2.0), [1.0, 2.0, 3.0])
    data = ros_messages.encode_transforms([("rot", "laser", T)], 1_700_000_000_123_456_789)
    (said,) = ros_messages.decode_message(data, ros_messages.TRANSFORMS).transforms
    q, t = said.transform.rotation, said.transform.translation
    np.testing.assert_allclose(Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix(), T[:3, :3], atol=1e-12)
    assert [t.x, t.y, t.z] == [1, 2, 3] and (said.header.frame_id, said.child_frame_id) == ("rot", "laser")
    assert ros_messages.stamp_ns(said.header.stamp) == 1_700_000_000_123_456_789


@pytest.mark.parametrize("shape", [(6,), (2, 3)])
def test_points_keep_their_rows_and_columns(shape):
    rows = np.zeros(shape, [("x", "<f4"), ("time", "<f8")])
    message = ros_messages.decode_message(ros_messages.encode_points(rows, "world", 5), ros_messages.POINT_CLOUD)
    assert (message.height, message.width) == (1, *shape)[-2:]
    assert message.row_step == message.point_step * message.width and message.data.size == rows.nbytes
