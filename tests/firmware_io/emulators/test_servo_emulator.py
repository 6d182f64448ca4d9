"""The servo's emulator, judged by other people's programs, and the driver on it: motion, faults, and every way out."""

import math
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import dynamixel_sdk
import numpy as np
import pytest
import rustypot
from hypothesis import given
from hypothesis import strategies as st
from patience import until
from pyax12.connection import Connection
from virtual_bus import VirtualServo

from scanwright.design.errors import DeviceError, DeviceFaultError, DeviceTimeoutError
from scanwright.firmware_io import serial_port
from scanwright.firmware_io.emulators.servo.dynamixel_packets import crc16, packet_2, status, take
from scanwright.firmware_io.emulators.servo.emulator import ServoEmulator, machine_of
from scanwright.firmware_io.emulators.servo.machine import answers
from scanwright.firmware_io.emulators.servo_plant import Load
from scanwright.firmware_io.servo import servo as servo_driver
from scanwright.firmware_io.servo.bus.registers import Register
from scanwright.firmware_io.servo.dynamixel.tables import TABLES
from scanwright.firmware_io.servo.fitness import ServoSetupError

MODELS = [("MX-64R", "1.0"), ("MX-106", "1.0"), ("MX-64R", "2.0"), ("XM430-W350", "2.0"), ("XL330-M288", "2.0")]
MODELS += [("STS3215", "STS")]
FAMILIES = [("MX-64R", "1.0"), ("MX-64R", "2.0"), ("STS3215", "STS")]
BAUDS = {"STS": 1_000_000}  # from the factory
VOLTS = {"XL330-M288": 5.0}
MODELS_2 = [table.model for table in TABLES if table.protocol == "2.0"]
RATE = math.radians(180)
# Bytes that make up headers and stuffing; random ones hardly ever do.
payload = st.lists(st.sampled_from([0xFF, 0xFD, 0x00, 0x01, 0x55]), max_size=40).map(bytes)


def pause(condition, seconds=2.0):
    """Wait for something that may not come."""
    with suppress(AssertionError):
        until(condition, seconds)


def true_rad(emulator, time_ns=None):
    return float(emulator.axis.angle_rad(np.array(time.monotonic_ns() if time_ns is None else time_ns)))


def turns(emulator):
    """Whether the horn moves, over the last 20 ms."""
    now_ns = time.monotonic_ns()
    return abs(true_rad(emulator, now_ns) - true_rad(emulator, now_ns - 20_000_000)) > 1e-3


def read_for(servo, seconds):
    end = time.monotonic() + seconds
    states = [servo.read()]
    while time.monotonic() < end:
        states.append(servo.read())
    return states


# Packets


@given(servo_id=st.integers(0, 252), instruction=st.integers(1, 8), parameters=payload, noise=payload)
def test_requests_come_out_of_noise_whole(servo_id, instruction, parameters, noise):
    buffer = bytearray(noise.replace(b"\xff", b"") + packet_2(servo_id, instruction, parameters))
    request = take(buffer, "2.0")
    assert (request.id, request.instruction, request.parameters, request.intact) == (
        *(servo_id, instruction, parameters, True),
    )
    assert not buffer


@given(data=payload, error=st.integers(0, 127), cut=st.integers(0, 60))
def test_the_sdk_reads_the_statuses_of_the_emulator(data, error, cut):
    """Both protocols, and the stream in two parts; where a status is stuffed, as it is on the wire (`servo_bus`)."""
    for protocol, begin in (("1.0", 4), ("2.0", 8)):
        wire = status(protocol, 9, error, data)
        stuffed = protocol == "2.0" and b"\xff\xff\xfd" in bytes([error]) + data
        options = [] if protocol == "1.0" else [stuffed]
        packet, result = dynamixel_sdk.PacketHandler(float(protocol)).rxPacket(Replay(wire, cut), *options)
        assert result == dynamixel_sdk.COMM_SUCCESS
        if stuffed:
            assert bytes(packet) == wire
        else:
            assert bytes(packet[begin : begin + 1 + len(data)]) == bytes([error]) + data


