"""The servo driver without a servo: control tables, packets against the e-manual and the SDK's known faults, errors."""

import itertools
import os
import random
import select
import threading
import tty
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from patience import until

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.emulators.servo.dynamixel_packets import packet_2, status
from scanwright.firmware_io.servo import guard
from scanwright.firmware_io.servo.bus import bus as servo_bus
from scanwright.firmware_io.servo.bus import serial_line
from scanwright.firmware_io.servo.bus.bus import ServoBus
from scanwright.firmware_io.servo.bus.registers import RPM, Register
from scanwright.firmware_io.servo.dynamixel.packets import PROTOCOL_1, PROTOCOL_2
from scanwright.firmware_io.servo.dynamixel.tables import TABLES
from scanwright.firmware_io.servo.find import find_servo
from scanwright.firmware_io.servo.progress import ServoState, Stall, TurnOrder, follow, nearest_turn
from scanwright.firmware_io.servo.servo import open_servo

REGISTERS = [
    getattr(table, name) for table in TABLES for name in ("wheel_speed", "joint_speed", "goal", "load", "torque")
]


class Wire:
    """What a serial port is to the bus; `reply` makes the answer of a request."""

    def __init__(self, reply):
        self.reply, self.baudrate, self.is_open = reply, 4_000_000, True
        self.timeout, self.pending, self.sent = None, b"", []

    def write(self, data):
        self.sent.append(bytes(data))
        self.pending += b"" if data == b"\0" else self.reply(bytes(data))
        return len(data)

    def read(self, length):
        taken, self.pending = self.pending[:length], self.pending[length:]
        return taken

    def reset_input_buffer(self):
        self.pending = b""

    def close(self):
        self.is_open = False


@pytest.fixture
def bus(monkeypatch):
    """A bus of a protocol whose servo answers as told."""

    def make(protocol, reply, tries=1, wait_s=0.05):
        wire = Wire(reply)
        monkeypatch.setattr(serial_line, "open_serial_port", lambda *_: wire)
        monkeypatch.setattr(serial_line.SerialLine, "wait_s", wait_s)
        monkeypatch.setattr(servo_bus, "_TRIES", tries)
        return ServoBus("wire", {"1.0": PROTOCOL_1, "2.0": PROTOCOL_2}[protocol]), wire

    return make


@given(register=st.sampled_from(REGISTERS), fraction=st.floats(0, 1))
def test_what_is_encoded_is_decoded_to_half_a_count(register, fraction):
    low, high = register.bounds
    value = (low + fraction * (high - low)) * register.unit
    assert abs(register.decode(register.encode(value)) - value) <= register.unit * 0.5000001 + 4 * np.spacing(
        abs(value)
    )


@given(register=st.sampled_from(REGISTERS), beyond=st.floats(0.51, 1e6), above=st.booleans())
def test_what_does_not_fit_is_refused_and_never_masked(register, beyond, above):
    low, high = register.bounds
    count = high + beyond if above else low - beyond
    with pytest.raises(DeviceError, match=f"register {register.address}"):
        register.encode(count * register.unit)


def test_counts_as_the_manual_writes_them():
    by_name = {(table.model, table.protocol): table for table in TABLES}
    mx_1, mx_2, ax = by_name["MX-64R", "1.0"], by_name["MX-64R", "2.0"], by_name["AX-12A", "1.0"]
    assert mx_1.wheel_speed.encode(-300 * 0.114 * RPM) == (1024 + 300).to_bytes(2, "little")  # bit 10 is clockwise
    assert mx_2.wheel_speed.encode(-300 * 0.229 * RPM) == (-300).to_bytes(4, "little", signed=True)
    assert ax.load.decode((1024 + 512).to_bytes(2, "little")) == pytest.approx(-0.512)
    assert (mx_1.present.address, mx_1.present.size) == (36, 8)
    assert (mx_2.present.address, mx_2.present.size) == (126, 21)
    assert ax.wheel_speed.unit * 1023 == pytest.approx(load_catalogue().get("AX-12A", Servo).no_load_rpm * RPM)


