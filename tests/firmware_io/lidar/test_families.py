"""The families of lidars, and which of them drives a product of the catalogue."""

from dataclasses import replace

import pytest
from virtual_time import replace_time

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError
from scanwright.firmware_io.lidar import families, sensor_line
from scanwright.firmware_io.lidar.families import family_of, open_lidar


@pytest.fixture(autouse=True)
def patience():
    """As long as devices are waited for: here nobody is late."""


def test_a_lidar_that_nothing_drives_is_one_line(monkeypatch):
    catalogue = load_catalogue()
    undriven = {"LMS 200": catalogue.get("LMS 200", Lidar).model_copy(update={"family": None})}
    monkeypatch.setattr(families, "load_catalogue", lambda: replace(catalogue, products=catalogue.products | undriven))
    with pytest.raises(DeviceError, match="LMS 200: no driver"):
        family_of("LMS 200")


def test_every_family_of_the_catalogue_is_one():
    lidars = [product for product in load_catalogue() if isinstance(product, Lidar) and product.family]
    assert {product.family for product in lidars} == {family.name for family in families.FAMILIES}


class SilentPort:
    """A serial port on which nobody answers, and the clock of who waits for it."""

    def __init__(self):
        self.now_s, self.baud, self.asked = 0.0, 115_200, set()

    def monotonic(self):
        return self.now_s

    def monotonic_ns(self):
        return round(self.now_s * 1e9)

    def read(self, timeout_s):
        self.now_s += max(timeout_s, 1e-6)
        return b""

    def write(self, _):
        self.asked.add(self.baud)

    def close(self):
        pass


def test_a_silent_port_is_asked_at_every_speed_in_nine_seconds(monkeypatch):
    """`doctor` without a model waits for each family in turn: what answers nothing at a speed is not asked again."""
    port = SilentPort()
    replace_time(port, monkeypatch, "scanwright.firmware_io.lidar")
    monkeypatch.setattr(sensor_line, "open_stream", lambda _: port)
    monkeypatch.setattr(sensor_line.SensorLine, "serial", property(lambda _: port))
    with pytest.raises(DeviceError, match=r"no SCIP sensor answers.*no RPLIDAR answers.*no SICK LMS 2xx answers"):
        open_lidar("silent")
    assert port.asked >= {9600, 19_200, 38_400, 57_600, 115_200, 250_000, 256_000, 460_800, 500_000, 750_000, 1_000_000}
    assert port.now_s < 9.0
