"""Platform poses: files and topics are read as their formats say, and between poses the motion is the textbook's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.poses.pose_files import load_trajectory
from scanwright.firmware_io.poses.trajectory import Trajectory

START = 1_436_377_047_737_469_125
TUM = """# timestamp tx ty tz qx qy qz qw
1436377047.737469125 1 2 3 0 0 0 1
1436377048.737469125 2 2 3 0 0 0.70710678 0.70710678
"""
EUROC = """#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []
1436377047737469125,1,2,3,1,0,0,0
1436377048737469125,2,2,3,0.70710678,0,0,0.70710678
"""
PLAIN = """time,x,y,z,qx,qy,qz,qw
1436377047.737469125,1,2,3,0,0,0,1

1436377048.737469125,2,2,3,0,0,0.70710678,0.70710678
"""


def assert_two_poses(trajectory):
    assert trajectory.time_ns.tolist() == [START, START + 10**9]
    np.testing.assert_allclose(trajectory.position_m, [[1, 2, 3], [2, 2, 3]])
    np.testing.assert_allclose(trajectory.quaternion, [[0, 0, 0, 1], [0, 0, np.sqrt(0.5), np.sqrt(0.5)]], atol=1e-8)


@pytest.mark.parametrize(("name", "text"), [("poses.txt", TUM), ("poses.tum", TUM), ("e.csv", EUROC), ("p.csv", PLAIN)])
def test_a_file_is_read_to_the_nanosecond(tmp_path, name, text):
    for encoding in ("utf-8", "utf-8-sig"):  # the latter with the mark of Windows' Notepad
        (tmp_path / name).write_text(text, encoding=encoding)
        assert_two_poses(load_trajectory(str(tmp_path / name), tmp_path / "none.mcap"))


def topic_file(path, topic, kind, messages):
    """An MCAP file of one topic, its messages made by rosbags."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        schema = writer.register_schema(kind, "ros2msg", b"")
        channel = writer.register_channel(topic, "cdr", schema)
        for k, message in enumerate(messages(store.types)):
            writer.add_message(channel, k, bytes(store.serialize_cdr(message, kind)), k)
        writer.finish()


def stamped(types, k, frame):
    stamp_ns = START + k * 10**9
    stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def rotation(types, k):
    half = k * np.pi / 4
    return types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=np.sin(half), w=np.cos(half))


def transform(types, k, parent, child):
    translation = types["geometry_msgs/msg/Vector3"](x=1.0 + k, y=2.0, z=3.0)
    moved = types["geometry_msgs/msg/Transform"](translation=translation, rotation=rotation(types, k))
    header = stamped(types, k, parent)
    return types["geometry_msgs/msg/TransformStamped"](header=header, child_frame_id=child, transform=moved)


def tf(*pairs):
    def messages(types):
        for k in range(2):
            yield types["tf2_msgs/msg/TFMessage"](transforms=[transform(types, k, *pair) for pair in pairs])

    return "/tf", "tf2_msgs/msg/TFMessage", messages


def odometry(types):
    for k in range(2):
        position = types["geometry_msgs/msg/Point"](x=1.0 + k, y=2.0, z=3.0)
        pose = types["geometry_msgs/msg/Pose"](position=position, orientation=rotation(types, k))
        zero = types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
        yield types["nav_msgs/msg/Odometry"](
            header=stamped(types, k, "odom"),
            child_frame_id="base_link",
            pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](
                twist=types["geometry_msgs/msg/Twist"](linear=zero, angular=zero), covariance=np.zeros(36)
            ),
        )


ODOMETRY = ("/odom", "nav_msgs/msg/Odometry", odometry)


@pytest.mark.parametrize(
    ("spec", "content"),
    [
        ("/odom", ODOMETRY),
        ("/odom:odom:base_link", ODOMETRY),
        ("/tf", tf(("odom", "base_link"))),
        ("/tf:odom:base_link", tf(("map", "odom"), ("/odom", "base_link"))),
    ],
)
def test_a_topic_of_the_recording_is_read(tmp_path, spec, content):
    topic_file(tmp_path / "r.mcap", *content)
    assert_two_poses(load_trajectory(spec, tmp_path / "r.mcap"))