def test_tables_agree_with_the_catalogue():
    for table in TABLES:
        record = load_catalogue().products.get(table.model)
        if isinstance(record, Servo):
            step_deg = table.position.unit * 360 / (2 * 3.141592653589793)
            assert step_deg == pytest.approx(record.position_step_deg, rel=1e-6)
            assert table.measures_turn == (record.position_feedback_deg == 360)


@given(angle=st.floats(-4, 4), expected=st.floats(-1e3, 1e3))
def test_turns_are_added_whole_and_to_the_nearest(angle, expected):
    unwrapped = nearest_turn(angle, expected)
    turns = (unwrapped - angle) / (2 * 3.141592653589793)
    assert turns == pytest.approx(round(turns), abs=1e-9)
    assert abs(unwrapped - expected) <= 3.1415927


# From the e-manual's pages protocol1 and protocol2; the writes from its examples.
DIALOGUES = [
    ("1.0", "read", Register(43, 1), None, "ff ff 01 04 02 2b 01 cc", "ff ff 01 03 00 20 db"),
    ("1.0", "write", Register(24, 1), b"\1", "ff ff 01 04 03 18 01 de", "ff ff 01 02 00 fc"),
    ("2.0", "read", Register(132, 4), None, "ff ff fd 00 01 07 00 02 84 00 04 00 1d 15",
     "ff ff fd 00 01 08 00 55 00 a6 00 00 00 8c c0"),
    ("2.0", "write", Register(116, 4), b"\0\2\0\0", "ff ff fd 00 01 09 00 03 74 00 00 02 00 00 ca 89",
     "ff ff fd 00 01 04 00 55 00 a1 0c"),
]  # fmt: skip


@pytest.mark.parametrize(("protocol", "verb", "register", "data", "request_hex", "answer_hex"), DIALOGUES)
def test_packets_of_the_manual(bus, protocol, verb, register, data, request_hex, answer_hex):
    line, wire = bus(protocol, lambda _: bytes.fromhex(answer_hex))
    answer = line.read(1, register) if verb == "read" else line.write(1, register, data)
    assert wire.sent == [bytes.fromhex(request_hex)]
    assert answer.data == bytes.fromhex(answer_hex)[5 if protocol == "1.0" else 9 : -1 if protocol == "1.0" else -2]


@pytest.mark.parametrize("protocol", ["1.0", "2.0"])
def test_an_answer_that_waits_for_a_late_host_counts(bus, protocol):
    """The deadline passes while this process is kept from running; the bytes have long been there."""
    line, _ = bus(protocol, lambda _: status(protocol, 1, 0, b"\x2a\x07"), wait_s=-1.0)
    assert line.read(1, Register(36, 2)).data == b"\x2a\x07"


def test_requests_are_stuffed_which_the_sdk_forgets(bus):
    line, wire = bus("2.0", lambda _: status("2.0", 1, 0, b""))
    line.write(1, Register(116, 4), bytes.fromhex("ff ff fd 00"))
    assert wire.sent[-1][:-2].hex(" ") == "ff ff fd 00 01 0a 00 03 74 00 ff ff fd fd 00"
    assert wire.sent[-1] == packet_2(1, 3, bytes.fromhex("74 00 ff ff fd 00"))


@pytest.mark.parametrize("protocol", ["1.0", "2.0"])
def test_every_answer_is_read_as_it_was_sent(bus, protocol):
    """Also those of headers and stuffing only, where the SDK loses bytes: ff ff fd ff fd fd."""
    line, wire = bus(protocol, lambda _: b"")
    rng = random.Random(int(protocol[0]))
    for data in [bytes.fromhex("ff ff fd ff fd fd"), *(bytes(rng.choices(b"\xff\xfd\x00", k=9)) for _ in range(500))]:
        wire.reply = lambda _, data=data: status(protocol, 1, 0, data)
        assert line.read(1, Register(36, len(data))).data == data


