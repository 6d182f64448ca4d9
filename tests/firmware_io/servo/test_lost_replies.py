"""A servo behind a bad cable: what it costs is counted, and a goal that comes late leaves no torque on."""

import itertools
from pathlib import Path

import pytest

from scanwright.design.errors import DeviceError, UnsafeError
from scanwright.firmware_io.scan.scan_end import ScanSummary
from scanwright.firmware_io.servo import guard, servo
from scanwright.firmware_io.servo.servo import open_servo

GOAL_BYTES = bytes.fromhex("ff ff 01 05 03 2a 00 08 c4")  # of an STS3215: 2048


@pytest.fixture(autouse=True)
def no_guard(monkeypatch):
    """A virtual port cannot be inherited by a process."""
    monkeypatch.setattr(guard.Guard, "__init__", lambda *_: None)
    for name in ("turning", "resting", "beat"):
        monkeypatch.setattr(guard.Guard, name, lambda _: True)
    monkeypatch.setattr(guard.Guard, "dismiss", lambda _, at_rest: at_rest)


@pytest.fixture
def opened(virtual_bus, monkeypatch):
    def open_one(model):
        bus = virtual_bus(model)
        bus.fileno = lambda: 0
        with monkeypatch.context() as prepared:
            prepared.setattr(servo, "prepare", lambda *_, **__: ())
            return bus, open_servo(bus.port, model)

    return open_one


@pytest.mark.parametrize("model", ["MX-64R", "STS3215"])
def test_every_damaged_or_missing_answer_is_counted(model, opened):
    bus, driver = opened(model)
    write, every = bus.write, itertools.count(1)

    def damaging(data):
        write(data)
        match next(every) % 6:
            case 0:
                bus._coming.clear()
            case 3 if bus._coming:
                at_ns, byte = bus._coming.pop()
                bus._coming.append((at_ns, byte ^ 4))

    before = driver.lost_replies
    bus.write = damaging
    for _ in range(24):
        driver.read()
    bus.write = write
    assert driver.lost_replies - before == (next(every) - 1) // 3  # which is each third request
    driver.close()


def test_a_late_goal_turns_the_torque_on_and_is_noticed(opened):
    bus, driver = opened("STS3215")
    driver.sweep_to(0.1, 0.5)
    write, late = bus.write, [GOAL_BYTES]

    def with_late_goal(data):
        write(data)
        if late and data[4:7] == b"\x03\x28\x00":  # the torque was taken
            coming = list(bus._coming)
            write(late.pop())
            bus._coming.clear()
            bus._coming.extend(coming)

    bus.write = with_late_goal
    driver.close()
    assert not late and bus.memory[40] == 0


def test_torque_that_stays_on_is_an_error(opened):
    bus, driver = opened("STS3215")
    write = bus.write

    def stuck(data):
        write(data)
        bus.memory[40] = 1

    bus.write = stuck
    with pytest.raises(DeviceError, match="its torque stays on: cut its power"):
        driver.release()
    with pytest.raises(UnsafeError, match="its torque stays on: cut its power"):
        driver.close()  # the watchdog's packet is the same, and has no more effect


def test_the_examples_of_the_maker_move_a_horn_without_writing_its_torque(virtual_bus):
    bus = virtual_bus("STS3215")
    bus.baudrate = 1_000_000
    bus.write(bytes.fromhex("ff ff 01 05 03 2a b8 0b 09"))  # goal 3000, as `WritePos` sends it
    bus.sleep(3.0)
    assert abs(bus.servo.axis.motion(bus.now_ns).angle_rad) > 1.0


def test_the_summary_says_what_lost_replies_cost():
    values = {"recording": Path("r.mcap"), "scans": 9, "joint_samples": 1000, "duration_s": 9.0, "clock_ns": 1000}
    values |= {"speed_deg_s": 60.0, "ripple_deg": 0.1, "reconnects": 0, "left_out": {}}
    lines = ScanSummary(**values, lost_replies=111, longest_gap_s=1.01).lines()
    assert "lost servo replies: 111 (10.0%); longest gap between angles: 1.010 s, 60.6 deg" in lines
    assert not any("lost servo" in line for line in ScanSummary(**values).lines())
