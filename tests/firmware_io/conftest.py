"""What the tests of devices share."""

import pytest
from virtual_bus import VirtualBus

from scanwright.firmware_io.lidar import sensor_line
from scanwright.firmware_io.lidar.scip import dialogue
from scanwright.firmware_io.lidar.sick import dialogue as cola_dialogue
from scanwright.firmware_io.scan import doctor
from scanwright.firmware_io.servo import prepare
from scanwright.firmware_io.servo.bus import bus, serial_line, unit


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """Emulators share a computer with the tests, and answer late if it is busy: wait ten times as long."""
    monkeypatch.setattr(dialogue, "_REPLY_S", 5.0)
    monkeypatch.setattr(sensor_line, "TURN_S", 10.0)
    monkeypatch.setattr(cola_dialogue, "_REPLY_S", 1.5)  # waited for whole where a sensor knows one dialect only
    monkeypatch.setattr(serial_line.SerialLine, "wait_s", 0.5)
    monkeypatch.setattr(bus, "_LATE", 1)


@pytest.fixture
def virtual_bus(monkeypatch):
    """Makes the bus that the next port to be opened leads to."""

    def make(model, protocol=None, others=()):
        made = VirtualBus(model, protocol, others)

        def open_port(port, baud, timeout):
            assert port == made.port
            return made.open(port, baud, timeout)

        monkeypatch.setattr(serial_line, "open_serial_port", open_port)
        for module in (serial_line, unit, doctor, prepare):
            monkeypatch.setattr(module, "time", made)
        return made

    return make
