"""A gyro tells how the platform turned between two poses; simulated truth is the judge."""

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.poses.gyro import Gyro, oriented
from scanwright.firmware_io.poses.pose_files import imu_mount, load_gyro
from scanwright.firmware_io.poses.trajectory import Trajectory

START = 1_700_000_000_000_000_000
SECONDS = 10.0
MOUNT = Rotation.from_euler("xyz", [170, -5, 90], degrees=True)  # an IMU that hangs upside down
SWING = np.radians([[3.0, 2.0, 4.0], [0.8, 1.1, 0.5]])  # of a walking robot, and of its steps
BEAT_HZ = np.array([[0.9, 1.3, 0.4], [6.0, 7.1, 5.3]])


def attitude(seconds):
    """Truth: Euler angles that swing at different rates, in closed form."""
    angles = np.sum(SWING[:, None] * np.sin(2 * np.pi * BEAT_HZ[:, None] * seconds[None, :, None]), axis=0)
    return Rotation.from_euler("xyz", angles)


def rates(seconds, bias_rad_s=(0.0, 0.0, 0.0)):
    """Rates of the platform in the IMU's axes, by central differences a thousand times finer than a sample."""
    h = 1e-6
    turned = (attitude(seconds - h).inv() * attitude(seconds + h)).as_rotvec() / (2 * h)
    return MOUNT.inv().apply(turned) + np.asarray(bias_rad_s)


def poses(rate_hz=5.0):
    seconds = np.arange(0, SECONDS, 1 / rate_hz)
    position_m = np.stack([seconds, 0 * seconds, 0 * seconds], axis=1)
    return Trajectory(ns(seconds), position_m, attitude(seconds).as_quat(), "base")


def gyro(bias_rad_s=(0.01, -0.02, 0.005), rate_hz=400.0, noise_rad_s=0.0, keep=lambda seconds: seconds > -1):
    seconds = np.arange(-0.01, SECONDS, 1 / rate_hz) + 0.0004  # no sample at the time of a pose
    seconds = seconds[keep(seconds)]
    noise = noise_rad_s * np.random.default_rng(7).standard_normal((seconds.size, 3))
    return Gyro(ns(seconds), rates(seconds, bias_rad_s) + noise, "imu")


def ns(seconds):
    return START + np.round(np.asarray(seconds) * 1e9).astype(np.int64)


def error_deg(trajectory, begin_s=0.0, end_s=SECONDS - 0.3):
    seconds = np.linspace(begin_s, end_s, 5000)
    R = Rotation.from_matrix(trajectory.T_map_world(ns(seconds))[:, :3, :3])
    return np.degrees((R.inv() * attitude(seconds)).magnitude())


def test_a_shaking_platform_is_followed_between_its_poses():
    """5 Hz poses miss steps at 6 Hz by degrees; a gyro with bias and the noise of a cheap one follows them."""
    without = error_deg(poses())
    trajectory, said = oriented(poses(), gyro(noise_rad_s=np.radians(0.1)), MOUNT.as_matrix())
    with_gyro = error_deg(trajectory)
    assert without.max() > 2.5
    assert with_gyro.max() < 0.03
    assert "bias 1.3 deg/s" in said[0]


def test_poses_keep_their_place_and_their_orientation():
    trajectory, _ = oriented(poses(), gyro(), MOUNT.as_matrix())
    np.testing.assert_allclose(trajectory.T_map_world(poses().time_ns), poses().T_map_world(poses().time_ns), atol=1e-9)
    assert trajectory.measured is not None
    halfway = ns([1.1])
    np.testing.assert_allclose(trajectory.T_map_world(halfway)[0, :3, 3], [1.1, 0, 0], atol=1e-9)


def test_the_integral_converges_with_the_square_of_the_step():
    unbiased = [gyro((0, 0, 0), rate_hz) for rate_hz in (100.0, 200.0)]
    worst = [error_deg(oriented(poses(), each, MOUNT.as_matrix())[0]).max() for each in unbiased]
    assert 3.5 < worst[0] / worst[1] < 4.5


def test_where_the_gyro_is_silent_it_goes_on_as_without():
    hole = gyro(keep=lambda seconds: (seconds < 4.05) | (seconds > 4.95))
    trajectory, said = oriented(poses(), hole, MOUNT.as_matrix())
    assert "warning: 5 of 49 intervals between poses have no gyro rate" in said[1]
    assert error_deg(trajectory, 0, 4).max() < 0.03
    np.testing.assert_allclose(error_deg(trajectory, 4, 5), error_deg(poses(), 4, 5), atol=1e-6)


