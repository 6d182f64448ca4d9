"""What outlasts the power of a servo is written only if somebody agrees, as listed, and can be undone byte by byte."""

import json
import math
from types import SimpleNamespace

import pytest
import typer

from scanwright.cli import servo_setup
from scanwright.cli.servo_setup import asking_first
from scanwright.design.angles import AngleSet
from scanwright.design.errors import DeviceError
from scanwright.firmware_io.device_ports import announced
from scanwright.firmware_io.emulators.scanner import emulated_scanner
from scanwright.firmware_io.emulators.servo.emulator import ServoEmulator
from scanwright.firmware_io.emulators.servo.machine import Request
from scanwright.firmware_io.emulators.world import room
from scanwright.firmware_io.ros import drive as ros_drive
from scanwright.firmware_io.servo import servo as servo_driver
from scanwright.firmware_io.servo.bus.bus import ServoBus
from scanwright.firmware_io.servo.fitness import ServoSetupError
from scanwright.firmware_io.servo.servo import open_servo
from scanwright.firmware_io.servo.settings import set_up

MODELS = [
    ("AX-12A", "1.0"),
    ("MX-64R", "1.0"),
    ("MX-106", "1.0"),
    ("MX-28", "2.0"),
    ("XM430-W350", "2.0"),
    ("XL330-M288", "2.0"),
    ("STS3215", "STS"),
]
FAMILIES = [MODELS[1], MODELS[4], MODELS[6]]
# Counts that no driver wants, by address: turned and shifted angles, a narrow range, another mode, few answers.
SPOILT = {
    "1.0": {6: 10, 8: 900, 16: 1, 5: 200},
    "2.0": {10: 1, 20: -500, 11: 16, 9: 200, 68: 1},
    "STS": {31: 500, 30: 2, 33: 2, 9: 100, 8: 0, 7: 200},
}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    guard = SimpleNamespace(turning=lambda: True, resting=lambda: True, beat=lambda: True, dismiss=lambda **_: True)
    monkeypatch.setattr(servo_driver, "Guard", lambda *_: guard)
    monkeypatch.setattr(ServoBus, "fileno", lambda _: -1)


@pytest.fixture
def spoilt(virtual_bus):
    def make(model, protocol):
        emulator = virtual_bus(model, protocol)
        for address, count in SPOILT[protocol].items():
            emulator.memory[address] = count
        emulator.memory[emulator.servo.table.torque.address] = 1  # it holds something
        return emulator

    return make


@pytest.fixture
def person(monkeypatch):
    """Somebody at a terminal; what they are asked, and what they answer."""
    asked = SimpleNamespace(questions=[], agrees=True)

    def confirm(question, **_):
        asked.questions.append(question)
        return asked.agrees

    terminal = SimpleNamespace(isatty=lambda: True)
    monkeypatch.setattr(servo_setup, "sys", SimpleNamespace(stdin=terminal, stderr=terminal))
    monkeypatch.setattr(typer, "confirm", confirm)
    return asked


def kept(emulator):
    """What the power does not take, by address."""
    return dict(enumerate(emulator.memory.data[: emulator.servo.table.ram]))


def kept_writes(emulator):
    """The addresses of the requests that write what outlasts the power, from the bytes on the wire."""
    found = set()
    for sent in emulator.writes:
        if request := emulator.servo.take(bytearray(sent)):
            found |= set(_addresses(request, emulator.servo.table))
    return found


def _addresses(request: Request, table):
    what, values = request.instruction, request.parameters
    assert what in (1, 2, 3, 8)  # ping, read, write, reboot; nothing that writes in another way
    if what != 3:
        return []
    wide = 2 if table.protocol == "2.0" else 1
    first = int.from_bytes(values[:wide], "little")
    return [address for address in range(first, first + len(values) - wide) if address < table.ram]


@pytest.mark.parametrize("spins", [True, False])
@pytest.mark.parametrize(("model", "protocol"), MODELS)
def test_unasked_nothing_is_written_that_outlasts_the_power(model, protocol, spins, spoilt):
    emulator = spoilt(model, protocol)
    before = kept(emulator)
    with pytest.raises(ServoSetupError) as caught:
        open_servo(emulator.port, model, spins=spins)
    assert kept_writes(emulator) == set() and kept(emulator) == before
    assert emulator.memory[emulator.servo.table.torque.address] == 0
    for change in caught.value.changes:
        assert f"{change.register.name} (register {change.register.address}) is {change.now}, " in str(caught.value)
        assert change.now != change.needed and emulator.servo.table.is_permanent(change.register)


