"""The stepper that speaks TMCL: datagrams of the manuals, parameters of the maker's client, and that client itself."""

import math
import random
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pytrinamic.connections import SerialTmclInterface
from pytrinamic.modules import TMCM1140
from pytrinamic.tmcl import TMCLReplyStatusError

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.products import Servo
from scanwright.design.errors import DeviceError, DeviceFaultError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.servo import servo as servo_driver
from scanwright.firmware_io.servo.bus import bus as servo_bus
from scanwright.firmware_io.servo.bus import serial_line
from scanwright.firmware_io.servo.bus.bus import ServoBus
from scanwright.firmware_io.servo.bus.packet_format import Status
from scanwright.firmware_io.servo.bus.registers import Register
from scanwright.firmware_io.servo.servo import open_servo
from scanwright.firmware_io.servo.tmcl import packets
from scanwright.firmware_io.servo.tmcl.packets import AXIS, GLOBAL, INPUT, MOVE_TO, ROTATE_RIGHT, TMCL, USER
from scanwright.firmware_io.servo.tmcl.tables import TABLES
from scanwright.firmware_io.twins.servo.machine import answers
from scanwright.firmware_io.twins.servo.models import machine_of
from scanwright.firmware_io.twins.servo.tmcl import datagrams
from scanwright.firmware_io.twins.servo.twin import ServoTwin
from scanwright.firmware_io.twins.servo_plant import Load

(TABLE,) = TABLES
MODEL = "PD42-3-1140"
SECOND_NS = 1_000_000_000

# Requests and replies as the manuals print them: GIO of the TMCM-1021 (V1.42, page 42) and PD-1670, GAP of the PD-113
# (V1.10, page 32; the sum of its request is misprinted there, 0a for 08), version of the TMCM-170, CALC of the
# TMCM-1276 and CALCV of the TMCM-1211.
REQUESTS = [
    (packets.reading(1, INPUT + 0), "01 0f 00 01 00 00 00 00 11"),
    (packets.reading(1, AXIS + 1), "01 06 01 00 00 00 00 00 08"),
    (packets.datagram(1, 136, 0, 0, 0), "01 88 00 00 00 00 00 00 89"),
    (packets.datagram(1, 19, 2, 0, -5000), "01 13 02 00 ff ff ec 78 78"),
    (packets.datagram(1, 45, 1, 27, 5000), "01 2d 01 1b 00 00 13 88 e5"),
]
REPLIES = [
    ("02 01 64 0f 00 00 01 2e a5", Status(1, 100, (302).to_bytes(4, "little"), 9)),
    ("02 01 64 06 00 00 02 c7 36", Status(1, 100, (711).to_bytes(4, "little"), 9)),
    ("02 01 64 13 ff ff ec 78 dc", Status(1, 100, b"", 9)),
    ("02 01 64 2d 00 00 13 88 2f", Status(1, 100, b"", 9)),
]


@pytest.mark.parametrize(("made", "printed"), REQUESTS)
def test_requests_are_those_of_the_manuals(made, printed):
    assert made == bytes.fromhex(printed)
    request = datagrams.take(bytearray(made))
    assert request.intact and request.wire == made


@pytest.mark.parametrize(("printed", "status"), REPLIES)
def test_replies_are_those_of_the_manuals(printed, status):
    wire = bytes.fromhex(printed)
    asked = packets.datagram(1, wire[3], 0, 0, 0)
    assert packets.status(packets.reply_in(wire, asked)) == status
    assert datagrams.reply(2, 1, 100, wire[3], wire[4:8]) == wire
    assert packets.reply_in(wire[:-1] + bytes([wire[-1] ^ 1]), asked) is None


