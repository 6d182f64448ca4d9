"""Messages at once: the same numbers as one by one, whatever messages stand beside each other."""

import dataclasses
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.ros_messages import blocks_in, joints_in
from scanwright.firmware_io.samples import Scan

STORE = get_typestore(Stores.ROS2_JAZZY)
TIMES = st.integers(0, 2**31 * 10**9 - 1)


def header(time_ns, frame):
    stamp = STORE.types["builtin_interfaces/msg/Time"](*divmod(time_ns, 10**9))
    return STORE.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def scan_bytes(time_ns, frame, increment, scan_time, beams, lit, little):
    numbers = (-1.0, 1.0, increment, 0.0, scan_time, 0.125, 8.0)
    ranges, intensities = np.arange(beams, dtype=np.float32) + time_ns % 7, np.arange(lit, dtype=np.float32)
    message = STORE.types[ros_messages.LASER_SCAN](header(time_ns, frame), *numbers, ranges, intensities)
    return bytes(STORE.serialize_cdr(message, ros_messages.LASER_SCAN, little_endian=little))


def joint_bytes(time_ns, frame, names, position, little):
    """`names` and where one has a position the number of it."""
    positions = np.arange(len(names), dtype=float) + position
    empty = np.empty(0)
    message = STORE.types[ros_messages.JOINT_STATE](header(time_ns, frame), list(names), positions, empty, empty)
    return bytes(STORE.serialize_cdr(message, ros_messages.JOINT_STATE, little_endian=little))


def told(scan):
    return [np.asarray(getattr(scan, field.name)).tolist() for field in dataclasses.fields(Scan)[:-2]]


SCANS = st.builds(
    scan_bytes,
    TIMES,
    st.sampled_from(["laser", "a", "bcdef"]),
    st.sampled_from([0.5, 0.25]),
    st.sampled_from([0.025, 0.0251]),
    st.sampled_from([0, 3, 5]),
    st.sampled_from([0, 3, 5]),
    st.sampled_from([True, True, False]),
)
JOINTS = st.builds(
    joint_bytes,
    TIMES,
    st.sampled_from(["", "base"]),
    st.sampled_from([("spin_joint",), ("other", "spin_joint"), ("spin_joint", "other"), ("tilt_joint",), ()]),
    st.floats(-9, 9),
    st.sampled_from([True, True, False]),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(SCANS, max_size=12))
def test_blocks_hold_the_scans_one_by_one(messages):
    found = [
        dataclasses.replace(block.first, stamp_ns=int(stamp), range_m=row, intensity=lit)
        for block in blocks_in(messages)
        for stamp, row, lit in zip(block.stamp_ns, block.range_m, block.intensity, strict=True)
    ]
    # the time from scan to scan may wander within a block, whose first one tells it
    known = [{**dict(enumerate(told(scan))), 4: None} for scan in found]
    assert known == [{**dict(enumerate(told(ros_messages.decode_scan(data)))), 4: None} for data in messages]


def test_scans_that_differ_in_time_and_measurement_only_are_one_block():
    messages = [scan_bytes(n * 25_000_000, "laser", 0.5, 0.025 + n * 1e-4, 5, 5, True) for n in range(9)]
    (block,) = blocks_in(messages)
    assert block.range_m.shape == block.intensity.shape == (9, 5) and block.range_m.dtype == np.float32


@settings(max_examples=60, deadline=None)
@given(st.lists(JOINTS, max_size=12))
def test_joints_at_once_are_those_one_by_one(messages):
    time_ns, position_rad = joints_in(messages)
    known = [ros_messages.decode_joint(data) for data in messages]
    np.testing.assert_array_equal(time_ns, np.array([one for one, _ in known], np.int64))
    np.testing.assert_array_equal(position_rad, [one for _, one in known])


@pytest.mark.parametrize("read", [blocks_in, joints_in])
@pytest.mark.parametrize("cut", [3, 20, 50, 60])
def test_a_message_that_is_cut_off_is_an_error(read, cut):
    whole = [scan_bytes(5, "laser", 0.5, 0.025, 3, 3, True), joint_bytes(5, "base", ("a", "spin_joint"), 1.0, True)]
    with pytest.raises((ValueError, struct.error, IndexError, SerdeError)):
        list(read([whole[read is joints_in][:cut]]))