class Replay:
    """A port for the SDK that plays bytes, with a pause after some."""

    def __init__(self, data, cut):
        self.parts, self.is_using = [data[:cut], b"", data[cut:]], True

    def readPort(self, length):
        while self.parts and not self.parts[0]:
            self.parts.pop(0)
        if not self.parts:
            return b""
        taken, self.parts[0] = self.parts[0][:length], self.parts[0][length:]
        return taken

    def isPacketTimeout(self):
        return not self.parts


def machine(protocol="2.0"):
    """In protocol 2.0 the servo of the e-manual's examples: model 1030, firmware 38, at count 166."""
    servo = machine_of("MX-64R", protocol, Load(), 0, 0.0 if protocol == "1.0" else (166 - 2048) * 2 * math.pi / 4096)
    if protocol == "2.0":
        servo.memory[0], servo.memory[6] = 1030, 38
    return servo


def ask(servo, wire, time_ns=0):
    """What the machine answers to bytes, as bytes."""
    said = answers([servo], servo.take(bytearray(wire)), time_ns)
    return said[0] if said else None


@pytest.mark.parametrize(
    ("protocol", "request_hex", "answer_hex"),
    [
        ("1.0", "ff ff 01 02 01 fb", "ff ff 01 02 00 fc"),  # ping
        ("1.0", "ff ff 01 04 02 2b 01 cc", "ff ff 01 03 00 1e dd"),  # 30 degC
        ("1.0", "ff ff 01 04 02 2b 01 cd", "ff ff 01 02 10 ec"),  # checksum error
        ("1.0", "ff ff 01 02 05 f7", "ff ff 01 02 40 bc"),  # action without a registered write
        ("1.0", "ff ff 01 05 03 1e ff 1f ba", "ff ff 01 02 08 f4"),  # goal 8191
        ("1.0", "ff ff 02 02 01 fa", None),  # not for us
        ("2.0", "ff ff fd 00 01 03 00 01 19 4e", "ff ff fd 00 01 07 00 55 00 06 04 26 65 5d"),
        ("2.0", "ff ff fd 00 01 07 00 02 84 00 04 00 1d 15", "ff ff fd 00 01 08 00 55 00 a6 00 00 00 8c c0"),
        ("2.0", "ff ff fd 00 01 07 00 02 84 00 04 00 1d 16", "ff ff fd 00 01 04 00 55 03 ab 0c"),  # CRC error
        ("2.0", "ff ff fd 00 fe 09 00 82 84 00 04 00 01 02 ce fa", "ff ff fd 00 01 08 00 55 00 a6 00 00 00 8c c0"),
    ],
)
def test_answers_byte_by_byte(protocol, request_hex, answer_hex):
    assert ask(machine(protocol=protocol), bytes.fromhex(request_hex)) == (answer_hex and bytes.fromhex(answer_hex))


@pytest.mark.parametrize("data", [b"\xa6\0\0\0", b"\xff\xff\xfd\0"])
def test_fast_reads_are_answered_in_one_status_that_is_not_stuffed(data):
    """LEN is 1 + 4 + 4: instruction; error, id and CRC; the data (e-manual, protocol2, fast sync read)."""
    servo = machine()
    servo.axis.change(0, mode="off")
    servo._measure = lambda _: servo.memory.data.__setitem__(slice(132, 136), data)
    body = bytes.fromhex("ff ff fd 00 fe 09 00 55 00 01") + data
    expected = body + crc16(body).to_bytes(2, "little")
    assert ask(servo, packet_2(254, 0x8A, bytes.fromhex("84 00 04 00 01"))) == expected
    assert ask(servo, packet_2(254, 0x9A, bytes.fromhex("01 84 00 04 00"))) == expected
    assert ask(servo, packet_2(254, 0x8A, bytes.fromhex("84 00 04 00 02"))) is None
    assert ask(servo, packet_2(254, 0x8A, bytes.fromhex("84 00 04 00 02 01"))) is None  # it waits for servo 2 for ever
    assert ask(servo, packet_2(1, 0x8A, bytes.fromhex("84 00 04 00 01")))[8] == 2  # no broadcast: unknown