@pytest.mark.parametrize(
    ("protocol", "reply", "kind", "words"),
    [
        ("1.0", b"", DeviceTimeoutError, "no answer"),
        ("2.0", b"", DeviceTimeoutError, "no answer"),
        ("1.0", status("1.0", 1, 0, b"")[:-1], ProtocolError, "damaged"),
        ("1.0", status("1.0", 1, 0, b""), ProtocolError, "0 bytes instead of 2"),  # the SDK: IndexError
        ("2.0", status("2.0", 1, 0, b""), ProtocolError, "0 bytes instead of 2"),
        ("1.0", status("1.0", 1, 8, b""), DeviceError, "out of range"),
        ("2.0", status("2.0", 1, 7, b""), DeviceError, "cannot be accessed"),
        ("1.0", status("1.0", 1, 16, b""), ProtocolError, "request arrived damaged"),
        ("2.0", status("2.0", 1, 3, b""), ProtocolError, "request arrived damaged"),
        ("1.0", status("1.0", 1, 0, b"\1\2")[:-1] + b"\0", ProtocolError, "damaged"),
        ("2.0", status("2.0", 1, 0, b"\1\2\3"), ProtocolError, "3 bytes instead of 2"),  # the SDK cuts it silently
        ("1.0", status("1.0", 7, 0, b"\1\2"), DeviceTimeoutError, "no answer"),  # another servo's
        ("1.0", b"\xff\xff\x01\x00\xfe\x00", ProtocolError, "damaged|wrong length"),
    ],
)
def test_every_bad_answer_is_a_typed_error(bus, protocol, reply, kind, words):
    line, _ = bus(protocol, lambda _: reply)
    with pytest.raises(DeviceError, match=words) as caught:
        line.read(1, Register(36, 2))
    assert caught.type is kind
    assert str(caught.value).startswith("wire: servo 1: ")


def test_a_damaged_answer_is_asked_again(bus):
    replies = iter([b"", status("1.0", 1, 0, b"\1\2")[:-1] + b"\0", status("1.0", 1, 0, b"\1\2")])
    line, wire = bus("1.0", lambda _: next(replies), tries=3)
    assert line.read(1, Register(36, 2)).data == b"\1\2"
    assert len(wire.sent) == 3


def test_late_answers_to_orders_are_not_taken_for_those_to_questions(bus):
    """Three orders were given twice on a busy computer: their answers come one by one, each after the next request."""
    late = [status("1.0", 1, 0, b"")] * 3
    line, wire = bus("1.0", lambda _: late.append(status("1.0", 1, 0, b"\1\2")) or b"", tries=3, wait_s=0.02)
    take, deadlines = wire.read, set()

    def read(length):
        if line._line.deadline_s not in deadlines:
            deadlines.add(line._line.deadline_s)
            wire.pending += late.pop(0)
        return take(length)

    wire.read = read
    assert line.read(1, Register(36, 2)).data == b"\1\2"


def test_a_late_answer_is_not_taken_for_the_next(bus):
    """Answers carry no number; the one that comes while the next is asked for tells of an earlier moment."""
    answers = iter([b"", status("1.0", 1, 0, b"\7\7")])
    line, wire = bus("1.0", lambda _: next(answers), tries=2, wait_s=0.02)
    take, deadlines = wire.read, set()

    def read(length):
        deadlines.add(line._line.deadline_s)
        if len(deadlines) == 2:  # the first wait is over, the next request not yet sent
            deadlines.add(None)
            wire.pending += status("1.0", 1, 0, b"\1\1")
        return take(length)

    wire.read = read
    assert line.read(1, Register(36, 2)).data == b"\7\7"
    assert None in deadlines and len(wire.sent) == 2


def test_a_try_in_which_this_computer_slept_says_nothing_of_the_servo(bus, monkeypatch):
    now_s, slept = [0.0], []

    def monotonic():
        now_s[0] += 0.001
        return now_s[0]

    clock = SimpleNamespace(monotonic=monotonic, monotonic_ns=lambda: round(monotonic() * 1e9))
    monkeypatch.setattr(serial_line, "time", clock)
    answers = iter([b"", b"", b"", b"", status("1.0", 1, 0, b"\7\7")])
    line, wire = bus("1.0", lambda _: next(answers), tries=1)
    take = wire.read

    def read(length):
        if len(slept) < 20 and not wire.pending:
            slept.append(1)
            now_s[0] += 1.0  # kept from running while it waited
        return take(length)

    wire.read = read
    assert line.read(1, Register(36, 2)).data == b"\7\7"
    assert len(wire.sent) == 5
    wire.reply, slept[:] = lambda _: b"", [1] * 20  # now it is awake, and the servo dead
    with pytest.raises(DeviceTimeoutError):
        line.read(1, Register(36, 2))
    assert len(wire.sent) == 6


