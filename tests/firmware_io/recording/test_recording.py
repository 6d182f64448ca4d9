"""The project's recording: it comes back as it went in, other readers read it, and a failure leaves nothing."""

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.recording import open_recording, recording_writer
from scanwright.firmware_io.samples import JointLog, Scan

float32 = st.floats(-1e3, 1e3, width=32)
stamps = st.integers(0, 2**31 * 10**9 - 1)


def a_scan(stamp_ns=1_436_377_047_737_469_125, range_m=(1.0, np.nan, np.inf, -np.inf, 0.0, 2.5), intensity=()):
    return Scan(
        stamp_ns=stamp_ns,
        angle_min_rad=-0.5,
        angle_increment_rad=0.25,
        time_increment_s=float(np.float32(9.765625e-05)),
        scan_time_s=float(np.float32(0.1)),
        range_min_m=0.0625,
        range_max_m=5.5,
        range_m=np.array(range_m, np.float32),
        intensity=np.array(intensity, np.float32),
    )


def write(path, scans, joints=((0, 0.0), (2**31 * 10**9 - 1, 1.0))):
    with recording_writer(path, {"source": "test"}) as writer:
        for time_ns, position_rad in joints:
            writer.joint(time_ns, position_rad)
        for scan in scans:
            writer.scan(scan)
    return path


def assert_same(found, scan):
    for name in Scan.__slots__:
        np.testing.assert_array_equal(getattr(found, name), getattr(scan, name))


scan_values = st.builds(
    Scan,
    stamp_ns=stamps,
    angle_min_rad=float32,
    angle_increment_rad=float32,
    time_increment_s=st.floats(0, 1, width=32),
    scan_time_s=float32,
    range_min_m=float32,
    range_max_m=st.floats(width=32, allow_nan=False),
    range_m=arrays(np.float32, 7, elements=st.floats(width=32)),
    intensity=st.just(np.empty(0, np.float32)) | arrays(np.float32, 7, elements=float32),
)


@settings(deadline=None)
@given(scan=scan_values)
def test_a_scan_survives_its_bytes(scan):
    assert_same(ros_messages.decode_scan(ros_messages.encode_scan(scan)), scan)


def with_beams(scan, seed):
    """The same with bearings and times of its own beams, which no even grid holds."""
    rng = np.random.default_rng(seed)
    beams = scan.range_m.size
    return replace(
        scan,
        beam_bearing_rad=-np.cumsum(rng.uniform(0.5, 1.5, beams)),
        beam_offset_ns=np.cumsum(rng.integers(0, 10**6, beams)),
    )


def test_beams_of_their_own_come_back_to_the_bit_and_others_stay_even(tmp_path):
    uneven = [with_beams(a_scan(stamp_ns=10**9 * (k + 1), range_m=[1.0] * (5 + k)), k) for k in range(3)]
    scans = [uneven[0], a_scan(stamp_ns=10**9 + 1), *uneven[1:], a_scan(stamp_ns=10**10)]
    found = list(open_recording(write(tmp_path / "a.mcap", scans)).scans())
    for one, scan in zip(found, scans, strict=True):
        assert_same(one, scan)
        np.testing.assert_array_equal(one.bearing_rad, scan.bearing_rad)
        np.testing.assert_array_equal(one.time_ns, scan.time_ns)
    bearing_rad = open_recording(tmp_path / "a.mcap").arrays().bearing_rad
    np.testing.assert_array_equal(bearing_rad[2, :6], uneven[1].beam_bearing_rad)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"beam_bearing_rad": None}, "not as many bearings"),
        ({"beam_offset_ns": np.arange(5)}, "not as many bearings"),
        ({"beam_offset_ns": np.array([0, 3, 2, 4, 5, 6])}, "before that of the one before it"),
        ({"beam_offset_ns": np.arange(6) * 10**9}, "a turn of 5.0 s"),
        ({"beam_bearing_rad": np.full(6, np.nan)}, "the bearing of a beam is no number"),
    ],
)
def test_beams_that_cannot_be_are_refused(more, told):
    with pytest.raises(RecordingError, match=told):
        replace(with_beams(a_scan(), 1), **more)


