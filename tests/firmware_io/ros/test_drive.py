"""What the node is fed with, without ROS 2: recordings at their pace, devices that come and go, rows of points."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.firmware_io.rooms import FURNISHED, Setup, Truth, simulate, write
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import DeviceError, RecordingError
from scanwright.design.motion import Spin
from scanwright.firmware_io.assembly.streaming import Assembler
from scanwright.firmware_io.ros import drive as driving
from scanwright.firmware_io.ros.point_rows import POINT, point_rows
from scanwright.firmware_io.ros.replay import replay
from scanwright.firmware_io.samples import JointSample
from scanwright.firmware_io.scan.plan import ScanPlan

ANGLES = AngleSet(
    task="ros",
    angles_deg=Angles(alpha_rot=10, beta_rot=-30, alpha_laser=60, beta_laser=20),
    sensor="UTM-30LX",
    servo="MX-64R",
)


class Listener:
    """A watch that keeps what it is told, and when."""

    def __init__(self):
        self.now_s, self.told_of, self.lines = 0.0, [], []

    def wait_until(self, seconds):
        self.now_s = seconds

    def joint(self, time_ns, position_rad):
        self.told_of.append((self.now_s, JointSample(time_ns, position_rad)))

    def scan(self, scan):
        self.told_of.append((self.now_s, scan))

    def message(self, line):
        self.lines.append(line)


def test_a_recording_is_told_at_its_pace_and_a_scan_after_its_last_angle(tmp_path):
    simulated = simulate(FURNISHED, Setup(beams=20, sweeps=((90.0, 90.0),)), Truth())
    path = write(tmp_path / "r.mcap", simulated)
    listener = Listener()
    assert replay(path, listener, rate=2.0, wait_until=listener.wait_until) == (40, simulated.log.time_ns.size)
    begin_ns = int(simulated.log.time_ns[0])
    last_ns, scans = begin_ns, []
    for when_s, thing in listener.told_of:
        if isinstance(thing, JointSample):
            assert when_s == pytest.approx((thing.time_ns - begin_ns) / 2e9)
            last_ns = thing.time_ns
        else:
            assert 0 <= last_ns - thing.time_ns[-1] < 5_000_000  # angles come every 4 ms
            scans.append(thing.stamp_ns)
    assert scans == [scan.stamp_ns for scan in simulated.scans]
    (line,) = listener.lines  # 20 beams around are 19 steps: the checks of the import run here, too
    assert line.startswith("warning: the time increment is 0.95 times")
    with pytest.raises(RecordingError, match="rate = 0"):
        replay(path, listener, rate=0.0)


class Steered:
    """A watch of one who stops it, starts it anew with another period, and then ends it."""

    def __init__(self):
        self.running, self.period_s, self.story = False, 0.0, []

    def begin(self):
        self.story.append("begin")

    def failed(self, line):
        self.story.append(line)

    def wait(self, seconds):
        self.story.append(f"wait {seconds:g}")
        self.running = True

    def message(self, line):
        self.story.append(f"told {line}")


class Viewer:
    """A watch that keeps the lines that it is told."""

    def __init__(self):
        self.lines = []

    def message(self, line):
        self.lines.append(line)


def test_devices_that_fail_again_and_again_end_the_node(monkeypatch):
    steered, now_s = Steered(), [0.0]

    def acquire(*_):
        now_s[0] += 100.0 if len(steered.story) < 20 else 1.0
        raise DeviceError("the lidar is gone")

    monkeypatch.setattr(driving, "acquire", acquire)
    monkeypatch.setattr(driving, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    plan = ScanPlan(**dict.fromkeys(ScanPlan.__dataclass_fields__))
    with pytest.raises(DeviceError, match="the lidar is gone"):
        driving.drive(plan, steered, lambda _: None)
    assert 100 <= steered.story.count("begin") < 110


def test_devices_that_fail_are_tried_again_and_parameters_are_obeyed(monkeypatch, caplog):
    steered, viewer, motions, said = Steered(), Viewer(), [], []
    outcomes = iter([DeviceError("the lidar is gone"), driving.Interrupted(), KeyboardInterrupt()])

    def acquire(plan, _say, watch):
        watch.message(f"{plan.motion.period_s:g} s")
        motions.append(plan.motion.period_s)
        steered.period_s = 4.0
        raise next(outcomes)

    monkeypatch.setattr(driving, "acquire", acquire)
    names = dict.fromkeys(ScanPlan.__dataclass_fields__)
    plan = ScanPlan(**{**names, "angles": ANGLES, "motion": Spin(period_s=18.0), "turns": 1, "endless": True})
    with pytest.raises(KeyboardInterrupt):
        driving.drive(plan, steered, said.append, viewer)
    assert motions == [18.0, 4.0, 4.0]
    again = "the lidar is gone; trying again in 3 s"
    assert steered.story == [
        *("wait 1", "begin", "told 18 s", again, "wait 3"),
        *("begin", "told 4 s", "begin", "told 4 s"),
    ]
    assert viewer.lines == ["18 s", "4 s", "4 s"]
    assert said == ["stopped by a parameter"] and caplog.messages == [again]


def test_rows_of_points_are_packed_as_point_cloud_2_says():
    scan = simulate(FURNISHED, Setup(beams=20, sweeps=((90.0, 90.0),)), Truth()).scans[0]
    assembler = Assembler(ANGLES, smooth=False)
    assembler.push(JointSample(scan.stamp_ns - 10, 0.0))
    assembler.push(scan)
    (line,) = assembler.push(JointSample(int(scan.time_ns[-1]) + 10, 1.0))
    rows = point_rows(line)
    assert POINT.itemsize == 22 and len(rows) == 20
    raw = np.frombuffer(rows.tobytes(), np.uint8).reshape(20, 22)
    np.testing.assert_array_equal(raw[:, :12].copy().view("<f4"), line.points_m)
    np.testing.assert_array_equal(raw[:, 16:20].copy().view("<u4")[:, 0], scan.time_ns - scan.stamp_ns)
    np.testing.assert_array_equal(raw[:, 20:].copy().view("<u2")[:, 0], np.arange(20))
    assert np.isnan(rows["intensity"]).all()