def test_of_several_servos_on_a_bus_one_is_named(bus):
    line, wire = bus("1.0", lambda _: status("1.0", 1, 0, b"") + status("1.0", 2, 0, b""))
    with pytest.raises(DeviceError, match=r"servos \[1, 2\] answer: give servo_id"):
        find_servo(line, None, None)
    held = {0: b"\x36\x01", 3: b"\x02"}  # model number and id
    wire.reply = lambda request: status("1.0", 2, 0, held[request[5]] if request[4] == 2 else b"")
    found = find_servo(line, None, 2)
    assert (found.table.model, found.id) == ("MX-64R", 2)


def test_a_servo_that_nobody_knows_is_asked_in_every_way_and_told_nothing(bus):
    """Another model of protocol 1.0, whose id and speed are the number of the STS3215 where that looks for it."""
    memory = bytes([0x68, 0x01, 41, 9, 3, 250])  # model 360, firmware, id, speed, return delay
    said = lambda request: memory[request[5] : request[5] + request[6]] if request[4] == 2 else b""  # noqa: E731
    line, wire = bus("1.0", lambda request: status("1.0", 9, 0, said(request)))
    with pytest.raises(
        DeviceError, match=r"servo 9 has model number 360 in protocol 1\.0, .*777 in protocol STS, which"
    ):
        find_servo(line, None, None, unmute=True, baud=500_000)
    assert {request[4] for request in wire.sent if request[:3] == b"\xff\xff\x09"} == {2}
    assert len({request for request in wire.sent if len(request) > 1}) < 10


def test_a_number_that_is_read_but_once_makes_no_stranger(bus):
    """On a busy computer the late answer to one question was taken for that to another: 8705 in place of 310."""
    memory, late = bytes([0x36, 0x01, 41, 1]), [bytes([0x01, 0x22])]

    def reply(request):
        if request[4] != 2:
            return status("1.0", 1, 0, b"")
        at, count = request[5], request[6]
        return status("1.0", 1, 0, late.pop() if at == 0 and late else memory[at : at + count].ljust(count, b"\0"))

    line, _ = bus("1.0", reply)
    found = find_servo(line, None, 1, baud=57_600)
    assert not late and (found.table.model, found.id) == ("MX-64R", 1)


def test_an_echo_alone_is_no_answer_and_before_one_is_dropped(bus):
    answer = b""
    line, wire = bus("1.0", lambda request: request + answer)
    wire.reply = lambda request: request + answer
    line._line.echoes = True
    with pytest.raises(DeviceTimeoutError):  # the SDK takes it for an answer
        line.read(1, Register(36, 2))
    answer = status("1.0", 1, 0, b"\1\2")
    assert line.read(1, Register(36, 2)).data == b"\1\2"


def test_garbage_without_end_does_not_hold_the_program(bus, monkeypatch):
    """The SDK looks at its clock only when nothing comes."""
    rng = random.Random(1)
    line, wire = bus("1.0", lambda _: b"")
    wire.read = lambda length: rng.randbytes(length)
    now_s = itertools.count(step=0.001)  # a clock that goes on by a millisecond with every look at it
    clock = SimpleNamespace(monotonic=lambda: next(now_s), monotonic_ns=lambda: round(next(now_s) * 1e9))
    monkeypatch.setattr(serial_line, "time", clock)
    with pytest.raises(DeviceError):
        line.read(1, Register(36, 2))
    assert next(now_s) < 1.0


def mutated(rng, packet):
    """A packet with one or several things gone wrong."""
    data = bytearray(packet)
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(len(data) + 1)
        match rng.randrange(6):
            case 0 if at < len(data):
                data[at] ^= 1 << rng.randrange(8)
            case 1:
                del data[at:]
            case 2:
                del data[at : at + rng.randint(1, 4)]
            case 3:
                data[at:at] = rng.randbytes(rng.randint(1, 6))
            case 4:
                data[at:at] = rng.choice([b"\xff\xff\x01\x02", b"\xff\xff\xfd\x00\x01", b"\xff\xff\xff", bytes(packet)])
            case 5 if at < len(data):
                data[at] = rng.choice([0, 1, 2, 3, 0xFD, 0xFE, 0xFF])
    return bytes(data)


