"""The control tables beside the e-manual's, typed from its pages: address, bytes, and what one count is worth."""

import math

import pytest

from scanwright.firmware_io.servo.dynamixel.tables import TABLES

RPM = math.radians(360) / 60
STEP_12_BIT = 2 * math.pi / 4096
MX = {  # mx/mx-28 and mx/mx-64
    "return_delay_ns": (5, 1, 2000, "none"),
    "max_torque": (14, 2, 0.001, "none"),
    "status_return": (16, 1, 1, "none"),
    "torque": (24, 1, 1, "none"),
    "goal": (30, 2, STEP_12_BIT, "none"),
    "wheel_speed": (32, 2, 0.114 * RPM, 10),
    "joint_speed": (32, 2, 0.114 * RPM, "none"),
    "torque_limit": (34, 2, 0.001, "none"),
    "position": (36, 2, STEP_12_BIT, "none"),
    "velocity": (38, 2, 0.114 * RPM, 10),
    "load": (40, 2, 0.001, 10),
    "voltage": (42, 1, 0.1, "none"),
    "temperature": (43, 1, 1, "none"),
}
STEP_10_BIT = math.radians(300) / 1024
AX = MX | {  # ax/ax-12a; in wheel mode a share of 1023 of the voltage, here of the 59 rpm without load
    "goal": (30, 2, STEP_10_BIT, "none"),
    "wheel_speed": (32, 2, 59 * RPM / 1023, 10),
    "joint_speed": (32, 2, 0.111 * RPM, "none"),
    "position": (36, 2, STEP_10_BIT, "none"),
    "velocity": (38, 2, 0.111 * RPM, 10),
}
X = {  # x/xm430-w350 and mx/mx-64-2
    "return_delay_ns": (9, 1, 2000, "none"),
    "torque": (64, 1, 1, "none"),
    "status_return": (68, 1, 1, "none"),
    "hardware_error": (70, 1, 1, "none"),
    "watchdog": (98, 1, 0.02, "none"),
    "wheel_speed": (104, 4, 0.229 * RPM, "twos"),
    "joint_speed": (112, 4, 0.229 * RPM, "none"),
    "goal": (116, 4, STEP_12_BIT, "twos"),
    "velocity": (128, 4, 0.229 * RPM, "twos"),
    "position": (132, 4, STEP_12_BIT, "twos"),
    "voltage": (144, 2, 0.1, "none"),
    "temperature": (146, 1, 1, "none"),
}
MX_64_2 = X | {"load": (126, 2, 3.36e-3 / 4.1, "twos")}  # a current, as a share of the stalled one's
XM430 = X | {"load": (126, 2, 2.69e-3 / 2.3, "twos")}
DUTY = X | {"load": (126, 2, 0.001, "twos")}  # models that measure no current
OFFSETS_1 = [(20, 2, "twos", 0), (22, 1, "none", 1)]  # multi-turn offset, resolution divider
OFFSETS_106 = [(10, 1, "none", 0), *OFFSETS_1]  # mx/mx-106: drive mode too
OFFSETS_2 = [(10, 1, "none", 0), (20, 4, "twos", 0)]  # drive mode, homing offset
MODES_2 = [(11, 1, 1)], [(11, 1, 3)], OFFSETS_2, (8, 1, 3)
MANUAL = {
    ("AX-12A", 12): ("1.0", 24, 1023, AX, [(6, 2, 0), (8, 2, 0)], [(6, 2, 0), (8, 2, 1023)], [], (4, 1, 1)),
    ("MX-28", 29): ("1.0", 24, 4095, MX, [(6, 2, 0), (8, 2, 0)], [(6, 2, 0), (8, 2, 4095)], OFFSETS_1, (4, 1, 1)),
    ("MX-64R", 310): ("1.0", 24, 4095, MX, [(6, 2, 0), (8, 2, 0)], [(6, 2, 0), (8, 2, 4095)], OFFSETS_1, (4, 1, 1)),
    ("MX-106", 320): ("1.0", 24, 4095, MX, [(6, 2, 0), (8, 2, 0)], [(6, 2, 0), (8, 2, 4095)], OFFSETS_106, (4, 1, 1)),
    ("MX-28", 30): ("2.0", 64, 4095, DUTY, *MODES_2),
    ("MX-64R", 311): ("2.0", 64, 4095, MX_64_2, *MODES_2),
    ("MX-106", 321): ("2.0", 64, 4095, X | {"load": (126, 2, 3.36e-3 / 5.2, "twos")}, *MODES_2),
    ("XH430-W350", 1000): ("2.0", 64, 4095, X | {"load": (126, 2, 2.69e-3 / 1.3, "twos")}, *MODES_2),
    ("XM430-W350", 1020): ("2.0", 64, 4095, XM430, *MODES_2),
    ("XL430-W250", 1060): ("2.0", 64, 4095, DUTY, *MODES_2),
    ("XM540-W270", 1120): ("2.0", 64, 4095, X | {"load": (126, 2, 2.69e-3 / 4.4, "twos")}, *MODES_2),
    ("XL330-M288", 1200): ("2.0", 64, 4095, X | {"load": (126, 2, 1e-3 / 1.47, "twos")}, *MODES_2),
    ("XC330-T288", 1220): ("2.0", 64, 4095, X | {"load": (126, 2, 1e-3 / 0.88, "twos")}, *MODES_2),
    ("XC330-M288", 1240): ("2.0", 64, 4095, X | {"load": (126, 2, 1e-3 / 1.80, "twos")}, *MODES_2),
}


