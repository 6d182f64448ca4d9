"""`servo-setup`: number and speed on emulators of each family, and what is refused before anything is changed."""

import pytest

from scanwright.firmware_io.servo.families import all_tables
from scanwright.firmware_io.servo.find import find_servo, open_bus

FAMILIES = [("MX-64R", "1.0"), ("XL430-W250", "2.0"), ("STS3215", "STS")]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def kept(emulator):
    return bytes(emulator.memory.data[: emulator.servo.table.ram])


@pytest.mark.parametrize(("model", "protocol"), FAMILIES)
def test_number_and_speed_are_set_read_back_and_restored(model, protocol, command, here, virtual_bus):
    emulator = virtual_bus(model, protocol)
    before = kept(emulator)
    code, said, _ = command("servo-setup", emulator.port, "--id", "7", "--baud", "115200")
    assert code == 0
    assert (emulator.servo.id, round(emulator.servo.baud / 115200, 1)) == (7, 1.0)
    assert "id (register " in said and ": 1 -> 7" in said
    found = find_servo(open_bus(emulator.port), None, 7)
    assert (found.table.model, found.bus.baud) == (model, 115200)
    (file,) = here.glob("servo-*.json")
    delay = emulator.servo.table.return_delay_ns.address
    emulator.memory[delay] = before[delay]  # which opening it has set
    emulator.servo.memory[emulator.servo.table.torque.address] = 0
    code, said, _ = command("doctor", "--restore", file)
    assert code == 0, said
    assert kept(emulator) == before
    assert "7 -> 1" in said


def test_a_kept_setting_outlasts_the_power_of_a_servo_with_a_lock(command, virtual_bus):
    emulator = virtual_bus("STS3215")
    emulator.memory[8] = 0  # it answers questions only
    assert command("servo-setup", emulator.port, "--id", "7", "--baud", "500000")[0] == 0
    emulator.brown_out()
    assert (emulator.servo.id, emulator.servo.baud, emulator.memory[55], emulator.memory[8]) == (7, 500_000, 1, 0)


@pytest.mark.parametrize(
    ("others", "arguments", "says"),
    [
        ([("MX-28", 3)], ("--id", "7"), "several servos answer (1 at 57600 baud, 3 at 57600 baud): leave one"),
        ([("MX-28", 3)], ("--id", "3", "--from-id", "1"), "a servo 3 answers at 57600 baud already; nothing was"),
        (
            [],
            ("--id", "7", "--dry-run"),
            "--id and --baud, --undo, --centre, --scanner and --dry-run: choose one",
        ),
        ([], ("--id", "253"), "--id = 253: servos have numbers from 0 to 252"),
        ([], ("--baud", "123456"), "123456 baud: MX-64R supports 9600, 19200"),
        ([], ("--id", "2", "--from-id", "9"), "servo 9 does not answer"),
    ],
)
def test_what_is_refused_changes_nothing(others, arguments, says, command, here, virtual_bus):
    emulator = virtual_bus("MX-64R", others=others)
    before = kept(emulator)
    code, _, complaints = command("servo-setup", emulator.port, *arguments)
    assert code == (2 if says.startswith("--") else 3) and says in complaints[0]
    assert kept(emulator) == before
    assert not list(here.glob("servo-*"))


def test_of_several_the_one_that_is_named_is_set(command, virtual_bus):
    emulator = virtual_bus("MX-64R", others=[("MX-28", 3)])
    assert command("servo-setup", emulator.port, "--id", "7", "--from-id", "3", "--from-baud", "57600")[0] == 0
    assert [servo.id for servo in emulator.servos] == [1, 7]


def test_a_servo_that_holds_something_is_left_alone_and_one_that_is_right_is_not_written(command, here, virtual_bus):
    emulator = virtual_bus("MX-64R")
    code, said, _ = command("servo-setup", emulator.port, "--id", "1", "--baud", "57600")
    assert code == 0 and "number and speed are right already" in said
    emulator.memory[24] = 1
    code, _, complaints = command("servo-setup", emulator.port, "--id", "7")
    assert code == 3 and "has its torque on" in complaints[0]
    assert emulator.memory[3] == 1
    assert not list(here.glob("servo-*"))


def test_the_speeds_of_the_tables_are_those_of_their_emulators(virtual_bus):
    for table in all_tables():
        emulator = virtual_bus(table.model, table.protocol)
        for count, baud in table.bauds.items():
            emulator.memory[table.baud.address] = count
            assert abs(emulator.servo.baud / baud - 1) < 0.03