@pytest.mark.parametrize(
    ("wrong", "mount", "says"),
    [
        (lambda g: Gyro(g.time_ns + 10**12, g.rate_rad_s), MOUNT, "no two neighbouring poses with gyro between"),
        (lambda g: Gyro(g.time_ns[::100], g.rate_rad_s[::100]), MOUNT, "no denser than the poses"),
        (lambda g: Gyro(g.time_ns, np.degrees(g.rate_rad_s)), MOUNT, "times as fast: deg/s?"),
        (lambda g: g, Rotation.identity(), "its axes fit turned by roll 170, pitch -5, yaw 90 deg more"),
        (lambda g: Gyro(g.time_ns, np.roll(g.rate_rad_s, 700, axis=0)), MOUNT, "another platform, or another clock?"),
    ],
)
def test_a_gyro_that_does_not_fit_is_refused(wrong, mount, says):
    with pytest.raises(RecordingError, match=says.replace("?", r"\?")):
        oriented(poses(), wrong(gyro(bias_rad_s=(0, 0, 0))), mount.as_matrix())


def imu_file(path, frame="imu", covariance=0.0, *, static=True):
    """An MCAP file with an Imu topic, and the IMU's place on the platform in two steps."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]

    def header(time_ns, name):
        stamp = types["builtin_interfaces/msg/Time"](sec=int(time_ns // 10**9), nanosec=int(time_ns % 10**9))
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id=name)

    def imu(time_ns, rate):
        cov = np.full(9, covariance)
        return types["sensor_msgs/msg/Imu"](
            header=header(time_ns, frame),
            orientation=quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=cov,
            angular_velocity=vector(*rate.tolist()),
            angular_velocity_covariance=cov,
            linear_acceleration=vector(0.0, 0.0, 9.8),
            linear_acceleration_covariance=cov,
        )

    def placed(parent, child, R):
        x, y, z, w = R.as_quat().tolist()
        moved = types["geometry_msgs/msg/Transform"](vector(0.1, 0.0, 0.0), quaternion(x=x, y=y, z=z, w=w))
        return types["geometry_msgs/msg/TransformStamped"](header(START, parent), child, moved)

    tilt = Rotation.from_euler("x", 20, degrees=True)
    chain = [placed("base", "mast", tilt), placed("imu", "mast", MOUNT.inv() * tilt)]
    messages = [("/tf_static", "tf2_msgs/msg/TFMessage", START, types["tf2_msgs/msg/TFMessage"](chain))] * static
    told = gyro()
    messages += [
        ("/imu", "sensor_msgs/msg/Imu", int(when), imu(when, rate))
        for when, rate in zip(told.time_ns[:20], told.rate_rad_s[:20], strict=True)
    ]
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        channels = {}
        for topic, kind, when, message in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", writer.register_schema(kind, "ros2msg", b""))
            writer.add_message(channels[topic], when, bytes(store.serialize_cdr(message, kind)), when)
        writer.finish()
    return path


def test_rates_and_mount_are_read_from_the_recording(tmp_path):
    recording = imu_file(tmp_path / "r.mcap")
    read = load_gyro("/imu", recording)
    np.testing.assert_array_equal(read.time_ns, gyro().time_ns[:20])
    np.testing.assert_array_equal(read.rate_rad_s, gyro().rate_rad_s[:20])
    np.testing.assert_allclose(imu_mount(None, read, "base", recording), MOUNT.as_matrix(), atol=1e-12)
    np.testing.assert_array_equal(imu_mount(None, read, "imu", recording), np.eye(3))
    np.testing.assert_allclose(imu_mount((170, -5, 90), read, "", recording), MOUNT.as_matrix(), atol=1e-12)


@pytest.mark.parametrize(
    ("platform", "more", "says"),
    [
        ("", {}, "the frame that the poses are of has no name"),
        ("base", {"frame": ""}, "the IMU's frame has no name"),
        ("base", {"static": False}, "no frames of /tf_static join 'base'"),
        ("body", {}, "no frames of /tf_static join 'body'"),
        ("base", {"covariance": -1.0}, "measures no rate of turn"),
    ],
)
def test_an_imu_that_does_not_say_how_it_stands_is_refused(tmp_path, platform, more, says):
    recording = imu_file(tmp_path / "r.mcap", **more)
    with pytest.raises(RecordingError, match=says):
        imu_mount(None, load_gyro("/imu", recording), platform, recording)


def test_a_table_of_rates_is_read_and_bad_lines_are_counted(tmp_path):
    table = tmp_path / "imu.csv"
    table.write_text(f"#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y,w_RS_S_z\n{START},1,2,3\n{START},4,5,6\n"
                     f"{START + 5},nan,0,0\n{START + 9},7,8,9\n")  # fmt: skip
    read = load_gyro(str(table), tmp_path / "none.mcap")
    assert read.time_ns.tolist() == [START, START + 9]
    assert read.rate_rad_s.tolist() == [[1, 2, 3], [7, 8, 9]]
    assert read.left_out == 2