@settings(deadline=None)
@given(time_ns=stamps, position_rad=st.floats(-1e6, 1e6))
def test_a_joint_sample_survives_its_bytes(time_ns, position_rad):
    assert ros_messages.decode_joint(ros_messages.encode_joint(time_ns, position_rad)) == (time_ns, position_rad)


@settings(max_examples=20, deadline=None)
@given(scans=st.lists(scan_values, min_size=1, max_size=5, unique_by=lambda scan: scan.stamp_ns))
def test_a_recording_survives_its_file(tmp_path_factory, scans):
    path = write(tmp_path_factory.mktemp("r") / "r.mcap", scans)
    recording = open_recording(path)
    for found, scan in zip(recording.scans(), sorted(scans, key=lambda scan: scan.stamp_ns), strict=True):
        assert_same(found, scan)
    assert recording.beams.tolist() == [7] * len(scans)
    assert recording.has_intensity == any(scan.intensity.size for scan in scans)


def test_the_ros2_reader_of_mcap_reads_it(tmp_path):
    path = write(tmp_path / "r.mcap", [a_scan(intensity=range(6))], joints=[(1_436_377_047_000_000_001, 7.25)])
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        messages = {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}
        assert reader.get_header().profile == "ros2"
    scan, joint = messages["/scan"], messages["/joint_states"]
    assert (scan.header.stamp.sec, scan.header.stamp.nanosec, scan.header.frame_id) == (1436377047, 737469125, "laser")
    np.testing.assert_array_equal(np.array(scan.ranges), np.array([1, np.nan, np.inf, -np.inf, 0, 2.5]))
    assert list(scan.intensities) == [0, 1, 2, 3, 4, 5]
    assert (scan.angle_min, scan.angle_max, scan.angle_increment) == (-0.5, 0.75, 0.25)
    assert scan.time_increment == pytest.approx(9.765625e-05)
    assert (joint.name, list(joint.position), joint.header.stamp.nanosec) == (["spin_joint"], [7.25], 1)


def test_the_reader_of_rosbags_reads_it(tmp_path):
    path = write(tmp_path / "r.mcap", [a_scan()], joints=[(5, 7.25)])
    with AnyReader([path]) as reader:  # knows no types but those in the file
        found = {c.topic: reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()}
        types = {c.topic: c.msgtype for c in reader.connections}
    assert types == {"/scan": "sensor_msgs/msg/LaserScan", "/joint_states": "sensor_msgs/msg/JointState"}
    np.testing.assert_array_equal(found["/scan"].ranges, a_scan().range_m)
    assert found["/joint_states"].position[0] == 7.25


def test_equal_recordings_are_equal_bytes(tmp_path):
    first, second = (write(tmp_path / name, [a_scan()]) for name in ("a.mcap", "b.mcap"))
    assert first.read_bytes() == second.read_bytes()


def test_a_failure_leaves_what_was_there(tmp_path):
    path = tmp_path / "r.mcap"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), recording_writer(path, {}) as writer:
        writer.scan(a_scan())
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("time_ns", [-1, 2**31 * 10**9])
def test_a_time_that_ros_cannot_hold_is_refused(tmp_path, time_ns):
    with pytest.raises(RecordingError, match="does not fit a ROS time"), recording_writer(tmp_path / "r", {}) as writer:
        writer.joint(time_ns, 0.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("out", "says"), [("no/r.mcap", "does not exist"), (".", "folder")])
def test_a_place_that_cannot_be_written_is_one_line(tmp_path, out, says):
    with pytest.raises(RecordingError, match=says), recording_writer(tmp_path / out, {}):
        pass


