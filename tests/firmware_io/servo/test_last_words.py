"""What is said of a servo is what it answered: after Ctrl-C, a cut bus, an unplugged port, and before it was opened."""

import io
import math
import time
from types import SimpleNamespace

import pytest

from scanwright.design.angles import AngleSet
from scanwright.design.errors import DeviceError, DeviceTimeoutError
from scanwright.design.motion import Spin
from scanwright.firmware_io.emulators.servo.emulator import ServoEmulator
from scanwright.firmware_io.scan import acquire, axis_thread, lidar_scans
from scanwright.firmware_io.scan.axis_thread import turning_servo
from scanwright.firmware_io.scan.live_feed import Reporter
from scanwright.firmware_io.servo import guard
from scanwright.firmware_io.servo.progress import ServoState
from scanwright.firmware_io.servo.servo import open_servo

OFF = "servo 1 (MX-64R) has answered that its torque is off"
UNHEARD = "could not be stopped: cut its power"


@pytest.mark.parametrize("cut", [False, True])
def test_ctrl_c_tells_what_the_servo_answered(cut):
    with ServoEmulator("MX-64R") as emulator:
        emulator.set_up(spins=True)
        with pytest.raises(KeyboardInterrupt) as caught, open_servo(emulator.port, servo_id=1) as servo:
            servo.spin(math.pi)
            if cut:
                emulator.cut()
            raise KeyboardInterrupt
        (note,) = caught.value.__notes__
        assert (UNHEARD if cut else OFF) in note
        assert emulator.memory[24] == cut


@pytest.mark.parametrize("cut", [False, True])
def test_ctrl_c_again_while_it_is_stopped_tells_it_too(cut, monkeypatch):
    def again(_):
        raise KeyboardInterrupt("again")

    with ServoEmulator("MX-64R") as emulator:
        emulator.set_up(spins=True)
        with pytest.raises(KeyboardInterrupt) as caught, open_servo(emulator.port, servo_id=1) as servo:
            servo.spin(math.pi)
            if cut:
                emulator.cut()
            monkeypatch.setattr(type(servo), "_stop", again)
            raise KeyboardInterrupt
        (note,) = caught.value.__notes__
        assert (UNHEARD if cut else OFF) in note
        assert emulator.memory[24] == cut


def test_a_neglected_servo_that_its_guard_cannot_reach_is_not_said_to_be_stopped():
    with ServoEmulator("MX-64R") as emulator:
        emulator.set_up(spins=True)
        servo = open_servo(emulator.port, servo_id=1)
        servo.spin(math.pi)
        emulator.cut()
        servo._guard._process.kill()  # as good as a guard that was not answered
        servo._guard._process.wait()
        servo._guard._sent_s = 0.0
        with pytest.raises(DeviceError, match="did not answer the order to stop: cut its power"):
            servo.read()
        with pytest.raises(DeviceError, match=UNHEARD):
            servo.close()
        assert emulator.memory[24] == 1


class Holding:
    """A servo for the thread: answers, or not, that it holds."""

    step_rad = 0.0015

    def __init__(self, hears):
        self.hears, self.held = hears, 0

    def spin(self, rate_rad_s):
        pass

    def hold(self):
        self.held += 1
        if not self.hears:
            raise DeviceTimeoutError("no answer")

    def read(self):
        return ServoState(time.monotonic_ns(), 0, 0.0, 1.0, 0.0, 12.0, 30.0)


@pytest.mark.parametrize("hears", [True, False])
def test_a_servo_is_said_to_hold_when_it_has_answered_so(hears):
    said = []

    class Away:
        parameters = SimpleNamespace(scan_period_s=0.025)

        def read(self):
            raise DeviceTimeoutError("lidar: nothing came")

        def reconnect(self, _):
            raise DeviceError("lidar did not come back")

    servo = Holding(hears)
    with turning_servo(servo, Spin(period_s=2.0)) as axis, pytest.raises(DeviceError, match="did not come back"):
        scans = lidar_scans.LidarScans(Away(), Reporter(watch=SimpleNamespace(message=said.append)))
        scans.axis = axis
        scans.next()
    assert servo.held >= 1
    assert ("the servo has answered that it holds" in said[0]) == hears
    assert ("the servo did not confirm that it stopped: check it, and cut its power" in said[0]) != hears


def test_a_servo_that_does_not_answer_at_all_is_not_waited_for_for_ever(monkeypatch):
    monkeypatch.setattr(axis_thread, "_STOP_REPLY_S", 0.0)
    assert not axis_thread.AxisThread(Spin(period_s=2.0), 0.0, 0.001).stop()


def test_ctrl_c_waits_for_the_thread_that_could_turn_the_servo_again():
    alive, joins = [True, True, False], []

    def join():
        joins.append(1)
        if len(joins) == 1:
            raise KeyboardInterrupt

    thread = SimpleNamespace(is_alive=lambda: alive.pop(0), join=join)
    with pytest.raises(KeyboardInterrupt):
        axis_thread._join(thread)
    assert len(joins) == 2


@pytest.mark.parametrize(
    ("interrupt", "says"),
    [
        (lambda *_: (_ for _ in ()).throw(KeyboardInterrupt), "the servo was not started"),
        (None, "state of the servo unknown: check it, and cut its power if it turns"),
    ],
)
def test_ctrl_c_before_the_servo_is_opened_claims_nothing_of_it(tmp_path, command, monkeypatch, interrupt, says):
    angles = {"task": "t", "angles_deg": {"alpha_rot": 0, "beta_rot": 0, "alpha_laser": 90, "beta_laser": 0}}
    angles |= {"sensor": "UTM-30LX", "servo": "MX-64R", "motion": {"mode": "spin", "period_s": 2.0}}
    (tmp_path / "angles.json").write_text(AngleSet.model_validate(angles).to_json())
    if interrupt is not None:
        monkeypatch.setattr(acquire, "open_lidar", interrupt)
    else:  # a third Ctrl-C, while the guard was waited for: nobody knows

        def nothing_known(*_):
            raise KeyboardInterrupt

        monkeypatch.setattr(acquire, "acquire", nothing_known)
    code, _, complaints = command("scan", tmp_path, "--lidar", "L", "--servo", "S")
    assert code == 130
    assert complaints == ["error: stopped", f"error: {says}"]


def test_the_guard_that_was_dismissed_is_told_nothing_more():
    watch = object.__new__(guard.Guard)
    watch._messages = io.BytesIO()
    watch._messages.close()
    assert not watch.turning()
