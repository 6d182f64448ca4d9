"""`servo-setup`: number and speed on twins of each family, and what is refused before anything is changed."""

import pytest

from scanwright.firmware_io.servo.families import all_tables
from scanwright.firmware_io.servo.find import find_servo, open_bus

FAMILIES = [("MX-64R", "1.0"), ("XL430-W250", "2.0"), ("STS3215", "STS")]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def kept(twin):
    return bytes(twin.memory.data[: twin.servo.table.ram])


@pytest.mark.parametrize(("model", "protocol"), FAMILIES)
def test_number_and_speed_are_set_read_back_and_restored(model, protocol, command, here, virtual_bus):
    twin = virtual_bus(model, protocol)
    before = kept(twin)
    code, said, _ = command("servo-setup", twin.port, "--id", "7", "--baud", "115200")
    assert code == 0
    assert (twin.servo.id, round(twin.servo.baud / 115200, 1)) == (7, 1.0)
    assert "id (register " in said and ": 1 -> 7" in said
    found = find_servo(open_bus(twin.port), None, 7)
    assert (found.table.model, found.bus.baud) == (model, 115200)
    (file,) = here.glob("servo-*.json")
    delay = twin.servo.table.return_delay_ns.address
    twin.memory[delay] = before[delay]  # which opening it has set
    twin.servo.memory[twin.servo.table.torque.address] = 0
    code, said, _ = command("doctor", "--restore", file)
    assert code == 0, said
    assert kept(twin) == before
    assert "7 -> 1" in said


def test_a_kept_setting_outlasts_the_power_of_a_servo_with_a_lock(command, virtual_bus):
    twin = virtual_bus("STS3215")
    twin.memory[8] = 0  # it answers questions only
    assert command("servo-setup", twin.port, "--id", "7", "--baud", "500000")[0] == 0
    twin.brown_out()
    assert (twin.servo.id, twin.servo.baud, twin.memory[55], twin.memory[8]) == (7, 500_000, 1, 0)


@pytest.mark.parametrize(
    ("beside", "arguments", "says"),
    [
        ([("MX-28", 3)], ("--id", "7"), "several servos answer (1 at 57600 baud, 3 at 57600 baud): leave one"),
        ([("MX-28", 3)], ("--id", "3", "--from-id", "1"), "a servo 3 answers at 57600 baud already; nothing was"),
        ([], ("--id", "7", "--dry-run"), "--id and --baud, --undo, --scanner and --dry-run: choose one of these"),
        ([], ("--id", "253"), "--id = 253: servos have numbers from 0 to 252"),
        ([], ("--baud", "123456"), "123456 baud: MX-64R knows 9600, 19200"),
        ([], ("--id", "2", "--from-id", "9"), "servo 9 does not answer"),
    ],
)
def test_what_is_refused_changes_nothing(beside, arguments, says, command, here, virtual_bus):
    twin = virtual_bus("MX-64R", beside=beside)
    before = kept(twin)
    code, _, complaints = command("servo-setup", twin.port, *arguments)
    assert code == (2 if says.startswith("--") else 3) and says in complaints[0]
    assert kept(twin) == before
    assert not list(here.glob("servo-*"))


def test_of_several_the_one_that_is_named_is_set(command, virtual_bus):
    twin = virtual_bus("MX-64R", beside=[("MX-28", 3)])
    assert command("servo-setup", twin.port, "--id", "7", "--from-id", "3", "--from-baud", "57600")[0] == 0
    assert [servo.id for servo in twin.servos] == [1, 7]


def test_a_servo_that_holds_something_is_left_alone_and_one_that_is_right_is_not_written(command, here, virtual_bus):
    twin = virtual_bus("MX-64R")
    code, said, _ = command("servo-setup", twin.port, "--id", "1", "--baud", "57600")
    assert code == 0 and "it has that number and speed already" in said
    twin.memory[24] = 1
    code, _, complaints = command("servo-setup", twin.port, "--id", "7")
    assert code == 3 and "has its torque on" in complaints[0]
    assert twin.memory[3] == 1
    assert not list(here.glob("servo-*"))


def test_the_speeds_of_the_tables_are_those_of_their_twins(virtual_bus):
    for table in all_tables():
        twin = virtual_bus(table.model, table.protocol)
        for count, baud in table.bauds.items():
            twin.memory[table.baud.address] = count
            assert abs(twin.servo.baud / baud - 1) < 0.03