@pytest.mark.parametrize("spins", [True, False])
@pytest.mark.parametrize(("model", "protocol"), MODELS)
def test_a_scan_with_a_servo_that_is_set_up_writes_nothing_that_outlasts_the_power(model, protocol, spins, virtual_bus):
    emulator = virtual_bus(model, protocol)
    ServoEmulator.set_up(SimpleNamespace(_servo=emulator.servo, memory=emulator.memory), spins=spins)
    before = kept(emulator)
    with open_servo(emulator.port, model, spins=spins) as servo:
        servo.hold()
        servo.release()
        for turn in (0.5, 1.0):
            servo.spin(turn) if spins else servo.sweep_to(turn, 0.5)
            servo.read()
            servo.hold()
        assert not servo.warnings()
    assert kept_writes(emulator) == set() and kept(emulator) == before


CURRENT_MODES = {0: "current control", 5: "current-based position control", 16: "PWM control"}


@pytest.mark.parametrize("model", ["XL330-M288", "XM430-W350"])
@pytest.mark.parametrize("spins", [True, False])
@pytest.mark.parametrize("mode", CURRENT_MODES)
def test_a_mode_of_current_is_refused_by_its_name(model, spins, mode, virtual_bus):
    emulator = virtual_bus(model, "2.0")
    emulator.set_up(spins=spins)
    emulator.memory[11] = mode
    with pytest.raises(ServoSetupError) as refused:
        open_servo(emulator.port, model, spins=spins)
    does = "turn continuously" if spins else "go to every angle"
    expected = f"operating_mode (register 11) is {mode}, {CURRENT_MODES[mode]}, so that it does not {does}; "
    assert f"{expected}{1 if spins else 3} is right" in str(refused.value)


@pytest.mark.parametrize(("model", "protocol"), FAMILIES)
def test_a_driver_that_may_not_write_does_not_change_the_mode(model, protocol, virtual_bus):
    emulator = virtual_bus(model, protocol)
    with open_servo(emulator.port) as servo:
        servo.sweep_to(0.3, 0.5)
        with pytest.raises(ServoSetupError, match="so that it does not turn continuously"):
            servo.spin(0.5)
        assert emulator.memory[emulator.servo.table.torque.address] == 0
    assert kept_writes(emulator) == set()


@pytest.mark.parametrize(("model", "protocol"), FAMILIES)
def test_who_agrees_gets_what_was_listed_and_can_undo_it(model, protocol, spoilt, person, command, tmp_path):
    emulator = spoilt(model, protocol)
    before = kept(emulator)
    listed = []

    def work():
        try:
            return open_servo(emulator.port, model, spins=True)
        except ServoSetupError as error:
            listed.extend(error.changes)
            raise

    asking_first(work, tmp_path, None).close()
    assert len(person.questions) == 1 and f"{len(listed)} register" in person.questions[0].replace("this", "1")
    listed_bytes = {change.register.address + k for change in listed for k in range(change.register.size)}
    assert kept_writes(emulator) == listed_bytes
    after = kept(emulator)
    assert {address for address in before if before[address] != after[address]} <= listed_bytes
    (file,) = tmp_path.glob("servo-*.json")
    assert [tuple(one.values()) for one in json.loads(file.read_text())["settings"]] == [
        (change.register.name, change.now, change.needed) for change in listed
    ]
    emulator.brown_out()
    assert kept(emulator) == after
    code, said, _ = command("servo-setup", emulator.port, "--undo", file)
    assert code == 0, said
    emulator.brown_out()
    assert kept(emulator) == before


def test_who_declines_is_told_how_and_nothing_is_written(spoilt, person, tmp_path, capsys):
    person.agrees = False
    emulator = spoilt("XM430-W350", "2.0")
    with pytest.raises(typer.Exit) as stop:
        asking_first(lambda: open_servo(emulator.port, spins=True), tmp_path, 1)
    assert stop.value.exit_code == 3 and person.questions == ["Write these 3 registers to the servo?"]
    hint = f"nothing was moved; `scanwright servo-setup {emulator.port} --scanner {tmp_path} --from-id 1` writes that"
    assert hint in capsys.readouterr().err
    assert kept_writes(emulator) == set() and not list(tmp_path.glob("servo-*"))