@pytest.mark.parametrize(
    ("spec", "content", "says"),
    [
        ("/tf", tf(("map", "odom"), ("odom", "base")), "several frames; name one such as /tf:map:odom, /tf:odom:base"),
        ("/tf:odom:bas", tf(("map", "odom"), ("odom", "base")), "no pose odom:bas; did you mean 'odom:base'"),
        ("/tf:odom", tf(("odom", "base")), "write TOPIC or TOPIC:PARENT:CHILD"),
        ("/odo", ODOMETRY, "neither a file nor a topic of .* with poses; did you mean '/odom'"),
        ("/odom", ("/odom", "std_msgs/msg/Empty", lambda _: ()), "/odom is std_msgs/msg/Empty; poses are "),
    ],
)
def test_a_topic_without_the_poses_asked_for_is_one_line(tmp_path, spec, content, says):
    topic_file(tmp_path / "r.mcap", *content)
    with pytest.raises(RecordingError, match=says) as caught:
        load_trajectory(spec, tmp_path / "r.mcap")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("p.txt", "1 2 3\n", r"p.txt:1: 3 numbers; a TUM line is"),
        ("p.txt", TUM + "x 0 0 0 0 0 0 1\n", r"p.txt:4: not a line of numbers: x, 0"),
        ("p.txt", "nan 0 0 0 0 0 0 1\n", r"p.txt:1: not a line of numbers: nan"),
        ("p.txt", TUM.splitlines()[1], "1 poses: at least two"),
        ("p.txt", "", "0 poses: at least two"),
        ("p.txt", TUM + TUM, "pose 3: not later than the one before it"),
        ("p.txt", TUM + "1436377049 0 0 nan 0 0 0 1\n", "pose 3: not a finite number"),
        ("p.txt", TUM + "1436377049 0 0 0 0 0 1 1\n", r"pose 3: quaternion of length 1.414: 1; the order is qx qy qz"),
        ("p.csv", "time,x,y,z,qx,qy,qz\n", "0 columns for qw: the first line names one of orientation_w, q_rs_w"),
        ("p.csv", PLAIN + "1,2\n", "p.csv:5: 2 values, the header names 8"),
        ("p.csv", "", "0 columns for x"),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path, name, text, says):
    (tmp_path / name).write_text(text)
    with pytest.raises(RecordingError, match=says) as caught:
        load_trajectory(str(tmp_path / name), tmp_path / "none.mcap")
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


rotvecs = st.tuples(*[st.floats(-2, 2)] * 3)
places = st.tuples(*[st.floats(-50, 50)] * 3)


@settings(deadline=None)
@given(
    rotvec=rotvecs,
    step=st.tuples(*[st.floats(-1, 1)] * 3),
    begin=places,
    end=places,
    part=st.floats(0, 1),
    flip=st.sampled_from([1, -1]),
)
def test_between_two_poses_it_goes_straight_and_about_one_axis(rotvec, step, begin, end, part, flip):
    """`flip`: a quaternion and its negative are one orientation; the platform must not turn the long way round."""
    first = Rotation.from_rotvec(rotvec)
    second = first * Rotation.from_rotvec(step)
    quaternion = np.stack([first.as_quat(), flip * second.as_quat()])
    trajectory = Trajectory(START + np.array([0, 10**9]), np.array([begin, end]), quaternion)
    (T,) = trajectory.T_map_world(np.array([START + round(part * 1e9)]))
    np.testing.assert_allclose(T[:3, 3], np.array(begin) + part * (np.array(end) - begin), atol=1e-6)
    expected = first * Rotation.from_rotvec(part * np.array(step))
    np.testing.assert_allclose(T[:3, :3], expected.as_matrix(), atol=1e-7)


def test_outside_the_poses_nobody_knows():
    trajectory = Trajectory(START + np.array([0, 10]), np.zeros((2, 3)), np.array([[0, 0, 0, 1.0]] * 2))
    T = trajectory.T_map_world(START + np.array([-1, 0, 10, 11]))
    assert np.isnan(T).all(axis=(1, 2)).tolist() == [True, False, False, True]


@pytest.mark.parametrize("step_s", [0.02, 0.1])
def test_the_stated_error_is_the_true_one(step_s):
    def motion(t):
        return np.stack([np.sin(2 * t), 0 * t, 0 * t], axis=1), Rotation.from_euler("z", 0.3 * np.sin(3 * t)[:, None])

    time_s = np.arange(0, 10, step_s)
    position, attitude = motion(time_s)
    trajectory = Trajectory(START + np.rint(time_s * 1e9).astype(np.int64), position, attitude.as_quat())
    asked_s = np.linspace(0, time_s[-1], 5000)
    T = trajectory.T_map_world(START + (asked_s * 1e9).astype(np.int64))
    true_m, true_attitude = motion(asked_s)
    off_m = np.linalg.norm(T[:, :3, 3] - true_m, axis=1).max()
    off_rad = (Rotation.from_matrix(T[:, :3, :3]).inv() * true_attitude).magnitude().max()
    np.testing.assert_allclose(trajectory.error(), (off_m, off_rad), rtol=0.1)
