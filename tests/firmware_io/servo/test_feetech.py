"""The Feetech family: frames beside published ones, the memory table, and every damaged answer a typed error."""

import random

import pytest

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.emulators.servo import dynamixel_packets
from scanwright.firmware_io.emulators.servo.emulator import machine_of
from scanwright.firmware_io.emulators.servo.machine import answers
from scanwright.firmware_io.emulators.servo_plant import Load
from scanwright.firmware_io.servo.bus import bus as servo_bus
from scanwright.firmware_io.servo.bus import serial_line
from scanwright.firmware_io.servo.bus.bus import ServoBus
from scanwright.firmware_io.servo.bus.registers import Register
from scanwright.firmware_io.servo.feetech.packets import STS
from scanwright.firmware_io.servo.feetech.tables import TABLES

(STS3215,) = TABLES

# Computed from the rule of the sum; the wheel mode also stands in public code for ESPHome.
FRAMES = [
    (1, b"", "ff ff 01 02 01 fb", "ff ff 01 02 00 fc"),  # ping
    (2, b"\x38\x02", "ff ff 01 04 02 38 02 be", "ff ff 01 04 00 00 08 f2"),  # position 2048
    (2, b"\x03\x02", "ff ff 01 04 02 03 02 f3", "ff ff 01 04 00 09 03 ee"),  # model 777
    (3, b"\x21\x01", "ff ff 01 04 03 21 01 d5", "ff ff 01 02 00 fc"),  # wheel mode
    (3, b"\x29\x32\0\0\0\0\xf4\x81", "ff ff 01 0a 03 29 32 00 00 00 00 f4 81 21", "ff ff 01 02 00 fc"),  # speed -500
]


@pytest.mark.parametrize(("instruction", "parameters", "asked", "said"), FRAMES)
def test_frames_are_those_that_others_write(instruction, parameters, asked, said):
    """The driver sends them, and the emulator, which was written apart from it, answers them."""
    wire = bytes.fromhex(asked)
    assert STS.packet(1, instruction, parameters) == wire
    servo = machine_of("STS3215", None, Load(), 0, 0.0)
    assert answers([servo], servo.take(bytearray(wire)), 0) == [bytes.fromhex(said)]


def test_signs_are_a_bit_and_counts_grow_clockwise():
    step_rad = -STS3215.wheel_speed.unit
    assert STS3215.wheel_speed.encode(500 * step_rad) == bytes.fromhex("f4 81")
    assert STS3215.wheel_speed.encode(-500 * step_rad) == bytes.fromhex("f4 01")
    assert STS3215.wheel_speed.decode(bytes.fromhex("f4 81")) == pytest.approx(500 * step_rad)
    assert STS3215.load.decode(bytes.fromhex("64 04")) == pytest.approx(0.1)
    assert STS3215.reach_rad == pytest.approx((-2047 * step_rad, 2048 * step_rad))
    with pytest.raises(DeviceError, match="register 46"):
        STS3215.wheel_speed.encode(32768 * step_rad)


# Feetech's memory table: address, bytes, |unit|, sign.
MANUAL = {
    "return_delay_ns": (7, 1, 2000, "none"),
    "status_return": (8, 1, 1, "none"),
    "max_torque": (16, 2, 0.001, "none"),
    "torque": (40, 1, 1, "none"),
    "goal": (42, 2, 0.0015339807878856412, 15),
    "wheel_speed": (46, 2, 0.0015339807878856412, 15),
    "joint_speed": (46, 2, 0.0015339807878856412, "none"),
    "torque_limit": (48, 2, 0.001, "none"),
    "lock": (55, 1, 1, "none"),
    "position": (56, 2, 0.0015339807878856412, 15),
    "velocity": (58, 2, 0.0015339807878856412, 15),
    "load": (60, 2, 0.001, 10),
    "voltage": (62, 1, 0.1, "none"),
    "temperature": (63, 1, 1, "none"),
}