# What must go over the wire, and what comes back: written out by hand from the tables of commands.
DIALOGUES = [
    (packets.reading(1, AXIS + 140), "01 06 8c 00 00 00 00 00 93", "02 01 64 06 00 00 00 08 75"),
    (packets.writing(1, AXIS + 154, 3), "01 05 9a 00 00 00 00 03 a3", "02 01 64 05 00 00 00 03 6f"),
    (packets.reading(1, GLOBAL + 66), "01 0a 42 00 00 00 00 00 4d", "02 01 64 0a 00 00 00 01 72"),
    (packets.writing(1, USER + 255, 1), "01 09 ff 02 00 00 00 01 0c", "02 01 64 09 00 00 00 01 71"),
    (packets.writing(1, ROTATE_RIGHT, 100), "01 01 00 00 00 00 00 64 66", "02 01 64 01 00 00 00 64 cc"),
    (packets.writing(1, ROTATE_RIGHT, -100), "01 02 00 00 00 00 00 64 67", "02 01 64 02 00 00 00 64 cd"),
    (packets.writing(1, MOVE_TO, -512), "01 04 00 00 ff ff fe 00 01", "02 01 64 04 ff ff fe 00 67"),
    (packets.reading(1, INPUT + 8), "01 0f 08 01 00 00 00 00 19", "02 01 64 0f 00 00 00 f0 66"),
    (packets.reading(1, packets.FIRMWARE_VERSION), "01 88 01 00 00 00 00 00 8a", "02 01 64 88 04 74 01 2a 92"),
]


@pytest.mark.parametrize(("made", "asked", "said"), DIALOGUES)
def test_driver_and_twin_speak_the_same_bytes(made, asked, said):
    wire = bytes.fromhex(asked)
    assert made == wire
    module = machine_of(MODEL, None, Load(), 0, 0.0)
    assert answers([module], module.take(bytearray(wire)), 0) == [bytes.fromhex(said)]


def test_numbers_of_parameters_are_those_of_the_maker_s_client():
    ap, gp = TMCM1140._MotorTypeA.AP, TMCM1140.GP0
    numbers = {register.address for register, _ in (*TABLE.wheel, *TABLE.neutral)}
    assert numbers == {ap.PulseDivisor, ap.MicrostepResolution, ap.EncoderPrescaler, GLOBAL + gp.reverseShaftDirection}
    assert [register.address for register in TABLE.present[:4]] == [
        *(ap.AbsoluteResolverValue, ap.ExtendedErrorFlags, ap.DrvStatusFlags, ap.ActualVelocity),
    ]
    assert [register.address for register in TABLE.counters] == [ap.EncoderPosition, ap.ActualPosition]
    assert (TABLE.torque.address, TABLE.joint_speed.address) == (ap.Toff, ap.MaxVelocity)
    assert [one.address - GLOBAL for one in (TABLE.id, TABLE.baud, TABLE.return_delay_ns)] == [
        *(gp.SerialAddress, gp.SerialBaudRate, gp.TelegramPauseTime),
    ]


def test_units_are_those_of_the_motor_and_of_the_encoder():
    """The hardware manual's example of the same formula, in full steps; and the catalogue's step."""
    speed_rad_s = abs(TABLE.wheel_speed.unit)
    assert 1000 * speed_rad_s / (2 * math.pi) * 200 * 256 == pytest.approx(16e6 * 1000 / (2**3 * 2048 * 32))
    product = load_catalogue().get(MODEL, Servo)
    assert math.degrees(abs(TABLE.position.unit)) == pytest.approx(product.position_step_deg)
    assert 2047 * speed_rad_s * 60 / (2 * math.pi) == pytest.approx(product.no_load_rpm, rel=0.01)
    assert TABLE.reach_rad == pytest.approx((-511 / 512 * math.pi, math.pi))


# Answers


class Replies:
    """A serial port whose module says the same to whatever it is asked."""

    is_open, baudrate, timeout = True, 1_000_000, None

    def __init__(self, said):
        self.said, self.pending = said, b""

    def write(self, data):
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
        return ServoBus("wire", TMCL)

    return make


def said(status=100, *, module=1, command=6, value=b"\0\0\2\xc7"):
    return datagrams.reply(2, module, status, command, value)


