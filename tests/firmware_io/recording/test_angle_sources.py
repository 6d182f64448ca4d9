"""The angle of somebody's axis out of frames, joints by name and tables."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.recording.angle_sources import FrameSource, is_table, parse_frames, read_table, turned_rad
from scanwright.firmware_io.recording.importer import import_bag
from scanwright.firmware_io.recording.recording import open_recording

SECOND = 1_000_000_000
START = 1_436_377_047 * SECOND
FRAMES = FrameSource("/tf", "base", "laser")
TF = "tf2_msgs/msg/TFMessage"


def unit(seed):
    axis = np.random.default_rng(seed).normal(size=3)
    return axis / np.linalg.norm(axis)


@given(st.integers(0, 10_000), st.floats(-3, 3), st.floats(0.05, 30))
def test_an_axis_through_the_parent_gives_its_angles_and_another_one_their_differences(seed, begins, span):
    axis = unit(seed)
    axis *= np.sign(axis[np.argmax(abs(axis))])
    wanted = begins + span * np.linspace(0, 1, 400)
    turning = Rotation.from_rotvec(wanted[:, None] * axis)
    angle, said = turned_rad(turning.as_quat(), FRAMES)
    np.testing.assert_allclose(np.exp(1j * angle), np.exp(1j * wanted), atol=1e-9)
    assert said == ""
    tilted, said = turned_rad((Rotation.from_rotvec(0.4 * np.cross(axis, unit(seed + 1))) * turning).as_quat(), FRAMES)
    np.testing.assert_allclose(np.diff(np.unwrap(tilted)), np.diff(wanted), atol=1e-9)
    assert tilted[0] == pytest.approx(0, abs=1e-9) or said == ""


def test_quaternions_that_change_their_sign_mean_the_same():
    wanted = np.linspace(0, 12, 300)
    quaternions = Rotation.from_euler("z", wanted[:, None]).as_quat() * np.where(np.arange(300) % 2, 1, -1)[:, None]
    angle, _ = turned_rad(quaternions, FRAMES)
    np.testing.assert_allclose(np.exp(1j * angle), np.exp(1j * wanted), atol=1e-9)


@pytest.mark.parametrize(
    ("angles", "says"),
    [
        (np.zeros((50, 3)), "the frames do not turn against each other"),
        (np.column_stack([np.linspace(0, 3, 50), np.linspace(0, 0.1, 50), np.zeros(50)]), "more than one axis"),
    ],
)
def test_what_is_no_axis_is_refused(angles, says):
    with pytest.raises(RecordingError, match=says):
        turned_rad(Rotation.from_euler("zyx", angles).as_quat(), FRAMES)


def test_what_is_asked_for_is_told_apart():
    assert parse_frames("/tf:base:laser") == FRAMES and str(FRAMES) == "/tf:base:laser"
    assert parse_frames("/servo:angle") is parse_frames("/tf::laser") is None
    assert is_table("log.csv") and is_table("a/log.csv:axis_deg") and not is_table("/servo:position")


@pytest.mark.parametrize("words", ["time_s,angle_deg", "# time_s, note, angle_deg", "time_ns,angle"])
def test_a_table_keeps_every_nanosecond(tmp_path, words):
    rows = [(START + 7 * k + 1, 1.5 * k) for k in range(5)]
    lines = [words]
    for time_ns, angle in rows:
        when = str(time_ns) if "ns" in words else f"{time_ns // SECOND}.{time_ns % SECOND:09d}"
        lines.append(",".join([when, *(["x"] if "note" in words else []), repr(angle)]))
    (tmp_path / "log.csv").write_text("\n".join([*lines, "", ""]), encoding="utf-8-sig")
    time_ns, angle = read_table(str(tmp_path / "log.csv"))
    assert list(zip(time_ns.tolist(), angle.tolist(), strict=True)) == rows


@pytest.mark.parametrize(
    ("text", "column", "says"),
    [
        ("time_s,angle\n", "", "no line with an angle"),
        ("time_s,angle\n1,2\nx,3\n", "", r"log\.csv:3: not a line of numbers: x, 3"),
        ("time_s,angle\n1,2\n2,NaN\n", "", r"log\.csv: row 2: an angle of at most 1e\+09"),
        ("time_ns,angle\n99999999999999999999,2\n", "", r"log\.csv:2: time 99999999999999999999: .* nanoseconds"),
        ("time_s,angle\n1\n", "", r"log\.csv:2: 1 values, the header names 2"),
        ("when,angle\n1,2\n", "", "0 columns for time: the first line names one of"),
        ("time_s,angle,angle_rad\n1,2,3\n", "", "2 columns for angle"),
        ("time_s,pan_deg\n1,2\n", ":pan", "0 columns for angle: the first line names pan; did you mean 'pan_deg'"),
        ("", "", "0 columns for angle"),
    ],
)
def test_a_table_that_is_none_is_one_line(tmp_path, text, column, says):
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(RecordingError, match=says):
        read_table(f"{tmp_path / 'log.csv'}{column}")


@pytest.fixture
def bag(tmp_path):
    """Scans at ten hertz; the axis at 50 as a transform beside another one, and as the second of two joints."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TF))
    types = store.types

    def header(time_ns, frame):
        stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // SECOND, nanosec=time_ns % SECOND)
        return types["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id=frame)

    def transform(time_ns, parent, child, turned):
        x, y, z, w = Rotation.from_euler("z", turned).as_quat()
        pose = types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.1),
            rotation=types["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w),
        )
        return types["geometry_msgs/msg/TransformStamped"](
            header=header(time_ns, parent), child_frame_id=child, transform=pose
        )

    with Writer(tmp_path / "in.bag") as writer:
        topics = {
            name: writer.add_connection(name, kind, typestore=store)
            for name, kind in (
                ("/tf", TF),
                ("/scan", "sensor_msgs/msg/LaserScan"),
                ("/joints", "sensor_msgs/msg/JointState"),
            )
        }

        def write(topic, time_ns, message):
            writer.write(topics[topic], time_ns, store.serialize_ros1(message, message.__msgtype__))

        for k in range(200):
            now, angle = START + k * 20_000_000, 0.3 + 0.05 * k
            other = transform(now, "map", "base", 1.0)
            write("/tf", now, types[TF](transforms=[other, transform(now, "/base", "laser", angle)]))
            joints = types["sensor_msgs/msg/JointState"](
                header=header(now, ""),
                name=["wheel", "pan_joint"],
                position=np.array([9.0, angle]),
                velocity=np.empty(0),
                effort=np.empty(0),
            )
            write("/joints", now, joints)
            if k % 5 == 2:
                scan = types["sensor_msgs/msg/LaserScan"](
                    header=header(now + 1_000_000, "laser"),
                    angle_min=-0.5,
                    angle_max=0.5,
                    angle_increment=0.5,
                    time_increment=0.05 / (2 * np.pi),
                    scan_time=0.1,
                    range_min=0.1,
                    range_max=9.0,
                    ranges=np.array([0.5, 1.0, 2 + k / 100], np.float32),
                    intensities=np.empty(0, np.float32),
                )
                write("/scan", now + 18_000_000, scan)
    return tmp_path / "in.bag"