def test_servos_add_their_parts_to_one_fast_status_each_with_the_sum_so_far():
    servos = [machine_of("XM430-W350", None, Load(), 0, 0.0) for _ in range(3)]
    for number, servo in enumerate(servos, 3):
        servo.memory[7], servo.memory[63] = number, 40 + number
    (said,) = answers(servos, servos[0].take(bytearray(packet_2(254, 0x8A, bytes.fromhex("3f 00 01 00 05 03 04")))), 0)
    expected = bytes.fromhex("ff ff fd 00 fe 10 00 55")
    for number in (5, 3, 4):
        expected += bytes([0, number, 40 + number])
        expected += crc16(expected).to_bytes(2, "little")
    assert said == expected
    (bulk,) = answers(servos, servos[0].take(bytearray(packet_2(254, 0x9A, bytes.fromhex("0307000100 053f000100")))), 0)
    assert bulk[5:7] == b"\x0b\x00" and (bulk[8:11], bulk[13:16]) == (b"\0\3\3", b"\0\5\x2d")
    (cut,) = answers(servos, servos[0].take(bytearray(packet_2(254, 0x8A, bytes.fromhex("3f 00 01 00 03 09 04")))), 0)
    assert len(cut) == 8 + 5  # servo 4 waits for servo 9, which is not there


@pytest.mark.parametrize(
    ("address", "data", "error"),
    [
        (132, b"\0\0\0\0", 7),  # read only
        (11, b"\1", 0),
        (11, b"\x09", 4),  # no such mode
        (104, b"\xff\xff\xff\x7f", 4),
        (104, b"\0\0", 5),
        (9000, b"\0", 7),
    ],
)
def test_writes_are_refused_as_protocol_2_numbers_it(address, data, error):
    assert ask(machine(), packet_2(1, 3, address.to_bytes(2, "little") + data))[8] == error


def test_eeprom_is_locked_while_torque_is_on():
    servo = machine()
    ask(servo, packet_2(1, 3, b"\x40\x00\x01"))
    assert ask(servo, packet_2(1, 3, b"\x0b\x00\x01"))[8] == 7


def test_indirect_data_are_those_of_their_targets():
    servo = machine()
    ask(servo, packet_2(1, 3, b"\xa8\x00\x92\x00"))  # indirect address 1 = 146, temperature
    assert ask(servo, packet_2(1, 2, b"\xe0\x00\x01\x00"))[9] == 30


