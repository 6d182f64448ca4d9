"""The doctor on the emulators: it reads and nothing else; what `--fix` sets is named, kept, and set back."""

import fcntl
import json
import os
import re
import termios
import threading
import tty
from pathlib import Path
from types import SimpleNamespace

import pytest

from scanwright.design.angles import AngleSet
from scanwright.firmware_io import device_ports, serial_port
from scanwright.firmware_io.emulators.scanner import emulated_scanner
from scanwright.firmware_io.emulators.servo.dynamixel_packets import take
from scanwright.firmware_io.emulators.servo.emulator import ServoEmulator
from scanwright.firmware_io.emulators.world import room
from scanwright.firmware_io.scan import doctor
from scanwright.firmware_io.servo.families import all_tables

PING, READ, WRITE = 1, 2, 3


@pytest.fixture(autouse=True)
def nothing_is_plugged_in(monkeypatch, tmp_path):
    monkeypatch.setattr(device_ports.list_ports, "comports", lambda: [])
    monkeypatch.chdir(tmp_path)


def instructions(said, protocol):
    """The instructions in a stream, and the bytes that belong to no packet of either protocol."""
    buffer, found = bytearray(said), []
    while request := take(buffer, protocol):
        found.append(request.instruction)
    return found


def spoil(emulator):
    """Everything that the driver would set is otherwise; in counts, by address."""
    spoilt = {"1.0": {20: 500, 22: 2, 5: 200}, "2.0": {10: 1, 20: -500, 9: 200}, "STS": {31: 500, 30: 2, 7: 200}}
    for address, count in spoilt[table_of(emulator).protocol].items():
        emulator.memory[address] = count


def kept(emulator):
    """The settings of an emulator that outlast its power."""
    return bytes(emulator.memory.data[: table_of(emulator).ram])


def table_of(emulator):
    return emulator.servo.table


@pytest.mark.parametrize(
    ("model", "protocol"), [("MX-64R", "1.0"), ("XM430-W350", "2.0"), ("AX-12A", "1.0"), ("STS3215", "STS")]
)
def test_in_the_whole_dialogue_there_are_only_questions(model, protocol, command, virtual_bus):
    emulator = virtual_bus(model, protocol)
    if model != "AX-12A":
        spoil(emulator)
    torque = table_of(emulator).torque.address
    emulator.memory[torque] = 1  # somebody's arm hangs on it
    before = bytes(emulator.memory.data)
    code, said, _ = command("doctor", "--servo", emulator.port)
    assert bytes(emulator.memory.data[: len(kept(emulator)) + 2]) == before[: len(kept(emulator)) + 2]
    assert emulator.memory[torque] == 1
    delay = table_of(emulator).return_delay_ns
    assert set(instructions(emulator.heard, "1.0")) | set(instructions(emulator.heard, "2.0")) <= {PING, READ}
    frames = "2.0" if protocol == "2.0" else "1.0"  # the frames of the STS are those of 1.0
    assert READ in instructions(emulator.heard, frames)
    assert "has its torque on" in said
    assert code == 1  # there is no lidar
    if model != "AX-12A":
        assert f"{delay} is 200, so that its answers are" in said
        assert f"`scanwright servo-setup {emulator.port}` sets it" in said


def test_a_servo_that_answers_only_pings_is_not_told_to(command, virtual_bus):
    emulator = virtual_bus("MX-64R")
    emulator.memory[16] = 0
    _, said, _ = command("doctor", "--servo", emulator.port)
    assert emulator.memory[16] == 0
    assert set(instructions(emulator.heard, "1.0")) | set(instructions(emulator.heard, "2.0")) <= {PING, READ}
    assert "servo 1: status_return_level (register 16) is 0, so that it answers nothing but pings; 2 is right" in said
    assert f"`scanwright servo-setup {emulator.port}` sets it" in said


def test_where_something_speaks_first_nothing_is_said(command):
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    done = threading.Event()

    def speak():
        while not done.wait(0.01):
            os.write(master, b"$GPGGA,")

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        _, said, _ = command("doctor", "--servo", os.ttyname(slave))
    finally:
        done.set()
        speaker.join()
    with pytest.raises(BlockingIOError):  # nothing has come
        os.read(master, 1)
    os.close(master)
    os.close(slave)
    assert "bytes came before any request" in said and "nothing was sent" in said