@pytest.mark.parametrize("source", ["/tf:base:laser", "/joints:pan_joint", "/joints:position[1]", "TABLE"])
def test_every_source_gives_the_same_log(bag, tmp_path, source):
    if source == "TABLE":
        rows = [f"{(START + k * 20_000_000) / SECOND:.9f},{math.degrees(0.3 + 0.05 * k)!r}" for k in range(200)]
        (tmp_path / "log.csv").write_text("\n".join(["time_s,pan_deg", *rows]))
        source = f"{tmp_path / 'log.csv'}:pan_deg"
    unit = None if ":base:" in source else "deg" if "csv" in source else "rad"
    out = tmp_path / "out.mcap"
    summary = import_bag(bag, out, scan="/scan", angle=source, angle_unit=unit, hold=False)
    log = open_recording(out).joint_log
    np.testing.assert_allclose(log.position_rad, 0.3 + 0.05 * np.arange(200), atol=1e-9)
    assert np.abs(log.time_ns - (START + 20_000_000 * np.arange(200))).max() < 300
    assert (summary.scans, summary.warnings) == (40, ())


@pytest.mark.parametrize(
    ("scan", "angle", "unit", "says"),
    [
        ("/scam", "/joint:a", "rad", "no topic '/joint'; did you mean '/joints'.; no topic '/scam'; did you"),
        ("/scan", "/joints:pan_joynt", "rad", r"/joints: no joint 'pan_joynt'; did you mean 'pan_joint'"),
        ("/scan", "/tf:base:lasr", None, r"/tf:base:lasr: nothing usable: it has no such message"),
        ("/scan", "/joints:base:laser", None, r"/joints holds no transforms"),
        ("/scan", "/joints:wheel", None, "angle_unit: write deg or rad"),
        ("/scan", "/joints", "rad", "joints wheel, pan_joint: name one, such as /joints:pan_joint"),
        ("/scan", "absent.csv", "deg", r"absent\.csv: cannot read: No such file"),
    ],
)
def test_what_is_not_there_is_one_line(bag, tmp_path, scan, angle, unit, says):
    with pytest.raises(RecordingError, match=says):
        import_bag(bag, tmp_path / "out.mcap", scan=scan, angle=angle, angle_unit=unit, hold=False)
    assert not (tmp_path / "out.mcap").exists()