@pytest.mark.parametrize(
    ("heard", "kind", "words"),
    [
        (b"", DeviceTimeoutError, "no answer"),
        (said(module=7), ProtocolError, "damaged answer"),
        (said(command=10), ProtocolError, "damaged answer"),  # to another question
        (said()[:-1], ProtocolError, "damaged answer"),
        (said()[:-1] + b"\0", ProtocolError, "damaged answer"),
        (said(1), ProtocolError, "the request arrived damaged"),
    ],
)
def test_every_bad_answer_is_a_typed_error(bus, heard, kind, words):
    with pytest.raises(DeviceError, match=words) as caught:
        bus(heard).read(1, Register(AXIS + 1, 4))
    assert caught.type is kind


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (2, "refused: a command it does not know"),
        (3, "refused: a type it does not know"),
        (4, "refused: a value out of range"),
        (5, "refused: its memory is locked"),
        (6, "refused: a command that is not available"),
        (77, "refused: status 77"),
    ],
)
def test_a_refusal_is_told_in_words(bus, status, words):
    with pytest.raises(DeviceError, match=f"servo 1: {words}"):
        bus(said(status, command=5)).write(1, Register(AXIS + 4, 4), b"\0\0\1\0")


@given(noise=st.binary(max_size=12))
def test_a_reply_is_found_behind_noise(noise):
    asked = packets.reading(1, AXIS + 1)
    found = packets.reply_in(noise + said(), asked)
    assert found is not None and found[8] == sum(found[:8]) % 256


def test_mutated_answers_are_right_or_typed_errors(bus):
    rng, accepted = random.Random(3), 0
    line = bus(b"", wait_s=0.0005)
    port = line._line.port
    for _ in range(1500):
        stream = bytearray(said(value=rng.randbytes(4)))
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
                    stream[at:at] = rng.choice([b"\x02\x01\x64\x06", b"\x02\x01\x64", bytes(stream)])
        port.said = bytes(stream)
        try:
            answer = line.read(1, Register(AXIS + 1, 4))
        except DeviceError:
            continue
        accepted += 1
        windows = [bytes(stream[k : k + 9]) for k in range(len(stream) - 8)]
        right = [one for one in windows if sum(one[:8]) % 256 == one[8] and (one[1], one[3]) == (1, 6)]
        assert answer.data[::-1] in [one[4:8] for one in right]
    assert 100 < accepted < 1400


# The module


@pytest.fixture
def module():
    return machine_of(MODEL, None, Load(), 0, 0.0)


def ask(module, request, now_ns=0):
    """Status and value."""
    ((_, _, status, _, *value, _),) = answers([module], module.take(bytearray(request)), now_ns)
    return status, int.from_bytes(bytes(value), "big", signed=True)


def test_the_module_says_what_it_does_not_take(module):
    damaged = packets.reading(1, AXIS + 1)[:-1] + b"\0"
    assert ask(module, damaged)[0] == 1
    assert ask(module, packets.datagram(1, 99, 0, 0, 0))[0] == 2
    assert ask(module, packets.reading(1, AXIS + 99))[0] == 3
    assert ask(module, packets.writing(1, AXIS + 215, 0))[0] == 3  # a reading only
    assert ask(module, packets.writing(1, AXIS + 140, 9))[0] == 4
    assert ask(module, packets.datagram(1, 6, 1, 1, 0))[0] == 4  # there is one motor only
    assert ask(module, packets.writing(1, ROTATE_RIGHT, 2048))[0] == 4
    assert ask(module, packets.datagram(1, 13, 0, 0, 0))[0] == 6
    assert answers([module], module.take(bytearray(packets.reading(2, AXIS + 1))), 0) == []  # not its number


