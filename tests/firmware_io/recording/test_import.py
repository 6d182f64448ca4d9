"""Other people's bags become recordings: every kind of bag, every clock, and one clear line for what cannot be."""

import os
import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.poses.pose_files import load_trajectory
from scanwright.firmware_io.recording.importer import import_bag
from scanwright.firmware_io.recording.recording import open_recording

DATA = os.environ.get("SCANWRIGHT_DATA")
needs_data = pytest.mark.skipif(DATA is None, reason="SCANWRIGHT_DATA names no folder with the real recordings")
SLICE = "tilt/msg/Slice"
SECOND = 1_000_000_000
START = 1_436_377_047 * SECOND


@pytest.fixture(params=["ros1", "sqlite3", "mcap"])
def kind(request):
    return request.param


class BagMaker:
    """Writes bags of any kind, with a custom type that holds a scan and an angle."""

    def __init__(self, path, kind):
        self.path = path / ("in.bag" if kind == "ros1" else "in")
        self.store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_JAZZY)
        self.store.register(get_types_from_msg("sensor_msgs/LaserScan laserScan\nfloat64 stepAngle\n", SLICE))
        if kind == "ros1":
            self.writer, self.serialize = Writer1(self.path), self.store.serialize_ros1
        else:
            plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            self.writer, self.serialize = Writer2(self.path, version=8, storage_plugin=plugin), self.store.serialize_cdr
        self.connections = {}
        self.finished = False

    def __enter__(self):
        self.writer.open()
        return self

    def __exit__(self, *_):
        self.finish()

    def finish(self):
        if not self.finished:
            self.finished = True
            self.writer.close()

    def make(self, message_type, /, **fields):
        cls = self.store.types[message_type]
        if message_type == "std_msgs/msg/Header" and "seq" in cls.__dataclass_fields__:
            fields["seq"] = 0
        return cls(**fields)

    def header(self, stamp_ns):
        stamp = self.make("builtin_interfaces/msg/Time", sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id="x")

    def scan(self, stamp_ns, ranges=(1.0, 2.0, 3.0), time_increment=0.0, range_max=5.0, angle_min=-0.5):
        return self.make(
            "sensor_msgs/msg/LaserScan",
            header=self.header(stamp_ns),
            angle_min=angle_min,
            angle_max=0.5,
            angle_increment=0.5,
            time_increment=time_increment,
            scan_time=0.1,
            range_min=0.5,
            range_max=range_max,
            ranges=np.array(ranges, np.float32),
            intensities=np.empty(0, np.float32),
        )

    def joint(self, stamp_ns, *positions):
        names = ["a", "b", "c"][: len(positions)]
        empty = np.empty(0)
        return self.make(
            "sensor_msgs/msg/JointState",
            header=self.header(stamp_ns),
            name=names,
            position=np.array(positions, float),
            velocity=empty,
            effort=empty,
        )

    def add(self, topic, message, receive_ns):
        name = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, name, typestore=self.store)
        self.writer.write(self.connections[topic], receive_ns, self.serialize(message, name))


@pytest.fixture
def bag(tmp_path, kind):
    with BagMaker(tmp_path, kind) as maker:
        yield maker


@pytest.fixture
def ros1(tmp_path):
    with BagMaker(tmp_path, "ros1") as maker:
        yield maker


def imported(maker, tmp_path, scan="/scan", angle="/joint", angle_unit="rad", hold=False, also=()):
    maker.finish()
    out = tmp_path / "out.mcap"
    summary = import_bag(maker.path, out, scan=scan, angle=angle, angle_unit=angle_unit, hold=hold, also=also)
    return summary, open_recording(out)


def test_a_custom_message_with_scan_and_angle_held(bag, tmp_path):
    for k in range(4):
        scan = bag.scan(START + k * SECOND, time_increment=0.125)
        bag.add("/slice", bag.make(SLICE, laserScan=scan, stepAngle=10.0 * k), START + k * SECOND + 5)
    summary, recording = imported(bag, tmp_path, "/slice:laserScan", "/slice:stepAngle", "deg", hold=True)
    assert (summary.scans, summary.beams, summary.joint_samples, summary.left_out) == (4, 12, 8, {})
    for k, scan in enumerate(recording.scans()):
        assert scan.stamp_ns == START + k * SECOND
        assert np.degrees(recording.joint_log.angle_at(scan.time_ns)) == pytest.approx([10 * k] * 3)