def test_the_bus_watchdog_stops_the_wheel_and_locks_the_goals():
    servo, second = machine(), 1_000_000_000
    for address, value in ((11, b"\1"), (64, b"\1"), (98, b"\x32"), (104, b"\x64\0\0\0")):
        ask(servo, packet_2(1, 3, bytes([address, 0]) + value))
    servo.protect(second // 2)
    assert servo.axis.motion(second).rate_rad_s == pytest.approx(100 * servo.table.wheel_speed.unit, rel=0.01)
    servo.protect(second + 1)
    assert servo.axis.motion(2 * second).rate_rad_s == pytest.approx(0, abs=1e-3)
    assert servo.memory[98] == 255
    assert ask(servo, packet_2(1, 3, b"\x68\x00\x64\0\0\0"), 2 * second)[8] == 4
    assert ask(servo, packet_2(1, 3, b"\x62\x00\x00"), 2 * second)[8] == 0
    assert ask(servo, packet_2(1, 3, b"\x68\x00\x64\0\0\0"), 2 * second)[8] == 0


def test_a_strained_servo_protects_itself():
    servo, second = machine(protocol="1.0"), 1_000_000_000
    servo.memory[6] = servo.memory[8] = 0
    servo.memory[32], servo.memory[24] = 263, 1
    ask(servo, bytes.fromhex("ff ff 01 05 03 20 07 01 ce"))
    servo.axis.change(second, blocked=True)
    for time_ns in range(second, 4 * second, second // 50):
        servo.protect(time_ns)
    assert ask(servo, bytes.fromhex("ff ff 01 02 01 fb"), 4 * second)[4] == 32
    assert servo.memory[24] == 0


# Other people's programs


def test_pyax12_drives_the_ax_12a(monkeypatch):
    with ServoEmulator("AX-12A") as emulator:
        client = Connection(port=emulator.port, baudrate=1_000_000)
        # It sleeps 20 ms and takes what is there: let it sleep until something is, on a busy computer too.
        waiting = SimpleNamespace(sleep=lambda _: pause(lambda: client.serial_connection.in_waiting))
        monkeypatch.setattr("pyax12.connection.time", waiting)
        try:
            assert client.ping(1) and not client.ping(2)
            assert (client.get_model_number(1), client.get_present_position(1), client.get_present_voltage(1)) == (
                *(12, 512, 12.0),
            )
            client.goto(1, 30, speed=512, degrees=True)
            until(lambda: math.degrees(true_rad(emulator)) > 29)
            until(lambda: abs(client.get_present_position(1, degrees=True) - 30) < 1)
        finally:
            client.close()


def test_rustypot_drives_the_mx_64_and_the_xm430():
    with ServoEmulator("MX-64R") as emulator:
        client = rustypot.MxPyController(emulator.port, 57600, 10.0)
        assert client.read_model_number(1) == [310]
        client.write_goal_position(1, 0.5)
        until(lambda: abs(client.read_present_position(1)[0] - 0.5) < 0.05)
    with ServoEmulator("XM430-W350") as emulator:
        second = rustypot.Xl430PyController(emulator.port, 57600, 10.0)
        assert second.ping(1)
        assert second.sync_read_present_position([1]) == [2048]
        second.set_fast_sync_read(True)
        assert second.sync_read_present_position([1]) == [2048]
        second.write_torque_enable(1, True)
        second.sync_write_goal_position([1], [2400])
        until(lambda: abs(second.sync_read_present_position([1])[0] - 2400) < 20)


@pytest.fixture
def patient_sdk(monkeypatch):
    """Its 34 ms are short for an emulator that shares a busy machine with it."""
    monkeypatch.setattr(dynamixel_sdk.port_handler, "LATENCY_TIMER", 2000)


@pytest.mark.usefixtures("patient_sdk")
def test_the_official_sdk_drives_the_mx_64_of_protocol_2():
    with ServoEmulator("MX-64R", "2.0") as emulator:
        port, handler = dynamixel_sdk.PortHandler(emulator.port), dynamixel_sdk.PacketHandler(2.0)
        assert port.setBaudRate(57600)
        try:
            assert handler.ping(port, 1) == (311, 0, 0)
            assert handler.write1ByteTxRx(port, 1, 64, 1) == (0, 0)
            assert handler.write4ByteTxRx(port, 1, 116, 2400) == (0, 0)
            sync = dynamixel_sdk.GroupSyncRead(port, handler, 132, 4)
            sync.addParam(1)
            until(lambda: sync.txRxPacket() == 0 and abs(sync.getData(1, 132, 4) - 2400) < 20)
            bulk = dynamixel_sdk.GroupBulkRead(port, handler)
            bulk.addParam(1, 126, 21)
            assert bulk.txRxPacket() == 0 and bulk.getData(1, 146, 1) == 30
            assert handler.reboot(port, 1) == (0, 0)
            until(lambda: handler.ping(port, 1) == (311, 0, 0))
            assert handler.read1ByteTxRx(port, 1, 64) == (0, 0, 0)
        finally:
            port.closePort()


@pytest.mark.usefixtures("patient_sdk")
def test_the_sdk_reads_several_servos_of_one_bus_at_a_time():
    with ServoEmulator("XM430-W350", others=[("XL430-W250", 2), ("MX-106", 7)]) as emulator:
        port, handler = dynamixel_sdk.PortHandler(emulator.port), dynamixel_sdk.PacketHandler(2.0)
        assert port.openPort() and port.setBaudRate(57600)
        try:
            assert sorted(handler.broadcastPing(port)[0]) == [1, 2, 7]
            group = dynamixel_sdk.GroupSyncRead(port, handler, 0, 2)
            assert all(group.addParam(number) for number in (1, 2, 7))
            for read in (group.txRxPacket, group.fastSyncRead):
                assert read() == dynamixel_sdk.COMM_SUCCESS
                assert [group.getData(number, 0, 2) for number in (1, 2, 7)] == [1020, 1060, 321]
        finally:
            port.closePort()
        with pytest.raises(DeviceError, match=r"servos \[1, 2, 7\] answer: give servo_id"):
            open_servo(emulator.port)
        with open_servo(emulator.port, servo_id=7) as servo:
            assert servo.model == "MX-106"


@pytest.mark.usefixtures("patient_sdk")
def test_bytes_take_their_time_and_the_return_delay_is_kept(monkeypatch):
    with ServoEmulator("MX-64R", "2.0") as emulator:
        emulator.memory[9] = 254
        port, handler = dynamixel_sdk.PortHandler(emulator.port), dynamixel_sdk.PacketHandler(2.0)
        port.setBaudRate(57600)
        try:
            begin = time.monotonic()
            assert handler.readTxRx(port, 1, 126, 21)[1] == 0
            assert time.monotonic() - begin >= (14 + 32) * 10 / 57600 + 508e-6
            monkeypatch.setattr(dynamixel_sdk.port_handler, "LATENCY_TIMER", 16)
            port.setBaudRate(115200)  # not the servo's: it does not understand
            assert handler.ping(port, 1)[1] == dynamixel_sdk.COMM_RX_TIMEOUT
        finally:
            port.closePort()


# The driver on the emulator


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Where the driver keeps the files that undo its changes."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def emulated(monkeypatch):
    """Makes a servo on a clock of its own, which this file and the driver wait on."""

    def make(model="MX-64R", protocol=None, **options):
        servo = VirtualServo(model, protocol, **options)
        servo.install(monkeypatch)
        monkeypatch.setitem(globals(), "time", servo.clock)
        monkeypatch.setitem(globals(), "until", servo.clock.until)
        return servo

    return make


def open_servo(port, model=None, servo_id=None):
    """A servo that the driver may set to whatever mode a test needs."""
    return servo_driver.open_servo(port, model, servo_id, undo_folder=Path())


@pytest.mark.parametrize(("model", "protocol"), MODELS)
def test_spin_reads_the_true_angle_at_the_stated_time(emulated, model, protocol):
    with emulated(model, protocol, angle_rad=-3.0) as emulator, open_servo(emulator.port, model) as servo:
        assert (servo.model, servo.protocol, servo.id) == (model, protocol, 1)
        assert servo.baud == BAUDS.get(protocol, 57600)
        servo.spin(-RATE)
        states = read_for(servo, 0.3)
        for state in states:
            assert abs(state.position_rad - true_rad(emulator, state.time_ns)) < slack_rad(servo, state)
        assert states[-1].position_rad < -3.5  # on and on, through the encoder's end
        assert states[-1].velocity_rad_s == pytest.approx(-RATE, rel=0.02)
        servo.hold()
        until(lambda: not turns(emulator))
        volts = VOLTS.get(model, 12.0)
        assert (states[-1].voltage_V, states[-1].temperature_degC) == (pytest.approx(volts), 30)
        servo.sweep_to(2.0, 3.0)
        until(lambda: abs(servo.read().position_rad - 2.0) < 0.03)
        assert abs(math.remainder(true_rad(emulator) - 2.0, 2 * math.pi)) < 0.03 + servo.step_rad


@pytest.mark.parametrize("model", MODELS_2)
def test_the_tables_of_driver_and_emulator_are_of_one_servo(model):
    """Every register that the driver uses is one that the emulator has, with its size."""
    table = next(table for table in TABLES if (table.model, table.protocol) == (model, "2.0"))
    servo = machine_of(model, "2.0", Load(), 0, 0.0)
    named = [getattr(table, field.name) for field in fields(table)]
    for register in [one for one in named if isinstance(one, Register)]:
        item = servo.memory.items[register.address]
        assert (item.size, item.low < 0 or not item.writable) == (register.size, register.sign == "twos") or (
            not item.writable and item.size == register.size
        )
    assert servo.memory[0] == table.number
    assert (38 in servo.memory, 102 in servo.memory) == ((model not in ("MX-28", "XL430-W250")),) * 2


def slack_rad(servo, state):
    """By how much a reading may differ from the truth: half a count, and the turn within the stated time."""
    return servo.step_rad / 2 + (state.time_bound_ns / 1e9 + 1e-4) * 2 * RATE


def test_the_dead_sector_is_marked_and_never_guessed(emulated):
    with emulated("AX-12A") as emulator, open_servo(emulator.port) as servo:
        assert servo.baud == 1_000_000
        servo.spin(5.0)
        states = read_for(servo, 1.6)
    dead_rad = math.radians(150)
    seen = set()
    for state in states:
        truth = true_rad(emulator, state.time_ns)
        slack = slack_rad(servo, state)
        within = abs(math.remainder(truth, 2 * math.pi))
        if math.isnan(state.position_rad):
            assert within > dead_rad - 4 * slack  # two readings and what the emulator itself is late
            seen.add("dead")
        else:
            assert within < dead_rad + slack
            assert abs(state.position_rad - truth) < slack  # turns counted across the sector
            seen.add("first turn" if truth < math.pi else "second turn")
        assert math.isnan(state.velocity_rad_s)
    assert seen == {"dead", "first turn", "second turn"}


def test_turns_are_counted_across_a_pause_at_rest(emulated):
    """The speeds before and after say nothing of the time in between."""
    with emulated() as emulator, open_servo(emulator.port, servo_id=1) as servo:
        servo.spin(6.0)
        read_for(servo, 0.1)
        servo.hold()
        due_s = time.monotonic() + 1.5
        until(lambda: time.monotonic() > due_s)
        assert abs(servo.read().position_rad - true_rad(emulator)) < 0.01
        servo.spin(-6.0)
        read_for(servo, 0.1)
        servo.hold()
        until(lambda: not turns(emulator))
        assert abs(servo.read().position_rad - true_rad(emulator)) < 0.01


def test_a_servo_stuck_in_its_dead_sector_stalls(emulated):
    with emulated("AX-12A", angle_rad=math.pi) as emulator, open_servo(emulator.port) as servo:
        emulator.stall()
        servo.spin(6.0)
        with pytest.raises(DeviceFaultError, match="stall: stuck in the dead sector instead of"):
            read_for(servo, 60.0)


@pytest.mark.parametrize(("model", "protocol"), FAMILIES)
def test_an_adapter_that_echoes_and_flips_bits(emulated, model, protocol):
    emulator = emulated(model, protocol, seed=3)
    emulator.echo = True
    with open_servo(emulator.port) as servo:
        emulator.bit_errors(0.001)
        servo.spin(RATE)
        for state in read_for(servo, 0.3):
            assert abs(state.position_rad - true_rad(emulator, state.time_ns)) < slack_rad(servo, state)


def test_opening_sets_what_it_relies_on_if_it_may_and_says_so(emulated):
    with emulated("XM430-W350") as emulator:
        memory = emulator.memory
        memory[7], memory[8], memory[20], memory[68], memory[10] = 42, 2, -500, 0, 1
        with pytest.raises(ServoSetupError, match=r"homing_offset \(register 20\) is -500"):
            servo_driver.open_servo(emulator.port)
        assert (memory[20], memory[68], memory[10], memory[9], memory[64]) == (-500, 2, 1, 250, 0)
        with open_servo(emulator.port) as servo:
            assert (servo.id, servo.baud) == (42, 115200)
            notes = " ".join(servo.warnings())
            assert "homing_offset (register 20) was -500" in notes and "drive_mode (register 10) was 1" in notes
            assert "return_delay_time (register 9) is 250, so that its answers are 500 us late" in notes
            assert (memory[20], memory[68], memory[10], memory[9]) == (0, 2, 0, 250)
        memory[9] = 0
        with open_servo(emulator.port, servo_id=42) as servo:
            assert servo.warnings() == ()
        with pytest.raises(DeviceError, match="the model of servo 42 is XM430-W350, not MX-64R"):
            open_servo(emulator.port, "MX-64R")


def test_a_locked_memory_is_said(emulated):
    with emulated("MX-64R") as emulator:
        emulator.memory[47] = 1
        with open_servo(emulator.port) as servo:
            servo.sweep_to(0.1, 1.0)
            with pytest.raises(DeviceError, match=r"refused|memory is locked"):
                servo.spin(1.0)


def test_the_latency_timer_is_looked_at(tmp_path, monkeypatch):
    with ServoEmulator() as emulator:
        adapter = tmp_path / Path(emulator.port).resolve().name
        adapter.mkdir()
        (adapter / "latency_timer").write_text("16\n")
        monkeypatch.setattr(serial_port, "_ADAPTERS", tmp_path)
        with open_servo(emulator.port) as servo:
            assert any("gathers bytes for 16 ms" in note and "udev" in note for note in servo.warnings())


@pytest.mark.parametrize(
    ("do", "words"),
    [
        (lambda servo: servo.spin(20.0), r"rate 1145.9 deg/s: at most 378 deg/s"),
        (lambda servo: servo.spin(math.nan), "rate nan"),
        (lambda servo: servo.sweep_to(3.2, 1.0), r"sweep to 183.3 deg: it reaches -180.0 .. 179.9 deg"),
        (lambda servo: servo.sweep_to(1.0, 0.0), "choose a rate above 0"),
    ],
)
def test_what_the_servo_cannot_do_is_refused_before_it_moves(do, words):
    with ServoEmulator() as emulator, open_servo(emulator.port, servo_id=1) as servo:
        with pytest.raises(DeviceError, match=words):
            do(servo)
        assert not turns(emulator)


def test_two_programs_cannot_share_a_port():
    with (
        ServoEmulator() as emulator,
        open_servo(emulator.port, servo_id=1),
        pytest.raises(DeviceError, match="another program"),
    ):
        open_servo(emulator.port)


# Faults: whatever happens, the servo stands, and the error says what to do

FAULTS = [
    ("overload", "overload at {volts} V, 30 degC: free the axis"),
    ("overheat", r"overheating at {volts} V, \d+5 degC: let it cool down"),
    ("stall", r"stall: moved \d+\.\d deg instead of"),
    ("brown_out", r"restarted by itself, {volts} V now: check its supply"),
    ("low", r"voltage at \d.\d V, 30 degC: check its supply"),
]


TROUBLE = [(*of, *what) for of in FAMILIES for what in FAULTS]


@pytest.mark.parametrize(("model", "protocol", "fault", "words"), TROUBLE)
def test_a_fault_stops_the_turn_and_says_what_to_do(emulated, model, protocol, fault, words):
    words = words.replace("{volts}", str(VOLTS.get(model, 12.0)))
    with emulated(model, protocol) as emulator:
        with open_servo(emulator.port, servo_id=1) as servo:
            servo.spin(RATE)
            read_for(servo, 0.1)
            emulator.set_voltage(3.5 if protocol == "STS" else 5.0) if fault == "low" else getattr(emulator, fault)()
            with pytest.raises(DeviceFaultError, match=words):
                read_on(servo, 60.0)
        until(lambda: not turns(emulator))
        assert not has_torque(emulator)


def has_torque(emulator):
    return bool(emulator.memory[emulator._servo.table.torque.address])


def read_on(servo, seconds):
    """Read, also while it restarts and does not answer."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        with suppress(DeviceTimeoutError):
            servo.read()


def test_after_an_overload_it_can_be_opened_and_turns_again(emulated):
    for protocol in ("1.0", "2.0"):
        with emulated("MX-64R", protocol) as emulator:
            for again in (False, True):
                with open_servo(emulator.port) as servo:
                    assert again == any("it reported overload and was reset" in note for note in servo.warnings())
                    servo.spin(RATE)
                    read_for(servo, 0.1)
                    assert turns(emulator)
                    if not again:
                        emulator.overload()
                        with pytest.raises(DeviceFaultError):
                            servo.read()


@pytest.mark.parametrize("kind", [KeyboardInterrupt, ZeroDivisionError])
def test_it_stands_however_the_program_leaves(kind):
    with ServoEmulator() as emulator:
        with pytest.raises(kind), open_servo(emulator.port, servo_id=1) as servo:
            servo.spin(RATE)
            read_for(servo, 0.1)
            raise kind
        until(lambda: not turns(emulator))
        with open_servo(emulator.port, servo_id=1):
            pass  # the port is free


PROGRAM = """
import sys
from pathlib import Path
from scanwright.firmware_io.servo.servo import open_servo
with open_servo(sys.argv[1], servo_id=1, undo_folder=Path()) as servo:
    servo.spin(3.0)
    print("turning", flush=True)
    while True:
        servo.read()
"""


@pytest.mark.parametrize(("model", "protocol"), FAMILIES)
def test_it_stands_when_its_program_is_killed(model, protocol):
    with ServoEmulator(model, protocol) as emulator:
        with subprocess.Popen([sys.executable, "-c", PROGRAM, emulator.port], stdout=subprocess.PIPE) as program:
            assert program.stdout.readline() == b"turning\n"
            until(lambda: turns(emulator))
            program.kill()
        until(lambda: not turns(emulator))
        assert not has_torque(emulator)


def test_closing_insists_while_the_bus_is_disturbed():
    """The driver gives up after three tries; its guard goes on for two seconds."""
    with ServoEmulator() as emulator:
        with open_servo(emulator.port, servo_id=1) as servo:
            servo.spin(RATE)
            read_for(servo, 0.1)
            emulator.cut()
            close = servo._bus.close
            servo._bus.close = lambda: (close(), emulator.reconnect_bus())  # the driver has given up
        servo.close()
        until(lambda: not turns(emulator))


def test_it_stands_when_its_program_does_not_listen_and_when_its_bus_is_cut():
    """Two seconds for all three; a cut bus of protocol 1.0 is the one case that nobody can help."""
    with ExitStack() as stack:
        emulators = [stack.enter_context(ServoEmulator("MX-64R", protocol)) for protocol in ("1.0", "1.0", "2.0")]
        silent, helpless, watched = emulators
        servos = [stack.enter_context(open_servo(emulator.port, servo_id=1)) for emulator in emulators]
        for servo in servos:
            servo.spin(RATE)
        until(lambda: all(turns(emulator) for emulator in emulators))
        helpless.cut()
        watched.cut()
        until(lambda: not turns(silent) and not turns(watched))
        assert turns(helpless)
        with pytest.raises(
            DeviceError, match="not read for 2 s while it turned, so it was stopped: read it more often"
        ):
            servos[0].read()
        for servo in servos[1:]:
            with pytest.raises(DeviceError, match="could not be stopped: cut its power"):
                servo.close()
        helpless.reconnect_bus()
        with open_servo(helpless.port, servo_id=1):
            until(lambda: not turns(helpless))  # opening it takes the torque


@pytest.mark.parametrize(("model", "protocol"), FAMILIES)
def test_unplugged_is_said_and_plugged_in_it_is_found_again(model, protocol):
    with ServoEmulator(model, protocol) as emulator:
        with pytest.raises(DeviceTimeoutError, match="the port is gone") as caught, open_servo(emulator.port) as servo:
            servo.spin(RATE)
            read_for(servo, 0.1)
            emulator.unplug()
            read_for(servo, 60.0)
        assert any("could not be stopped: cut its power" in note for note in caught.value.__notes__)
        with pytest.raises(DeviceError, match="no such port"):
            open_servo(emulator.port)
        emulator.replug()
        with open_servo(emulator.port) as servo:
            until(lambda: not turns(emulator))
            servo.spin(RATE)
            read_for(servo, 0.05)


def test_a_servo_that_was_removed_is_refused_with_what_to_use_instead():
    with pytest.raises(DeviceError, match=r"no emulator of a servo PD42-3-1140; removed in 0\.2: "):
        machine_of("PD42-3-1140", None, Load(), 0, 0.0)
