"""A family of lidars from a package that is none of ours: found, driven and emulated without a line of this project."""

import sys

import numpy as np
import pytest

from design.angles import AngleSet
from design.catalogue import catalogue
from design.catalogue.catalogue import SHIPPED, load_catalogue
from design.catalogue.products import Lidar
from design.errors import DeviceError
from firmware_io.lidar import families
from firmware_io.lidar.families import family_of, open_lidar
from firmware_io.twins.scanner import emulated_scanner, room

# Ten turns a second of four beams, one line of text each: "range range range range" in millimetres.
FAMILY = """
import time

import numpy as np

from design.errors import DeviceTimeoutError
from firmware_io.lidar.byte_stream import next_heard, open_stream
from firmware_io.lidar.lidar import LidarFamily, TimedScan
from firmware_io.samples import Scan
from firmware_io.twins.lidar_line import LidarLine


class Acme:
    serial_number, firmware, model, scan_rate_hz, dropped, bad_packets = "1", "2", "ACME", 10.0, 0, 0

    def __init__(self, address, model, stamp_at):
        self.address, self.rest, self.stream = address, b"", open_stream(address)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stream.close()

    def start(self, *, intensity=False, cluster=1, skip=0):
        pass

    def stop(self):
        pass

    def read(self, timeout_s=None):
        lines, arrival_ns = next_heard(self.stream, "acme", time.monotonic() + (timeout_s or 5), self.lines, 100)
        range_m = np.array(lines[-1].split(), np.float32) / 1000
        scan = Scan(
            stamp_ns=arrival_ns - 100_000_000, angle_min_rad=0.0, angle_increment_rad=-np.pi / 2,
            time_increment_s=0.025, scan_time_s=0.1, range_min_m=0.0, range_max_m=60.0,
            range_m=range_m, intensity=range_m[:0],
        )
        return TimedScan(scan, arrival_ns, 1_000_000)

    def lines(self, data):
        *whole, self.rest = (self.rest + data).split(b"\\n")
        return [line for line in whole if len(line.split()) == 4]


class Machine:
    scanning = True

    def __init__(self, sight):
        self.sight, self.at_ns = sight, time.monotonic_ns()

    def hear(self, received, now_ns, /):
        return b"", b""

    def next_ns(self):
        return self.at_ns + 100_000_000

    def next_packets(self):
        time_ns = self.at_ns + 25_000_000 * np.arange(4)
        range_m, _ = self.sight(time_ns, -np.pi / 2 * np.arange(4))
        self.at_ns += 100_000_000
        numbers = np.where(np.isfinite(range_m), np.nan_to_num(range_m, posinf=0, neginf=0) * 1000, 0)
        return [(self.at_ns, (" ".join(f"{mm:.0f}" for mm in numbers) + "\\n").encode())]

    def leave_out(self, before_ns):
        self.at_ns = max(self.at_ns, before_ns)

    def power_cycle(self, now_ns):
        self.at_ns = now_ns


def twin(lidar, sight, seed):
    return LidarLine(lidar.name, Machine(sight), network=False, seed=seed)


FAMILY = LidarFamily("acme", "Acme", Acme, "acme_lidars.family:twin")
NO_FAMILY = 7
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A package with a family and its product, as `pip install` would leave it; what its entry point names."""

    def install(name):
        package, facts = tmp_path / "acme_lidars", tmp_path / "acme_lidars-1.dist-info"
        package.mkdir()
        facts.mkdir()
        (package / "__init__.py").write_text("")
        (package / "family.py").write_text(FAMILY)
        product = (SHIPPED / "ld19.toml").read_text().replace('name = "LD19"', 'name = "ACME"')
        (package / "acme.toml").write_text(product.replace('value = "ldrobot"', 'value = "acme"'))
        (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-lidars\nVersion: 1\n")
        (facts / "entry_points.txt").write_text(f"[scanwright.lidars]\nacme = acme_lidars.family:{name}\n")
        monkeypatch.syspath_prepend(tmp_path)

    forget = (catalogue._shipped.cache_clear, families.all_families.cache_clear)
    for clear in forget:
        clear()
    yield install
    for clear in forget:
        clear()
    for module in [name for name in sys.modules if name.startswith("acme_lidars")]:
        del sys.modules[module]


def test_a_lidar_of_a_package_of_its_own_sees_the_room(installed):
    installed("FAMILY")
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


@pytest.mark.parametrize(("name", "says"), [("NO_FAMILY", "names no LidarFamily"), ("NOTHING", "NOTHING")])
def test_what_is_no_family_is_one_line(installed, name, says):
    installed(name)
    with pytest.raises(DeviceError, match=f"entry point acme_lidars.family:{name} of scanwright.lidars: .*{says}"):
        families.all_families()


def test_a_lidar_that_nothing_drives_is_one_line():
    with pytest.raises(DeviceError, match="LMS 200: no driver"):
        family_of("LMS 200")


def test_every_family_of_the_catalogue_is_one():
    lidars = [product for product in load_catalogue() if isinstance(product, Lidar) and product.family]
    assert {product.family for product in lidars} == {family.name for family in families.FAMILIES}