def test_joint_states_in_between_are_interpolated_and_unwrapped(bag, tmp_path):
    for k in range(20):
        angle = (k + np.pi) % (2 * np.pi) - np.pi
        bag.add("/joint", bag.joint(START + k * SECOND, 99.0, angle), START + k * SECOND)
        bag.add("/scan", bag.scan(START + k * SECOND + SECOND // 2), START + k * SECOND + SECOND // 2)
    summary, recording = imported(bag, tmp_path, angle="/joint:position[1]")
    found = [recording.joint_log.angle_at(scan.time_ns)[0] for scan in recording.scans()]
    assert found[:-1] == pytest.approx(np.arange(19) + 0.5)
    assert np.isnan(found[-1])
    assert "1 scans begin before the first or after the last angle" in "".join(summary.warnings)


def test_without_a_field_a_joint_state_means_its_first_position(bag, tmp_path):
    for k in range(2):
        bag.add("/joint", bag.joint(START + k * SECOND, 1.5 * k), START + k * SECOND)
    bag.add("/scan", bag.scan(START), START)
    _, recording = imported(bag, tmp_path)
    assert recording.joint_log.position_rad.tolist() == [0.0, 1.5]


def test_degrees_that_jump_at_180_are_unwrapped(bag, tmp_path):
    for k in range(10):
        value = bag.make("std_msgs/msg/Float64", data=float((100 * k + 180) % 360 - 180) + 0.5)
        bag.add("/deg", value, START + k * SECOND)
    bag.add("/scan", bag.scan(START), START)
    _, recording = imported(bag, tmp_path, angle="/deg:data", angle_unit="deg")
    np.testing.assert_allclose(np.degrees(recording.joint_log.position_rad), 100 * np.arange(10) + 0.5)


def test_topics_that_shall_come_along_do(bag, tmp_path):
    def odometry(k):
        at = bag.make("geometry_msgs/msg/Point", x=float(k), y=2.0, z=3.0)
        level = bag.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        pose = bag.make("geometry_msgs/msg/Pose", position=at, orientation=level)
        return bag.make("geometry_msgs/msg/PoseStamped", header=bag.header(START + k * SECOND), pose=pose)

    for k in range(3):
        bag.add("/scan", bag.scan(START + k * SECOND), START + k * SECOND)
        bag.add("/pose", odometry(k), START + k * SECOND)
        bag.add("/joint", bag.joint(START + k * SECOND, 0.1 * k), START + k * SECOND)
        bag.add("/own", bag.make(SLICE, laserScan=bag.scan(START), stepAngle=1.0), START + k * SECOND)
    recording = imported(bag, tmp_path, also=["/pose"])[1].path
    poses = load_trajectory("/pose", recording)
    assert poses.time_ns.tolist() == [START + k * SECOND for k in range(3)]
    np.testing.assert_array_equal(poses.position_m, [[0, 2, 3], [1, 2, 3], [2, 2, 3]])
    for also, says in (
        ("/scan", "already has a topic of this name"),
        ("/odom", "no topic '/odom'"),
        ("/own", "no type that comes"),
    ):
        with pytest.raises(RecordingError, match=says):
            import_to(bag.path, tmp_path / "no.mcap", also=[also], scan="/scan", angle="/joint", angle_unit="rad")


def add_float_angles(bag, count=5):
    for k in range(count):
        bag.add("/deg", bag.make("std_msgs/msg/Float64", data=0.5 + k), START + k * SECOND)


def test_unstamped_angles_take_the_receive_time_and_scans_keep_their_stamps_on_the_same_clock(bag, tmp_path):
    add_float_angles(bag)
    bag.add("/scan", bag.scan(START + SECOND), START + SECOND + 80_000_000)
    summary, recording = imported(bag, tmp_path, angle="/deg")
    assert next(recording.scans()).stamp_ns == START + SECOND
    assert recording.joint_log.time_ns[0] == START
    assert "angles carry no stamp" in summary.warnings[0]


@pytest.mark.parametrize("stamp_ns", [0, 168 * SECOND])
def test_scans_of_another_clock_and_unstamped_angles_all_take_the_receive_time(bag, tmp_path, stamp_ns):
    add_float_angles(bag)
    bag.add("/scan", bag.scan(stamp_ns), START + SECOND)
    summary, recording = imported(bag, tmp_path, angle="/deg")
    assert next(recording.scans()).stamp_ns == START + SECOND
    assert "both take the time they were received" in summary.warnings[0]


def test_stamps_of_two_clocks_all_take_the_receive_time(bag, tmp_path):
    for k in range(3):
        bag.add("/joint", bag.joint(START + k * SECOND, 1.5 * k), START + k * SECOND)
        bag.add("/scan", bag.scan((7 + k) * SECOND), START + k * SECOND)
    summary, recording = imported(bag, tmp_path)
    assert next(recording.scans()).stamp_ns == START
    assert "no time in common" in summary.warnings[0]


def test_what_is_no_scan_or_no_angle_is_counted(ros1, tmp_path):
    for k in range(5):
        ros1.add("/joint", ros1.joint(START + k * SECOND, np.nan if k == 2 else k + 0.5), START + k * SECOND)
    ros1.add("/joint", ros1.joint(START, 77.0), START + 5 * SECOND)
    ros1.add("/scan", ros1.scan(START, ranges=()), START)
    ros1.add("/scan", ros1.scan(START + 1, angle_min=np.nan), START)
    ros1.add("/scan", ros1.scan(START + 2, time_increment=-1.0), START)
    ros1.add("/scan", ros1.scan(START + 3, ranges=[1.0], range_max=0.0), START)
    ros1.add("/scan", ros1.scan(START + 3), START)
    summary, recording = imported(ros1, tmp_path)
    assert summary.left_out == {
        "angle_not_a_number": 1,
        "angle_at_the_time_of_another": 1,
        "empty_scan": 1,
        "scan_without_bearings": 1,
        "scan_with_impossible_time_increment": 1,
    }
    assert [scan.range_max_m for scan in recording.scans()] == [np.inf, 5.0]
    said = "\n".join(summary.warnings)
    for words in ("1 scans have no beam", "1 to 3 beams", "time increment is 0", "not later than", "range_max"):
        assert words in said


def test_a_held_scan_that_outlasts_the_next_is_cut_short_and_told(ros1, tmp_path):
    for k in range(3):
        scan = ros1.scan(START + k * SECOND, time_increment=0.75)
        ros1.add("/slice", ros1.make(SLICE, laserScan=scan, stepAngle=10.5 * k), START + k * SECOND)
    summary, recording = imported(ros1, tmp_path, "/slice:laserScan", "/slice:stepAngle", "deg", hold=True)
    assert "2 scans end after the next one begins" in "".join(summary.warnings)
    assert np.degrees(recording.joint_log.angle_at(np.array([START + 999_999_999]))) == pytest.approx(0.0)


def test_held_angles_of_another_topic_are_the_last_ones_said(ros1, tmp_path):
    add_float_angles(ros1)
    for tenths in (-5, 4, 14, 39, 45):
        scan = ros1.scan(START + tenths * SECOND // 10, time_increment=0.01)
        ros1.add("/scan", scan, START + tenths * SECOND // 10)
    summary, recording = imported(ros1, tmp_path, angle="/deg", angle_unit="deg", hold=True)
    found = [np.degrees(recording.joint_log.angle_at(scan.time_ns)).tolist() for scan in recording.scans()]
    np.testing.assert_allclose(found[1:4], [[0.5] * 3, [1.5] * 3, [3.5] * 3])
    assert np.isnan([found[0], found[4]]).all()
    assert summary.joint_samples == 6


def slices(bag):
    for k in range(3):
        scan = bag.scan(START + k * SECOND)
        bag.add("/slice", bag.make(SLICE, laserScan=scan, stepAngle=0.5 * k), START + k * SECOND)
    bag.add("/joint", bag.joint(START, 0.5, 1.5), START)
    bag.add("/early", bag.joint(5 * SECOND, 0.5), 5 * SECOND)
    bag.add("/text", bag.make("std_msgs/msg/String", data="hello"), START)
    bag.add("/scan", bag.scan(START + SECOND), START + SECOND)


WRONG_SOURCES = {
    ("/slic:laserScan", "/joint"): r"no topic '/slic'; did you mean '/slice'\?",
    ("/nothing", "/joint"): "no topic '/nothing'",
    ("/slice:laserScn", "/joint"): r"/slice: no field 'laserScn' in tilt/msg/Slice; did you mean 'laserScan'\?",
    ("/slice", "/joint"): r"/slice is tilt/msg/Slice, not a LaserScan; did you mean '/slice:laserScan'\?",
    ("/text", "/joint:a"): "/text is std_msgs/msg/String, not a LaserScan",
    ("/slice:laserScan", "/slice:angle"): r"no field 'angle' in tilt/msg/Slice; did you mean 'stepAngle'\?",
    ("/slice:laserScan", "/slice"): r"/slice is tilt/msg/Slice, not a number; did you mean '/slice:stepAngle'\?",
    ("/slice:laserScan", "/joint:position"): r"is a sequence of 2, not a number; name one number in it",
    ("/slice:laserScan", "/joint:position[2]"): r"no position\[2\]: 'position' holds 2 values",
    ("/slice:laserScan", "/joint:velocity[0]"): r"no velocity\[0\]: 'velocity' holds 0 values",
    ("/slice:laserScan", "/slice:stepAngle[0]"): r"no stepAngle\[0\]: 'stepAngle' is a float",
    ("/slice:laserScan", "/text"): "is a str, not a number",
    ("/slice:laserScan", "/joint:position[x]"): "is not a path of fields",
    ("", "/joint"): "write TOPIC or TOPIC:FIELD",
}


@pytest.mark.parametrize("sources", WRONG_SOURCES)
def test_a_wrong_topic_or_field_is_one_line_that_helps(ros1, tmp_path, sources):
    slices(ros1)
    with pytest.raises(RecordingError, match=WRONG_SOURCES[sources]) as caught:
        imported(ros1, tmp_path, *sources)
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["in.bag"]


def test_scans_and_angles_of_different_days_are_refused(ros1, tmp_path):
    slices(ros1)
    with pytest.raises(RecordingError, match="no scan falls into the time of the angles"):
        imported(ros1, tmp_path, "/scan", "/early")


def test_an_angle_without_a_usable_value_is_refused(ros1, tmp_path):
    ros1.add("/joint", ros1.joint(START, np.nan), START)
    ros1.add("/scan", ros1.scan(START), START)
    with pytest.raises(RecordingError, match="/joint: nothing usable: 1 angle_not_a_number"):
        imported(ros1, tmp_path)


def test_without_topics_the_command_names_those_of_the_bag(ros1, command, tmp_path):
    slices(ros1)
    ros1.finish()
    code, out, (complaint,) = command("import", ros1.path, "--angle", "/a", "-o", tmp_path / "r.mcap")
    assert code == 2 and complaint.startswith("error: missing --scan: ")
    listed = {line.split()[0]: line for line in out.splitlines()}
    assert "tilt/msg/Slice" in listed["/slice"]
    assert listed["/slice"].endswith(" --scan /slice:laserScan or --angle /slice:stepAngle")


def test_a_type_that_the_bag_does_not_define_is_told(tmp_path):
    with BagMaker(tmp_path, "sqlite3") as maker:
        slices(maker)
    database = sqlite3.connect(next(maker.path.glob("*.db3")))
    database.execute("DELETE FROM message_definitions")
    database.commit()
    database.close()
    with pytest.raises(RecordingError, match="does not hold the definition of tilt/msg/Slice"):
        import_bag(
            maker.path, tmp_path / "o.mcap", scan="/slice:laserScan", angle="/joint", angle_unit="rad", hold=False
        )


UNITS = {
    "wraps at 360": ("rad", lambda k: (k * 7.0 + 0.5) % 360, "a whole turn in deg: is the unit deg?"),
    "wraps at 2 pi": ("deg", lambda k: (k * 0.31) % (2 * np.pi), "a whole turn in rad: is the unit rad?"),
    "too fast": ("rad", lambda k: k * 20.5, "rpm, faster than any servo: is the unit deg?"),
    "to and fro over turns": (
        "rad",
        lambda k: 30 + 29.5 * np.sin(k / 40),
        "to and fro over 9.4 turns: is the unit deg?",
    ),
    "far out, a little back": ("rad", lambda k: 0.2 * min(k, 560 - k), "over 8.9 turns: is the unit deg?"),
    "on and on, not quite even": ("rad", lambda k: 0.3 * k + 0.4 * np.sin(k), ""),
    "hardly moves": ("deg", lambda k: np.sin(k / 30), "over 2 deg only: is the unit rad?"),
    "rad": ("rad", lambda k: (k * 0.05) % (2 * np.pi), ""),
    "deg": ("deg", lambda k: (k * 3.1 + 0.2) % 360, ""),
    "sweeps": ("deg", lambda k: 80.5 * np.sin(k / 40), ""),
}


@pytest.mark.parametrize("case", UNITS)
def test_what_speaks_for_the_other_unit_is_said(ros1, tmp_path, case):
    unit, angle, says = UNITS[case]
    for k in range(300):
        at_ns = START + k * SECOND // 20
        ros1.add("/joint", ros1.joint(at_ns, float(angle(k))), at_ns)
        ros1.add("/scan", ros1.scan(at_ns, time_increment=0.001), at_ns)
    summary, _ = imported(ros1, tmp_path, angle_unit=unit)
    about = [warning for warning in summary.warnings if "is the unit" in warning]
    assert len(about) == bool(says)
    assert says in "".join(about)


BAD_BAGS = {
    "none.bag": (None, "no such bag"),
    "empty.bag": (b"", "the file is empty"),
    "text.bag": (b"hello", "not a ROS 1 bag"),
    "text.mcap": (b"hello" * 40, "unreadable bag"),
    "text.db3": (b"hello" * 40, "unreadable bag"),
    "scan.csv": (b"1,2", "not a bag: '.csv' is none of .bag, .mcap, .db3"),
    "folder": ("dir", "has a metadata.yaml, this one has none"),
}


def import_to(path, out, **more):
    arguments = {"scan": "/scan", "angle": "/a", "angle_unit": "deg", "hold": False, **more}
    return import_bag(path, out, **arguments)


@pytest.mark.parametrize("name", BAD_BAGS)
def test_an_unreadable_bag_is_one_line(tmp_path, name):
    content, says = BAD_BAGS[name]
    path = tmp_path / name
    if content == "dir":
        path.mkdir()
    elif content is not None:
        path.write_bytes(content)
    before = list(tmp_path.iterdir())
    with pytest.raises(RecordingError, match=says) as caught:
        import_to(path, tmp_path / "o.mcap")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == before


@pytest.mark.parametrize("kept", [0.1, 0.5, 0.9])
def test_a_bag_that_was_cut_off_is_one_line(tmp_path, kind, kept):
    with BagMaker(tmp_path, kind) as maker:
        slices(maker)
    path = maker.path if kind == "ros1" else next(p for p in maker.path.iterdir() if p.suffix != ".yaml")
    path.write_bytes(path.read_bytes()[: int(kept * path.stat().st_size)])
    with pytest.raises(RecordingError, match=r"(unreadable|damaged) bag") as caught:
        import_to(maker.path, tmp_path / "o.mcap", angle="/joint")
    assert str(caught.value).startswith(f"{maker.path}: ")
    assert not (tmp_path / "o.mcap").exists()


def test_wrong_arguments_are_one_line(ros1, tmp_path):
    slices(ros1)
    with pytest.raises(RecordingError, match=r"name it o\.mcap"):
        import_to(tmp_path / "in.bag", tmp_path / "o.bag")
    with pytest.raises(RecordingError, match="write deg or rad"):
        import_to(tmp_path / "in.bag", tmp_path / "o.mcap", angle_unit="grad")
    with pytest.raises(RecordingError, match="this is the bag itself"):
        import_to(tmp_path / "in.mcap", tmp_path / "in.mcap")


@needs_data
def test_the_servo_bag_is_taken_with_clear_words(tmp_path):
    bag = Path(DATA) / "tilting/servo_bag"
    summary = import_to(bag, tmp_path / "o.mcap", angle="/lidar_servo_angle")
    said = "\n".join(summary.warnings)
    assert (summary.scans, summary.joint_samples, summary.left_out) == (243, 1108, {"empty_scan": 33})
    for words in (
        "angles carry no stamp",
        "another clock",
        "whole number of degrees",
        "time increment is 0",
        "33 scans have no beam",
        "up to 1.80 s",
    ):
        assert words in said
    shutil.copy(bag / "subset_0.db3", tmp_path / "alone.db3")
    alone = import_to(tmp_path / "alone.db3", tmp_path / "p.mcap", angle="/lidar_servo_angle")
    assert alone.warnings == summary.warnings