def test_the_memory_table_is_the_maker_s():
    for name, (address, size, unit, sign) in MANUAL.items():
        register = getattr(STS3215, name)
        assert (register.address, register.size, register.sign) == (address, size, sign), name
        assert abs(register.unit) == pytest.approx(unit), name
    assert (STS3215.present.address, STS3215.present.size) == (56, 8)
    assert [STS3215.bauds[count] for count in range(8)] == [
        *(1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400),
    ]
    assert [(register.address, count) for register, count in (*STS3215.wheel, *STS3215.joint)] == [
        *((33, 1), (33, 0), (9, 0), (11, 4095)),
    ]
    assert STS3215.names(0b101111) == "voltage and encoder and overheating and overcurrent and overload"
    assert load_catalogue().get("STS3215", Servo).position_step_deg == pytest.approx(360 / 4096)


def test_what_is_written_while_the_memory_is_locked_is_gone_with_the_power():
    servo = machine_of("STS3215", None, Load(), 0, 0.0)

    def write(address, value):
        answers([servo], servo.take(bytearray(STS.packet(1, 3, bytes([address, value])))), 0)

    write(33, 1)
    assert servo.memory[33] == 1
    servo.restart(0)
    assert servo.memory[33] == 0
    for address, value in ((55, 0), (33, 1), (55, 1)):
        write(address, value)
    servo.restart(0)
    assert (servo.memory[33], servo.memory[55]) == (1, 1)


# Answers


class Replies:
    """A serial port whose servo says the same to whatever it is asked."""

    is_open, baudrate, timeout = True, 1_000_000, None

    def __init__(self, said):
        self.said, self.pending, self.sent = said, b"", []

    def write(self, data):
        self.sent.append(bytes(data))
        self.pending += b"" if data == b"\0" else self.said
        return len(data)

    def read(self, length):
        taken, self.pending = self.pending[:length], self.pending[length:]
        return taken

    def reset_input_buffer(self):
        self.pending = b""


@pytest.fixture
def bus(monkeypatch):
    def make(said, wait_s=0.02):
        monkeypatch.setattr(serial_line, "open_serial_port", lambda *_: Replies(said))
        monkeypatch.setattr(serial_line.SerialLine, "wait_s", wait_s)
        monkeypatch.setattr(servo_bus, "_TRIES", 1)
        return ServoBus("wire", STS)

    return make


def whole(data, error=0, servo_id=1):
    return dynamixel_packets.status("1.0", servo_id, error, data)


@pytest.mark.parametrize(
    ("said", "kind", "words"),
    [
        (b"", DeviceTimeoutError, "no answer"),
        (whole(b"\1\2", servo_id=7), DeviceTimeoutError, "no answer"),  # another servo's
        (whole(b"\1\2")[:-1], ProtocolError, "damaged"),
        (whole(b"\1\2")[:-1] + b"\0", ProtocolError, "damaged"),
        (whole(b""), ProtocolError, "0 bytes instead of 2"),
        (whole(b"\1\2\3"), ProtocolError, "3 bytes instead of 2"),
        (b"\xff\xff\x01\x00\xfe\x00", ProtocolError, "damaged"),
    ],
)
def test_every_bad_answer_is_a_typed_error(bus, said, kind, words):
    with pytest.raises(DeviceError, match=words) as caught:
        bus(said).read(1, Register(56, 2))
    assert caught.type is kind


def test_the_status_byte_tells_of_the_servo_and_refuses_nothing(bus):
    answer = bus(whole(b"\1\2", error=32)).read(1, Register(56, 2))
    assert (answer.data, answer.conditions) == (b"\1\2", 32)


def test_mutated_answers_are_right_or_typed_errors(bus):
    rng, accepted = random.Random(3), 0
    line = bus(b"", wait_s=0.0005)
    port = line._line.port
    for _ in range(1500):
        stream = bytearray(whole(rng.randbytes(8)))
        for _ in range(rng.randint(1, 2)):
            at = rng.randrange(len(stream) + 1)
            match rng.randrange(4):
                case 0 if at < len(stream):
                    stream[at] ^= 1 << rng.randrange(8)
                case 1:
                    del stream[at : at + rng.randint(1, 3)]
                case 2:
                    stream[at:at] = rng.randbytes(rng.randint(1, 6))
                case _:
                    stream[at:at] = rng.choice([b"\xff\xff\x01\x02", b"\xff\xff\xff", bytes(stream)])
        port.said = bytes(stream)
        try:
            answer = line.read(1, Register(56, 8))
        except DeviceError:
            continue
        accepted += 1
        assert any(whole(answer.data, error) in bytes(stream) for error in range(256))
    assert 100 < accepted < 1400
