"""A family of servos from a package that is none of ours: found, driven and emulated without a line of this project."""

import sys

import pytest

from design.catalogue import catalogue
from design.catalogue.catalogue import SHIPPED, load_catalogue
from design.catalogue.products import Servo
from design.errors import DeviceError
from firmware_io.servo import families
from firmware_io.servo.servo import open_servo
from firmware_io.twins.servo.twin import ServoTwin

FAMILY = """
from dataclasses import replace

from firmware_io.servo.bus.registers import ControlTable
from firmware_io.servo.families import ServoFamily
from firmware_io.servo.feetech.packets import Sts
from firmware_io.servo.feetech.tables import TABLES


class AcmePackets(Sts):
    protocol = "ACME"


TABLE = replace(TABLES[0], model="ACME-1", packets=AcmePackets(), number=4711)
FAMILY = ServoFamily("Acme", (TABLE,), (250_000,), "acme_servos.family:Twin")
NO_FAMILY = 7


def Twin(table, load, time_ns, angle_rad):
    from firmware_io.twins.servo.feetech_machine import FeetechMachine

    made = FeetechMachine(table, load, time_ns, angle_rad)
    made.memory[3], made.memory[6] = 4711, 2
    return made
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A package with a family and its product, as `pip install` would leave it; what its entry point names."""

    def install(name):
        package, facts = tmp_path / "acme_servos", tmp_path / "acme_servos-1.dist-info"
        package.mkdir()
        facts.mkdir()
        (package / "__init__.py").write_text("")
        (package / "family.py").write_text(FAMILY)
        product = (SHIPPED / "sts3215.toml").read_text().replace('name = "STS3215"', 'name = "ACME-1"')
        (package / "acme-1.toml").write_text(product)
        (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-servos\nVersion: 1\n")
        (facts / "entry_points.txt").write_text(f"[scanwright.servos]\nacme = acme_servos.family:{name}\n")
        monkeypatch.syspath_prepend(tmp_path)

    forget = (catalogue._shipped.cache_clear, families.all_families.cache_clear)
    for clear in forget:
        clear()
    yield install
    for clear in forget:
        clear()
    for module in [name for name in sys.modules if name.startswith("acme_servos")]:
        del sys.modules[module]


def test_a_servo_of_a_package_of_its_own_turns(installed):
    installed("FAMILY")
    assert load_catalogue().get("ACME-1", Servo).maker == "Feetech"
    with ServoTwin("ACME-1") as twin, open_servo(twin.port) as servo:
        assert (servo.model, servo.protocol, servo.baud) == ("ACME-1", "ACME", 250_000)
        servo.spin(1.0)
        assert servo.read().voltage_V == pytest.approx(12.0)


@pytest.mark.parametrize(("name", "says"), [("NO_FAMILY", "names no ServoFamily"), ("NOTHING", "NOTHING")])
def test_what_is_no_family_is_one_line(installed, name, says):
    installed(name)
    with pytest.raises(DeviceError, match=f"entry point acme_servos.family:{name} of scanwright.servos: .*{says}"):
        families.all_families()


def test_every_model_has_a_product():
    for table in families.all_tables():
        assert load_catalogue().get(table.model, Servo).name == table.model
