"""Families from a package that is none of ours: found, driven and emulated without a line of this project."""

import sys
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import pytest

from scanwright.design.angles import AngleSet
from scanwright.design.catalogue import catalogue
from scanwright.design.catalogue.catalogue import SHIPPED, load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import DeviceError
from scanwright.firmware_io.emulators.scanner import emulated_scanner
from scanwright.firmware_io.emulators.servo.emulator import ServoEmulator
from scanwright.firmware_io.emulators.world import room
from scanwright.firmware_io.lidar import families as lidar_families
from scanwright.firmware_io.lidar.families import family_of, open_lidar
from scanwright.firmware_io.servo import families as servo_families
from scanwright.firmware_io.servo.servo import open_servo

# Ten turns a second of four beams, one line of text each: "range range range range" in millimetres.
LIDAR = """
import time

import numpy as np

from scanwright.firmware_io.lidar.lidar import LidarFamily, TimedScan
from scanwright.firmware_io.lidar.sensor_line import LineDriver, SensorLine
from scanwright.firmware_io.samples import Scan
from scanwright.firmware_io.emulators.lidar_line import LidarLine


class Lines:
    bad = 0

    def __init__(self):
        self.rest = b""

    def feed(self, data, /):
        *whole, self.rest = (self.rest + data).split(b"\\n")
        return [line for line in whole if len(line.split()) == 4]

    def cut_in(self):
        pass


class Acme(LineDriver):
    serial_number, firmware, model, scan_rate_hz, dropped, bad_packets = "1", "2", "ACME", 10.0, 0, 0

    def __init__(self, address, model, stamp_at):
        self.address, self._line = address, SensorLine(address, 100)
        self._line.split_by(Lines())

    def condition(self):
        return ()

    def start(self, *, intensity=False, cluster=1, skip=0):
        pass

    def stop(self):
        pass

    def read(self, timeout_s=None):
        lines, arrival_ns = self._line.receive(time.monotonic() + (timeout_s or 5))
        range_m = np.array(lines[-1].split(), np.float32) / 1000
        scan = Scan(
            stamp_ns=arrival_ns - 100_000_000, angle_min_rad=0.0, angle_increment_rad=-np.pi / 2,
            time_increment_s=0.025, scan_time_s=0.1, range_min_m=0.0, range_max_m=60.0,
            range_m=range_m, intensity=range_m[:0],
        )
        return TimedScan(scan, arrival_ns, 1_000_000)


class Machine:
    scanning = True

    def __init__(self, sight):
        self.sight, self.at_ns = sight, time.monotonic_ns()

    def receive(self, received, now_ns, /):
        return b"", b""

    def next_ns(self):
        return self.at_ns + 100_000_000

    def next_packets(self):
        time_ns = self.at_ns + 25_000_000 * np.arange(4)
        range_m, _ = self.sight(time_ns, -np.pi / 2 * np.arange(4))
        self.at_ns += 100_000_000
        numbers = np.where(np.isfinite(range_m), np.nan_to_num(range_m, posinf=0, neginf=0) * 1000, 0)
        return [(self.at_ns, (" ".join(f"{mm:.0f}" for mm in numbers) + "\\n").encode())]

    def skip_to(self, before_ns):
        self.at_ns = max(self.at_ns, before_ns)

    def power_cycle(self, now_ns):
        self.at_ns = now_ns


def emulator(lidar, sight, seed):
    return LidarLine(lidar.name, Machine(sight), network=False, seed=seed)


FAMILY = LidarFamily("acme", "Acme", Acme, "acme.family:emulator")
NO_FAMILY = 7
"""

SERVO = """
from dataclasses import replace

from scanwright.firmware_io.servo.bus.registers import ControlTable
from scanwright.firmware_io.servo.families import ServoFamily
from scanwright.firmware_io.servo.feetech.packets import Sts
from scanwright.firmware_io.servo.feetech.tables import TABLES


class AcmePackets(Sts):
    protocol = "ACME"


TABLE = replace(TABLES[0], model="ACME-1", packets=AcmePackets(), number=4711)
FAMILY = ServoFamily("Acme", (TABLE,), (250_000,), "acme.family:Emulator")
NO_FAMILY = 7


def Emulator(table, load, time_ns, angle_rad):
    from scanwright.firmware_io.emulators.servo.feetech_machine import FeetechMachine

    made = FeetechMachine(table, load, time_ns, angle_rad)
    made.memory[3], made.memory[6] = 4711, 2
    return made
"""