def cut(path, scans):
    data = write(path, scans).read_bytes()
    path.write_bytes(data[: len(data) // 2])


def text(path, _scans):
    path.write_text("not a recording at all\n" * 20)


def flipped(path, scans):
    data = bytearray(write(path, scans).read_bytes())
    data[data.index(b"\x28\xb5\x2f\xfd") + 40] ^= 0xFF  # inside the first zstd frame
    path.write_bytes(data)


def folder(path, _scans):
    path.mkdir()


def missing(_path, _scans):
    pass


def other_topic(path, _scans):
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        for topic in ("/scann", "/joint_states"):
            schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
            writer.add_message(writer.register_channel(topic, "cdr", schema), 0, b"\0\1\0\0", 0)
        writer.finish()


BROKEN = {
    cut: "the recording was cut off",
    text: "not an MCAP file",
    flipped: "r.mcap: damaged: ",
    folder: "this is a folder",
    other_topic: r"no topic /scan; did you mean '/scann'\?",
    missing: "no such file",
    lambda path, _: path.write_bytes(b""): "r.mcap: empty",
    lambda path, scans: write(path, scans, joints=()): "/joint_states has no message",
    lambda path, _: write(path, ()): "/scan has no message",
    lambda path, scans: write(path, scans, joints=[(5, 0.0), (5, 1.0)]): "sample 1 is not later",
}


@pytest.mark.parametrize("broken", BROKEN)
def test_a_broken_recording_is_one_line(tmp_path, broken):
    path = tmp_path / "r.mcap"
    broken(path, [a_scan(stamp_ns=n) for n in range(1, 40)])
    with pytest.raises(RecordingError, match=BROKEN[broken]) as caught:
        list(open_recording(path).scans())
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_chunk_holds_a_quarter_of_a_second_of_each_topic_whatever_its_clock(tmp_path):
    with recording_writer(tmp_path / "r.mcap", {}) as writer:
        for k in range(200):  # 40 a second, and angles of a clock that is years behind
            writer.joint(k * 25_000_000, 0.1 * k)
            writer.scan(a_scan(10**18 + k * 25_000_000))
    with (tmp_path / "r.mcap").open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    assert len(chunks) == 20
    assert {chunk.message_end_time - chunk.message_start_time for chunk in chunks} == {10**18 + 225_000_000}
    assert [chunk.message_start_time for chunk in chunks] == [k * 250_000_000 for k in range(20)]


def test_reading_holds_no_more_than_a_chunk_or_two(tmp_path):
    rng = np.random.default_rng(0)

    def peak(scans):
        path = write(tmp_path / "r.mcap", (a_scan(n, rng.uniform(1, 5, 1081)) for n in range(1, scans)))
        tracemalloc.start()
        for _ in open_recording(path).scans():
            pass
        peak_bytes = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak_bytes

    # a chunk of 1 MB at most, and 6000 scans are 26 MB
    assert peak(6000) < peak(1500) + 3_000_000


@settings(deadline=None)
@given(
    times=st.lists(st.integers(0, 10**12), min_size=1, max_size=20, unique=True).map(sorted),
    asked=st.lists(st.integers(-(10**11), 2 * 10**12), max_size=20),
)
def test_the_angle_goes_straight_between_samples_and_never_beyond(times, asked):
    origin_ns = 1_436_377_047_737_469_125
    position = np.cos(np.arange(len(times)) * 9.0) * 7
    log = JointLog(np.array(times, np.int64) + origin_ns, position)
    found = log.angle_at(np.array(asked, np.int64) + origin_ns)
    np.testing.assert_allclose(found, np.interp(asked, times, position, np.nan, np.nan), rtol=1e-9, atol=1e-9)
    assert np.isnan(found).tolist() == [not times[0] <= t <= times[-1] for t in asked]


@pytest.mark.parametrize(("times", "positions"), [([], []), ([1, 2], [0.0]), ([2, 2], [0.0, 1.0]), ([1], [np.nan])])
def test_an_impossible_joint_log_is_refused(times, positions):
    with pytest.raises(RecordingError):
        JointLog(np.array(times, np.int64), np.array(positions))


def test_the_time_of_a_beam_is_exact_far_from_the_epoch():
    scan = a_scan()
    assert scan.time_ns.tolist() == [scan.stamp_ns + round(k * scan.time_increment_s * 1e9) for k in range(6)]


def test_no_part_file_is_left(tmp_path: Path):
    write(tmp_path / "r.mcap", [a_scan()])
    assert [path.name for path in tmp_path.iterdir()] == ["r.mcap"]