@pytest.mark.parametrize(("model", "protocol"), [("MX-64R", "1.0"), ("XM430-W350", "2.0"), ("STS3215", "STS")])
def test_a_fix_is_told_kept_and_taken_back(model, protocol, command, tmp_path, virtual_bus):
    emulator = virtual_bus(model, protocol)
    spoil(emulator)
    before = kept(emulator)
    code, said, _ = command("doctor", "--fix", "--servo", emulator.port)
    (file,) = tmp_path.glob("servo-*.json")
    assert kept(emulator) != before
    assert f"`scanwright servo-setup {emulator.port} --undo {file.name}`" in said
    for setting in json.loads(file.read_text())["settings"]:
        name = rf"{setting['register']} \(register \d+\)"
        assert re.search(rf"servo 1: {name}: {setting['before']} -> {setting['after']}$", said, re.MULTILINE)
    assert "` sets it" not in said  # the examination after it finds nothing
    if protocol == "2.0":
        assert "protocol 2.0 at 1000000 baud" in said
    code, said, _ = command("doctor", "--restore", file)
    assert code == 0
    assert kept(emulator) == before
    assert "return_delay_time" in said and "0 -> 200" in said


def test_what_is_already_right_is_not_written(command, tmp_path, virtual_bus):
    emulator = virtual_bus("MX-64R")
    emulator.memory[5] = 0
    _, said, _ = command("doctor", "--fix", "--servo", emulator.port)
    assert "every setting is right" in said
    assert not list(tmp_path.glob("servo-*"))
    assert WRITE not in instructions(emulator.heard, "1.0")


@pytest.mark.parametrize("protocol", ["1.0", "2.0"])
def test_a_mute_servo_is_unmuted_by_a_fix_and_mute_again_after_the_restore(protocol, command, tmp_path, virtual_bus):
    level = 16 if protocol == "1.0" else 68
    emulator = virtual_bus("MX-64R", protocol)
    emulator.memory[level] = 0
    _, said, _ = command("doctor", "--fix", "--servo", emulator.port)
    assert emulator.memory[level] == 2
    assert f"status_return_level (register {level}): 0 -> 2" in said
    (file,) = tmp_path.glob("servo-*.json")
    code, said, _ = command("doctor", "--restore", file)
    assert code == 0
    assert emulator.memory[level] == 0
    assert "2 -> 0; it was not read back" in said


def test_a_fix_takes_nobodys_torque_and_guesses_no_port(command, tmp_path, monkeypatch, virtual_bus):
    emulator = virtual_bus("MX-64R")
    emulator.memory[24] = 1
    before = bytes(emulator.memory.data[:36])
    code, _, complaints = command("doctor", "--fix", "--servo", emulator.port)
    assert bytes(emulator.memory.data[:36]) == before
    assert code == 3 and "has its torque on, and holds or turns something" in complaints[0]
    plugged = [SimpleNamespace(device=emulator.port, vid=0x0403, pid=0x6014)]
    monkeypatch.setattr(device_ports.list_ports, "comports", lambda: plugged)
    emulator.memory[24] = 0
    code, _, complaints = command("doctor", "--fix")
    assert bytes(emulator.memory.data[:24]) == before[:24]
    assert code == 3 and "a servo is set up only on a port that is named" in complaints[0]
    assert not list(tmp_path.glob("servo-*"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"settings": [{"register": "goal", "before": 3, "after": 1}]}, "has no setting goal = 3"),
        ({"settings": [{"register": "baud_rate", "before": 300, "after": 1}]}, "has no setting baud_rate = 300"),
        ({"model": "MX-65"}, "has no setting"),
        ({"settings": []}, "settings"),
        ({"schema": "else"}, "schema"),
    ],
)
def test_a_file_of_settings_that_is_none_changes_nothing(change, says, command, tmp_path):
    right = {
        "schema": "scanwright/servo-settings/1",
        "port": "/dev/null",
        "model": "MX-64R",
        "protocol": "1.0",
        "id": 1,
    }
    right["settings"] = [{"register": "baud_rate", "before": 34, "after": 1}]
    file = tmp_path / "servo.json"
    file.write_text(json.dumps(right | change))
    code, said, (complaint,) = command("doctor", "--restore", file)
    assert (code, said) == (2, "")
    assert str(file) in complaint and says in complaint