def test_right_is_clockwise_and_the_encoder_follows(module):
    assert ask(module, packets.writing(1, AXIS + 154, 3)) == (100, 3)
    assert ask(module, packets.writing(1, ROTATE_RIGHT, 1678)) == (100, 1678)  # one turn a second, all but 0.03 %
    for request in (packets.reading(1, AXIS + 1), packets.reading(1, AXIS + 209)):
        assert ask(module, request, SECOND_NS)[1] == pytest.approx(51_200, abs=300)
    assert math.degrees(module.axis.motion(SECOND_NS).angle_rad) == pytest.approx(-360, abs=2)
    assert ask(module, packets.datagram(1, 3, 0, 0, 0), SECOND_NS)[0] == 100  # MST
    assert ask(module, packets.reading(1, AXIS + 3), SECOND_NS) == (100, 0)


def test_a_move_ends_at_its_goal_and_says_so(module):
    ask(module, packets.writing(1, AXIS + 154, 3))
    ask(module, packets.writing(1, MOVE_TO, -12_800))
    assert ask(module, packets.reading(1, AXIS + 8), SECOND_NS // 10) == (100, 0)
    assert ask(module, packets.reading(1, AXIS + 8), SECOND_NS) == (100, 1)
    assert math.degrees(module.axis.motion(SECOND_NS).angle_rad) == pytest.approx(90, abs=0.5)


def test_a_motor_that_is_held_loses_steps_and_stops_where_it_watches_them(module):
    ask(module, packets.writing(1, AXIS + 212, 1000))
    ask(module, packets.writing(1, ROTATE_RIGHT, 1000))
    module.axis.change(SECOND_NS, blocked=True)
    for now_ns in range(SECOND_NS, 3 * SECOND_NS, SECOND_NS // 50):
        module.protect(now_ns)
    assert ask(module, packets.reading(1, AXIS + 2), 3 * SECOND_NS) == (100, 0)
    assert ask(module, packets.reading(1, AXIS + 207), 3 * SECOND_NS) == (100, 2)
    assert ask(module, packets.reading(1, AXIS + 207), 3 * SECOND_NS) == (100, 0)  # reading takes it back


def test_a_brown_out_forgets_the_count_and_not_the_angle(module):
    ask(module, packets.writing(1, MOVE_TO, 12_800))
    ask(module, packets.writing(1, USER + 255, 1), 2 * SECOND_NS)
    before = ask(module, packets.reading(1, AXIS + 215), 2 * SECOND_NS)
    assert before[1] != 512 and ask(module, packets.reading(1, AXIS + 209), 2 * SECOND_NS)[1] > 3000
    module.restart(2 * SECOND_NS)
    assert not module.listens(2 * SECOND_NS + 1)
    later_ns = 3 * SECOND_NS
    assert ask(module, packets.reading(1, AXIS + 209), later_ns) == (100, 0)
    assert ask(module, packets.reading(1, USER + 255), later_ns) == (100, 0)
    assert ask(module, packets.reading(1, AXIS + 215), later_ns)[1] == pytest.approx(before[1], abs=4)


def test_with_too_little_voltage_it_is_off_and_begins_anew_with_enough(module):
    ask(module, packets.writing(1, USER + 255, 1))
    module.set_voltage(8.0, 0)
    assert not module.listens(10 * SECOND_NS)
    module.set_voltage(12.0, 10 * SECOND_NS)
    assert module.listens(11 * SECOND_NS)
    assert ask(module, packets.reading(1, INPUT + 8), 11 * SECOND_NS) == (100, 120)
    assert ask(module, packets.reading(1, USER + 255), 11 * SECOND_NS) == (100, 0)


# The driver


def test_the_maker_s_client_drives_the_twin():
    with ServoTwin(MODEL) as twin:
        line = SerialTmclInterface(twin.port, datarate=9600, timeout_s=5)
        try:
            client = TMCM1140(line)
            motor = client.motors[0]
            assert line.get_version_string() == "1140V142"
            assert motor.get_axis_parameter(motor.AP.MicrostepResolution) == 8
            motor.set_axis_parameter(motor.AP.PulseDivisor, 3)
            client.move_to(0, 2000, 500)
            for _ in range(400):
                if motor.get_position_reached():
                    break
            assert motor.get_position_reached() and motor.actual_position == 2000
            assert motor.get_axis_parameter(motor.AP.EncoderPosition, signed=True) == pytest.approx(2000, abs=110)
            with pytest.raises(TMCLReplyStatusError, match="Invalid Value"):
                motor.set_axis_parameter(motor.AP.MicrostepResolution, 9)
        finally:
            line.close()


def test_doctor_only_asks_and_setup_sets_number_and_speed(command, virtual_bus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    twin = virtual_bus(MODEL)
    twin.memory[210] = 12_800
    before = dict(twin.memory)
    _, told, _ = command("doctor", "--servo", twin.port)
    assert twin.memory == before
    assert (
        MODEL in told and "protocol TMCL at 9600 baud" in told and "encoder_prescaler (register 210) is 12800" in told
    )
    code, told, _ = command("servo-setup", twin.port, "--id", "7", "--baud", "1000000")
    assert code == 0, told
    assert (twin.servo.id, twin.servo.baud) == (7, 1_000_000)
    (file,) = tmp_path.glob("servo-*.json")
    code, told, _ = command("doctor", "--restore", file)
    assert code == 0, told
    assert (twin.servo.id, twin.servo.baud) == (1, 9600)


def test_what_the_driver_sends_to_turn_to_read_and_to_stop(virtual_bus, monkeypatch):
    guard = SimpleNamespace(turning=lambda: True, resting=lambda: True, dismiss=lambda **_: True)
    monkeypatch.setattr(servo_driver, "Guard", lambda *_: guard)
    monkeypatch.setattr(ServoBus, "fileno", lambda _: -1)
    twin = virtual_bus(MODEL)
    twin.memory[1065] = 11
    servo = open_servo(twin.port, MODEL)
    twin.heard.clear()
    servo.spin(math.radians(-20))
    turned = [twin.heard[k : k + 9].hex(" ") for k in range(0, len(twin.heard), 9)]
    assert turned[0] == "01 05 a7 00 00 00 00 00 ad"  # torque off
    read, write = "01 06 9a 00 00 00 00 00 a1", "01 05 9a 00 00 00 00 03 a3"
    assert turned[1:5] == [read, read, write, read]  # which pulses; not stored, so nobody is asked
    del turned[:5]
    assert turned[0] == "01 01 00 00 00 00 00 00 02"  # no steps any more
    assert turned[1:5] == [  # the counters take the encoder's angle, 512 counts of 50 microsteps
        "01 06 d7 00 00 00 00 00 de",
        "01 05 d1 00 00 00 64 00 3b",
        "01 06 d7 00 00 00 00 00 de",
        "01 05 01 00 00 00 64 00 6b",
    ]
    assert turned[5:8] == [  # ROR 0, torque, mark
        "01 01 00 00 00 00 00 00 02",
        "01 05 a7 00 00 00 00 05 b2",
        "01 09 ff 02 00 00 00 01 0c",
    ]
    assert turned[8:14] == [packets.reading(1, address).hex(" ") for address in (215, 207, 208, 3, 3008, 3009)]
    assert turned[14:] == ["01 01 00 00 00 00 00 5d 5f"]  # 20 deg/s to the right are 93 times 30.5 microsteps a second
    twin.heard.clear()
    servo.close()
    assert bytes(twin.heard) == bytes.fromhex("01 05 a7 00 00 00 00 00 ad")


def test_a_module_that_stopped_because_it_lost_steps_says_so():
    with ServoTwin(MODEL) as twin:
        twin.memory[1065] = 11
        twin.memory[212] = 1000
        with open_servo(twin.port) as servo:
            servo.spin(math.radians(90))
            servo.read()
            twin.stall()
            with pytest.raises(DeviceFaultError, match=r"steps lost by overload at 24.0 V, 30 degC: free what brakes"):
                while True:
                    servo.read()