def test_a_mute_servo_is_asked_about_before_it_is_made_to_answer(spoilt, person, tmp_path):
    emulator = spoilt("MX-64R", "1.0")
    emulator.memory[16] = 0
    with pytest.raises(ServoSetupError, match=r"model unknown.*\n.*\(register 16\) is 0, so that it answers nothing"):
        open_servo(emulator.port)
    assert kept_writes(emulator) == set() and (emulator.memory[16], emulator.memory[24]) == (0, 0)
    asking_first(lambda: open_servo(emulator.port, spins=True), tmp_path, None).close()
    assert person.questions == ["Write this register to the servo?", "Write these 2 registers to the servo?"]
    assert len(list(tmp_path.glob("servo-*.json"))) == 2 and emulator.memory[16] == 2


def test_without_a_place_for_the_undo_file_nothing_is_written(spoilt, tmp_path):
    emulator = spoilt("MX-64R", "1.0")
    emulator.memory[16] = 0
    before = kept(emulator)
    emulator.memory[24] = 0
    with pytest.raises(DeviceError, match="cannot write, so nothing was changed"):
        list(set_up(emulator.port, None, None, tmp_path / "nowhere"))
    assert kept(emulator) == before


def test_what_is_not_as_it_was_agreed_upon_is_not_written(spoilt, tmp_path):
    emulator = spoilt("STS3215", "STS")
    with pytest.raises(ServoSetupError) as caught:
        open_servo(emulator.port, spins=True)
    emulator.memory[31] = 400  # another servo
    with pytest.raises(DeviceError, match=r"position_offset \(register 31\) is 400, and was 500 before"):
        list(set_up(emulator.port, None, None, tmp_path, agreed=caught.value.changes))
    assert kept_writes(emulator) == set() and not list(tmp_path.glob("servo-*"))


@pytest.mark.parametrize(("model", "protocol"), [MODELS[4], MODELS[6]])
@pytest.mark.usefixtures("person")
def test_what_does_not_last_is_said_and_the_horn_stays(model, protocol, spoilt, tmp_path, monkeypatch):
    """The servo restarts, and has its old mode again, after each setting was read back by itself."""
    emulator = spoilt(model, protocol)
    mode = 11 if protocol == "2.0" else 33
    answer, was = emulator.servo.answer, emulator.memory[mode]

    def forgetting(request, now_ns):
        told = answer(request, now_ns)
        if request.instruction == 2 and request.parameters[0] != mode and forgets:
            emulator.memory[mode] = was
        return told

    forgets = True
    monkeypatch.setattr(emulator.servo, "answer", forgetting)
    with pytest.raises(
        DeviceError, match=rf"register {mode}\): 1 was written, and it is {was} again.*nothing was moved"
    ):
        asking_first(lambda: open_servo(emulator.port, spins=True), tmp_path, None)
    assert emulator.memory[emulator.servo.table.torque.address] == 0
    assert math.isclose(emulator.servo.axis.motion(emulator.now_ns).angle_rad, 0.0, abs_tol=1e-9)
    assert list(tmp_path.glob("servo-*.json"))


def test_a_setting_that_is_lost_at_once_is_asked_about_once(person, tmp_path, spoilt):
    emulator = spoilt("XM430-W350", "2.0")

    def work():
        emulator.memory[20] = -500
        return open_servo(emulator.port, spins=True)

    with pytest.raises(ServoSetupError) as caught:
        asking_first(work, tmp_path, None)
    assert len(person.questions) == 1 and "written and lost" in caught.value.__notes__[0]


def test_a_dry_run_lists_and_writes_nothing(spoilt, command, tmp_path):
    emulator = spoilt("MX-64R", "1.0")
    before = bytes(emulator.memory.data)
    code, said, _ = command("servo-setup", emulator.port, "--dry-run")
    assert code == 0 and "return_delay_time (register 5) is 200" in said
    _, as_json, _ = command("servo-setup", emulator.port, "--dry-run", "--json")
    assert json.loads(as_json) == {"changes": said.splitlines(), "undo": None, "position_deg": None}
    assert bytes(emulator.memory.data[:36]) == before[:36] and not list(tmp_path.glob("servo-*"))