def test_only_ports_whose_usb_ids_are_in_the_catalogue_are_looked_at(monkeypatch):
    """A lone board on a common USB chip is no servo; the adapters of the makers are, and so are Hokuyo's sensors."""
    ids = {"u2d2": (0x0403, 0x6014), "usb2ax": (0x16D0, 0x06A7), "ch340": (0x1A86, 0x7523), "cp210x": (0x10C4, 0xEA60)}
    ids |= {"hokuyo": (0x15D1, 0x0000), "other": (0x0403, 0x6010), "board": (None, None)}
    plugged = [SimpleNamespace(device=name, vid=vid, pid=pid) for name, (vid, pid) in ids.items()]
    monkeypatch.setattr(device_ports.list_ports, "comports", lambda: plugged)
    assert device_ports.servo_ports() == ["u2d2", "usb2ax"]
    assert device_ports.lidar_ports() == ["hokuyo"]


def test_without_a_folder_an_emulated_scanner_is_named(command):
    folder = Path("out/desk")
    folder.mkdir(parents=True)
    with device_ports.announced(folder, device_ports.Ports("a", "b", os.getpid())):
        _, said, _ = command("doctor")
    assert said.count("an emulated scanner runs: name its build folder out/desk") == 2
    assert "emulated" not in command("doctor")[1]


def test_opening_a_port_leaves_its_control_lines_alone(monkeypatch):
    """A pseudo-terminal has no such lines, so what is asked of the system is looked at."""
    asked, ioctl = [], fcntl.ioctl

    def listening(fd, request, *rest):
        asked.append(request)
        return ioctl(fd, request, *rest)

    monkeypatch.setattr("serial.serialposix.fcntl.ioctl", listening)
    with ServoEmulator("MX-64R") as emulator:
        fd = os.open(emulator.port, os.O_RDWR | os.O_NOCTTY)
        modes = termios.tcgetattr(fd)
        modes[2] |= termios.HUPCL  # as serial ports have it, but no pseudo-terminal
        termios.tcsetattr(fd, termios.TCSANOW, modes)
        os.close(fd)
        opened = serial_port.open_serial_port(emulator.port, 57600)
        assert not termios.tcgetattr(opened.fileno())[2] & termios.HUPCL  # closing drops DTR no more
        opened.baudrate = 115_200
        assert not termios.tcgetattr(opened.fileno())[2] & termios.HUPCL
        opened.close()
    assert not set(asked) & {termios.TIOCMBIS, termios.TIOCMBIC, termios.TIOCMSET}


def test_every_setting_that_can_be_changed_has_a_name_of_its_own():
    from scanwright.firmware_io.servo.fitness import settable

    for table in all_tables():
        names = settable(table)
        assert "" not in names
        settings = (*table.neutral, *table.wheel, *table.joint, table.fast)
        assert {register for register, _ in settings} < set(names.values())


@pytest.mark.parametrize(
    ("model", "says"),
    [
        ("LMS111", ["it has run for 664.1 h", "it was switched on 597 times"]),
        ("UTM-30LX", ["status: Sensor works well."]),
    ],
)
def test_a_lidar_tells_its_age_and_state(model, says, monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "_MEASURED_S", 0.3)
    angles_deg = {"alpha_rot": 0, "beta_rot": 0, "alpha_laser": 0, "beta_laser": 50}
    angles = AngleSet.model_validate({"task": "t", "angles_deg": angles_deg, "sensor": model, "servo": "MX-64R"})
    (tmp_path / "angles.json").write_text(angles.to_json())
    with emulated_scanner(angles, room(None)) as emulators:
        received = [
            finding.message for finding in doctor.examine(tmp_path, emulators.ports.lidar, emulators.ports.servo, None)
        ]
    for line in says:
        assert f"{emulators.ports.lidar}: {line}" in received
    assert any(re.search(r": \d+\.\d V, \d+ deg C$", line) for line in received), (
        "the servo its voltage and temperature"
    )