@pytest.mark.parametrize("protocol", ["1.0", "2.0"])
def test_mutated_answers_are_right_or_typed_errors(bus, protocol):
    rng = random.Random(int(protocol[0]))
    line, wire = bus(protocol, lambda _: b"", wait_s=0.0005)
    accepted = 0
    for _ in range(1500):
        data = bytes(rng.choice([0, 1, 0x55, 0xFD, 0xFF]) for _ in range(8))
        stream = mutated(rng, status(protocol, 1, 0, data))
        wire.reply = lambda _, stream=stream: stream
        try:
            answer = line.read(1, Register(36, 8))
        except DeviceError:
            continue
        accepted += 1
        assert any(status(protocol, 1, error, answer.data) in stream for error in range(256))
    assert 100 < accepted < 1400


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"port": "/dev/nothing"}, "/dev/nothing: no such port; serial ports here: "),
        ({"port": "pty", "model": "MX-65"}, "model = 'MX-65': no driver for this model; known: AX-12A"),
        ({"port": "pty", "model": "PD42-3-1140"}, "no driver for this model; removed in 0.2: "),
    ],
)
def test_what_cannot_be_opened_says_why(arguments, words):
    master, slave = os.openpty()
    try:
        port = os.ttyname(slave) if arguments["port"] == "pty" else arguments["port"]
        with pytest.raises(DeviceError, match=words):
            open_servo(**{**arguments, "port": port})
    finally:
        os.close(master)
        os.close(slave)


@pytest.fixture
def pair():
    """A port, and a servo behind it that keeps what it hears and answers what it is told."""
    master, slave = os.openpty()
    heard, reply, end = [], [b""], threading.Event()

    def servo():
        while not end.is_set():
            if select.select([master], [], [], 0.02)[0]:
                heard.append(os.read(master, 100))
                os.write(master, reply[0])

    thread = threading.Thread(target=servo)
    thread.start()
    tty.setraw(slave)
    yield slave, heard, reply
    end.set()
    thread.join()
    os.close(master)
    os.close(slave)


def test_the_guard_stops_a_servo_whose_program_leaves_without_a_word(pair):
    slave, heard, reply = pair
    watch = guard.Guard(slave, b"off", b"ack")
    assert watch.turning()
    watch._messages.close()  # what the kernel does for a killed program
    until(lambda: len(heard) >= 2)  # not answered: it insists
    reply[0] = b"xackx"
    watch.dismiss(at_rest=False)
    assert b"".join(heard).replace(b"off", b"") == b""  # on a busy computer one look finds several


def test_the_guard_of_a_servo_that_stands_does_nothing(pair):
    slave, heard, _ = pair
    watch = guard.Guard(slave, b"off", b"ack")
    assert watch.turning() and watch.resting()
    watch.dismiss(at_rest=True)
    watch.dismiss(at_rest=True)
    assert heard == []


def test_a_silent_program_hears_that_its_guard_has_acted(pair):
    slave, heard, reply = pair
    reply[0] = b"ack"
    watch = guard.Guard(slave, b"off", b"ack", silence_s=0.1)
    assert watch.turning()
    until(lambda: heard == [b"off"])
    until(lambda: not watch.turning())
    watch.dismiss(at_rest=True)


@pytest.mark.parametrize("turns", [True, False])
def test_a_servo_has_not_stalled_if_this_process_was_stopped_while_it_asked(turns):
    """The answer came at once, and was read after 1.2 s: its time is uncertain by the half of that."""
    times_s = [(1.0 + 0.01 * k, 0.0) for k in range(52)] + [(2.11, 0.6)] + [(2.71 + 0.01 * k, 0.0) for k in range(60)]
    order, stalls = TurnOrder(1.0, float("inf")), 0
    for time_s, bound_s in times_s:
        position_rad = time_s - bound_s if turns else 0.0
        state = ServoState(round(time_s * 1e9), round(bound_s * 1e9), position_rad, 1.0, 0.0, 12.0, 30.0)
        followed = follow(order, state, 0.0015)
        stalls += isinstance(followed, Stall)
        order = followed if isinstance(followed, TurnOrder) else order
    assert bool(stalls) is not turns