def test_every_table_is_here():
    assert [(table.model, table.number) for table in TABLES] == list(MANUAL)


@pytest.mark.parametrize("table", TABLES, ids=lambda table: f"{table.model} {table.number}")
def test_a_control_table_is_the_manual_s(table):
    protocol, ram, last, registers, wheel, joint, neutral, fast = MANUAL[table.model, table.number]
    assert (table.protocol, table.ram, table.last, table.centre) == (protocol, ram, last, (last + 1) / 2)
    ax = table.model == "AX-12A"
    assert (table.measures_turn, table.speed_loop) == (not ax, not ax)
    for name, (address, size, unit, sign) in registers.items():
        register = getattr(table, name)
        assert (register.address, register.size, register.sign) == (address, size, sign), name
        assert register.unit == pytest.approx(unit, rel=1e-12), name
    only_elsewhere = {"hardware_error", "watchdog"} if protocol == "1.0" else {"torque_limit", "max_torque"}
    assert all(getattr(table, name) is None for name in only_elsewhere)
    for settings, expected in ((table.wheel, wheel), (table.joint, joint), ((table.fast,), [fast])):
        assert [(register.address, register.size, count) for register, count in settings] == expected
    found = [(register.address, register.size, register.sign, count) for register, count in table.neutral]
    assert found == neutral


@pytest.mark.parametrize("table", TABLES, ids=lambda table: f"{table.model} {table.number}")
def test_the_bits_of_a_fault_byte(table):
    """Protocol 1.0: of the status; 2.0: hardware error status."""
    both = {0: "voltage", 2: "overheating", 5: "overload"}
    more = {} if table.protocol == "1.0" else {3: "motor encoder", 4: "electrical shock"}
    for bit in range(8):
        assert table.names(1 << bit) == (both | more).get(bit, f"fault code {1 << bit}")
    assert table.names(0b100101) == "voltage and overheating and overload"


def test_the_block_holds_all_present_values_and_nothing_more():
    for table in TABLES:
        first, size = (36, 8) if table.protocol == "1.0" else (126, 21)
        assert (table.present.address, table.present.size) == (first, size)
        block = bytes(range(1, size + 1))
        for name in ("load", "velocity", "position", "voltage", "temperature"):
            register = getattr(table, name)
            start = register.address - first
            assert table.pick(register, block) == register.decode(block[start : start + register.size])


def test_bounds_and_signs_by_hand():
    mx, x = TABLES[2], TABLES[7]
    assert mx.wheel_speed.bounds == (-1023, 1023)
    assert mx.goal.bounds == (0, 65535)
    assert x.goal.bounds == (-(2**31), 2**31 - 1)
    assert mx.wheel_speed.encode(-1023 * mx.wheel_speed.unit) == (2047).to_bytes(2, "little")
    assert mx.wheel_speed.decode((1024 + 7).to_bytes(2, "little")) == pytest.approx(-7 * mx.wheel_speed.unit)
    assert mx.wheel_speed.decode((7).to_bytes(2, "little")) == pytest.approx(7 * mx.wheel_speed.unit)