def test_a_emulator_takes_no_setting_while_its_torque_is_on(virtual_bus):
    """So the e-manual has it of both protocols; nothing of the kind is published for the STS3215."""
    for model, protocol, address, error in (("MX-64R", "1.0", 6, 8), ("XM430-W350", "2.0", 11, 7)):
        servo = virtual_bus(model, protocol).servo
        before, torque = servo.memory[address], servo.table.torque.address
        wide = 2 if protocol == "2.0" else 1
        request = Request(1, 3, address.to_bytes(wide, "little") + b"\1" + b"\0" * (protocol == "1.0"), b"", True)
        servo.memory[torque] = 1
        assert servo.answer(request, 0) == (error, b"")
        assert servo.memory[address] == before
        servo.memory[torque] = 0
        assert servo.answer(request, 0) == (0, b"")
        assert servo.memory[address] == 1


SCANNER = AngleSet.model_validate(
    {
        "task": "ahead",
        "angles_deg": {"alpha_rot": 0, "beta_rot": 0, "alpha_laser": 0, "beta_laser": 50},
        "sensor": "UTM-30LX",
        "servo": "MX-64R",
        "motion": {"mode": "spin", "period_s": 2.0},
    }
)


def test_scan_stops_where_nobody_can_be_asked(command, tmp_path):
    (tmp_path / "angles.json").write_text(SCANNER.to_json())
    with emulated_scanner(SCANNER, room(None), factory_servo=True) as emulators, announced(tmp_path, emulators.ports):
        before = bytes(emulators.servo.memory.data[:24])
        code, _, complaints = command("scan", tmp_path)
        assert code == 3
        assert "1 register that outlasts the power must change first; nothing was written" in complaints[0]
        assert (
            "ccw_angle_limit (register 8) is 4095, so that it does not turn continuously; 0 is right" in complaints[1]
        )
        assert f"`scanwright servo-setup {emulators.ports.servo} --scanner {tmp_path}`" in complaints[2]
        assert len(complaints) == 3
        assert bytes(emulators.servo.memory.data[:24]) == before and not list(tmp_path.glob("servo-*"))
        code, as_json, _ = command("doctor", tmp_path, "--json")
        assert code == 0 and {finding["severity"] for finding in json.loads(as_json)["findings"]} >= {"ok", "warning"}
        code, said, _ = command("servo-setup", emulators.ports.servo, "--scanner", tmp_path)
        assert code == 0 and "ccw_angle_limit (register 8): 4095 -> 0" in said
        assert open_servo(emulators.ports.servo, spins=True).warnings() == ()


def test_a_node_does_not_try_again_what_somebody_must_agree_to(monkeypatch):
    def acquire(*_):
        raise ServoSetupError("here", "MX-64R", 1, [])

    monkeypatch.setattr(ros_drive, "acquire", acquire)
    monkeypatch.setattr(ros_drive, "replace", lambda plan, **_: plan)
    steered = SimpleNamespace(running=True, period_s=0.0, begin=lambda: None)
    with pytest.raises(ServoSetupError):
        ros_drive.drive(SimpleNamespace(motion=None), steered, print)


@pytest.mark.parametrize(("model", "protocol"), MODELS)
def test_the_horn_is_turned_to_its_centre_without_a_permanent_change(virtual_bus, command, model, protocol):
    emulator = virtual_bus(model, protocol)
    with open_servo(emulator.port) as servo:
        servo.sweep_to(0.6, 1.0)
        while abs(servo.read().position_rad - 0.6) > 0.1:
            pass
    before = bytes(emulator.memory.data[:20])
    code, said, _ = command("servo-setup", emulator.port, "--centre")
    assert code == 0 and abs(float(said.partition(" deg from its centre, torque off")[0])) < 5
    assert abs(emulator.servo.axis.motion(emulator.now_ns).angle_rad) < 0.1
    assert bytes(emulator.memory.data[:20]) == before and not emulator.memory[emulator.servo.table.torque.address]