@dataclass(frozen=True)
class Package:
    """What one group of entry points asks for: a module, its product, and who is to find it."""

    group: str
    module: str
    kind: str
    product: str
    families: ModuleType


LIDARS = Package(
    "scanwright.lidars",
    LIDAR,
    "LidarFamily",
    (SHIPPED / "ld19.toml").read_text().replace('name = "LD19"', 'name = "ACME"').replace('"ldrobot"', '"acme"'),
    lidar_families,
)
SERVOS = Package(
    "scanwright.servos",
    SERVO,
    "ServoFamily",
    (SHIPPED / "sts3215.toml").read_text().replace('name = "STS3215"', 'name = "ACME-1"'),
    servo_families,
)


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A package with a family and its product, as `pip install` would leave it; what its entry point names."""

    def install(package, name):
        folder, facts = tmp_path / "acme", tmp_path / "acme-1.dist-info"
        folder.mkdir()
        facts.mkdir()
        (folder / "__init__.py").write_text("")
        (folder / "family.py").write_text(package.module)
        (folder / "product.toml").write_text(package.product)
        (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1\n")
        (facts / "entry_points.txt").write_text(f"[{package.group}]\nacme = acme.family:{name}\n")
        monkeypatch.syspath_prepend(tmp_path)

    def forget():
        caches = (catalogue._shipped, lidar_families.all_families, servo_families.all_families)
        for cache in caches:
            cache.cache_clear()

    forget()
    yield install
    forget()
    for module in [name for name in sys.modules if name.partition(".")[0] == "acme"]:
        del sys.modules[module]


def test_a_lidar_of_a_package_of_its_own_sees_the_room(installed):
    installed(LIDARS, "FAMILY")
    assert load_catalogue().get("ACME", Lidar).family == family_of("ACME").name == "acme"
    level = {"alpha_rot": 0, "beta_rot": 0, "alpha_laser": 0, "beta_laser": 0}
    values = {"task": "a", "angles_deg": level, "sensor": "ACME", "servo": "MX-64R"}
    angles = AngleSet.model_validate({**values, "motion": {"mode": "spin", "period_s": 4.0}})
    with (
        emulated_scanner(angles, room(None), sigma_mm=0) as scanner,
        open_lidar(scanner.ports.lidar, "ACME") as lidar,
    ):
        lidar.start()
        scan = lidar.read().scan
    np.testing.assert_allclose(scan.range_m, [3.4, 2.4, 3.2, 3.2], atol=1.1)  # walls of the room, or what stands there
    assert scan.range_m.min() > 0.5


def test_a_servo_of_a_package_of_its_own_turns(installed):
    installed(SERVOS, "FAMILY")
    assert load_catalogue().get("ACME-1", Servo).maker == "Feetech"
    with ServoEmulator("ACME-1") as emulator:
        emulator.set_up(spins=True)
        with open_servo(emulator.port) as servo:
            assert (servo.model, servo.protocol, servo.baud) == ("ACME-1", "ACME", 250_000)
            servo.spin(1.0)
            assert servo.read().voltage_V == pytest.approx(12.0)


@pytest.mark.parametrize("package", [LIDARS, SERVOS], ids=["lidar", "servo"])
@pytest.mark.parametrize(("name", "says"), [("NO_FAMILY", "names no {kind}"), ("NOTHING", "NOTHING")])
def test_what_is_no_family_is_one_line(installed, package, name, says):
    installed(package, name)
    says = says.format(kind=package.kind)
    with pytest.raises(DeviceError, match=f"entry point acme.family:{name} of {package.group}: .*{says}"):
        package.families.all_families()
