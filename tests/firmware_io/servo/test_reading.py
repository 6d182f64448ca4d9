"""Turns of every family, byte by byte: over the end of an encoder, both ways, and where a servo counts turns itself."""

import math

import pytest

from scanwright.firmware_io.servo.bus.bus import ServoAnswer
from scanwright.firmware_io.servo.families import all_tables
from scanwright.firmware_io.servo.progress import TurnOrder, state_of

STEP_RAD = 2 * math.pi / 4096
FAMILIES = {  # position on the wire, angle in steps from the centre, counter-clockwise
    ("MX-64R", "1.0"): [
        ("00 08", 0),
        ("ff 0f", 2047),
        ("00 00", 2048),
        ("64 00", 2148),
        ("ff 0f", 2047),
        ("00 08", 0),
        ("01 00", -2047),
        ("00 00", -2048),
        ("ff 0f", -2049),
        ("9c 0f", -2148),
    ],
    ("XM430-W350", "2.0"): [  # two's complement of 4 bytes, turns of its own
        ("00 08 00 00", 0),
        ("ff 0f 00 00", 2047),
        ("00 10 00 00", 2048),
        ("64 10 00 00", 2148),
        ("ff 0f 00 00", 2047),
        ("00 08 00 00", 0),
        ("01 00 00 00", -2047),
        ("ff ff ff ff", -2049),
        ("00 fc ff ff", -3072),
    ],
    ("STS3215", "STS"): [  # counts grow clockwise; bit 15 is a sign
        ("00 08", 0),
        ("01 00", 2047),
        ("00 00", 2048),
        ("ff 0f", 2049),
        ("00 0c", 3072),
        ("00 00", 2048),
        ("00 08", 0),
        ("ff 0f", -2047),
        ("00 00", -2048),
        ("01 00", -2049),
        ("64 80", -1948),
    ],
}


def table_of(model, protocol):
    (table,) = [table for table in all_tables() if (table.model, table.protocol) == (model, protocol)]
    return table


def answer_of(table, position, time_ns, velocity=None):
    """A reading of the block of present values with these bytes of a position, and of a velocity."""
    block = bytearray(table.present.size)
    for register, data in ((table.position, bytes.fromhex(position)), (table.velocity, velocity)):
        if data is not None:
            start = register.address - table.present.address
            assert len(data) == register.size
            block[start : start + register.size] = data
    return ServoAnswer(bytes(block), 0, time_ns, 0)


@pytest.mark.parametrize("family", FAMILIES)
def test_turns_are_counted_over_the_end_of_the_encoder(family):
    table, known, read = table_of(*family), None, []
    for k, (position, _) in enumerate(FAMILIES[family]):
        known = state_of(table, answer_of(table, position, k * 10**7), spins=True, known=known, order=None)
        read.append(known.position_rad / STEP_RAD)
    assert read == pytest.approx([steps for _, steps in FAMILIES[family]], abs=1e-6)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("turns", [1, -3])
def test_whole_turns_between_two_readings_come_from_speed_and_time(family, turns):
    """A reader that was held up finds the same count after some turns."""
    table, rate_rad_s = table_of(*family), math.copysign(math.pi, turns)
    velocity = table.velocity.encode(rate_rad_s)
    order = TurnOrder(rate_rad_s, math.copysign(math.inf, turns))
    first = state_of(table, answer_of(table, FAMILIES[family][0][0], 0, velocity), spins=True, known=None, order=order)
    later_ns = abs(turns) * 2 * 10**9
    position = FAMILIES[family][0][0]
    if table.protocol == "2.0":  # which counts them itself
        position = (2048 + 4096 * turns).to_bytes(4, "little", signed=True).hex()
    later = state_of(table, answer_of(table, position, later_ns, velocity), spins=True, known=first, order=order)
    assert (later.position_rad - first.position_rad) / (2 * math.pi) == pytest.approx(turns, abs=1e-6)


def test_the_ends_of_a_potentiometer_are_no_angles():
    table = table_of("AX-12A", "1.0")
    angles = []
    for position in ("00 00", "01 00", "00 02", "fe 03", "ff 03"):
        state = state_of(table, answer_of(table, position, 0), spins=True, known=None, order=None)
        angles.append(round(math.degrees(state.position_rad), 2) if state.position_rad == state.position_rad else None)
        assert math.isnan(state.velocity_rad_s)  # its wheel mode measures none
    assert angles == [None, -149.71, 0.0, 149.41, None]
