"""The catalogue: every value has a source, and the numbers are those of the paper."""

import textwrap
import tomllib

import numpy as np
import pytest

from scanwright.design.catalogue.catalogue import KINDS, SHIPPED, file_of, load_catalogue, load_product
from scanwright.design.catalogue.holes import HolePattern, mounting_holes
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.catalogue.table import FIGURES, chosen, table_lines
from scanwright.design.errors import TaskError

FILES = sorted(SHIPPED.glob("*.toml"))
RING = """kind = "slip_ring"
name = "MY-RING"
maker = "me"
bore_mm = { value = 14.0, source = "calipers", verified = true }
outer_diameter_mm = { value = 60.0, source = "calipers", verified = true }
length_mm = { value = 40.0, source = "calipers", verified = false }
mass_g = { value = 150.0, source = "scale", verified = true }
circuits = { value = "USB 2.0", source = "label", verified = true }
"""


@pytest.fixture
def shipped():
    return load_catalogue()


def write(tmp_path, text, name="mine.toml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_all_products_of_the_issue_are_there(shipped):
    by_kind = {kind: {p.name for p in shipped if isinstance(p, kind)} for kind in (Lidar, Servo, SlipRing, Printer)}
    hokuyo = {"UTM-30LX", "UTM-30LX-EW", "URG-04LX", "URG-04LX-UG01", "UST-10LX", "UST-20LX"}
    sick = {"LMS 200", "LMS 291", "LMS111", "LMS151", "LMS511", "TiM551", "TiM561", "TiM571", "TiM781"}
    cheap = {
        "LD06",
        "LD19",
        "STL27L",
        "RPLIDAR A1",
        "RPLIDAR A2",
        "RPLIDAR A3",
        "RPLIDAR S1",
        "RPLIDAR S2",
        "RPLIDAR C1",
        "RPLIDAR S2L",
        "RPLIDAR S3",
        "STL-19P",
    }
    assert by_kind[Lidar] == {*hokuyo, *sick, *cheap}
    assert by_kind[Servo] == {
        *(
            "AX-12A",
            "MX-28",
            "MX-64R",
            "MX-106",
            "XL330-M288",
            "XL430-W250",
            "XM430-W350",
            "XH430-W350",
            "XM540-W270",
            "STS3215",
        ),
    }
    assert by_kind[SlipRing] == {"UH1256-02-0610-06S", "SNU11-P0210", "SRC022A-6"}
    assert by_kind[Printer] == {"fdm-0.4", "fdm-0.4-insert", "fdm-0.4-nut", "sla"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_value_has_a_source_and_says_whether_it_is_verified(path):
    product = load_product(path)
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    values = set(table) - {"kind", "name", "maker"}
    assert values
    assert set(product.provenance()) == values
    for field, origin in product.provenance().items():
        assert len(origin.source.strip()) > 5 or origin.source == "assumed", field
        if origin.source.startswith("assumed"):
            assert not origin.verified, f"{field} is assumed and cannot be verified"
    in_use = {name for name in type(product).model_fields if getattr(product, name) is not None}
    assert in_use - values == {"kind", "name", "maker"}, "a value without a source"
    assert product.unverified() == [f for f in product.provenance() if not table[f]["verified"]]


# typed from the paper, Tables 1 and 2 and sections 3.1 to 3.3
@pytest.mark.parametrize(
    ("name", "range_m", "fan_deg", "step_deg", "rate_hz", "wavelength_nm", "mass_g", "price_usd"),
    [("URG-04LX", 4, 240, 0.36, 10, 785, 160, 2000), ("UTM-30LX", 30, 270, 0.25, 40, 905, 370, 5000)],
)
def test_table_1_of_the_paper(shipped, name, range_m, fan_deg, step_deg, rate_hz, wavelength_nm, mass_g, price_usd):
    lidar = shipped.get(name, Lidar)
    assert lidar.range_max_mm == range_m * 1000
    bearings = np.degrees(lidar.bearings_rad())
    assert np.ptp(bearings) == pytest.approx(fan_deg, abs=0.7)  # the URG's 240 deg are 239.4
    assert np.diff(bearings) == pytest.approx(step_deg, abs=0.01)
    assert lidar.scan_rate_hz == rate_hz
    assert lidar.wavelength_nm == wavelength_nm
    assert lidar.mass_g == mass_g
    assert lidar.price_usd == price_usd


@pytest.mark.parametrize(
    ("name", "mass_g", "size_mm", "range_deg", "step_deg", "steps", "price_usd"),
    [
        ("AX-12A", 54.6, (32, 50, 40), 300, 0.29, 1024, 50),
        ("MX-64R", 126, (40.2, 61.1, 41), 360, 0.09, 4096, 300),
    ],
)
def test_table_2_of_the_paper(shipped, name, mass_g, size_mm, range_deg, step_deg, steps, price_usd):
    servo = shipped.get(name, Servo)
    case = np.subtract(servo.case_max_mm, servo.case_min_mm)
    assert servo.mass_g == mass_g
    np.testing.assert_allclose(case[:2], size_mm[:2])
    # the AX-12A's 40 mm include its horn, the MX-64's 41 mm do not
    assert size_mm[2] == pytest.approx(case[2]) or size_mm[2] == pytest.approx(case[2] + servo.horn_thickness_mm)
    assert servo.angular_range_deg == range_deg
    assert servo.position_step_deg == pytest.approx(step_deg, abs=0.005)
    assert servo.angular_range_deg / servo.position_step_deg == pytest.approx(steps)
    assert servo.price_usd == price_usd


def test_the_beam_tables_of_the_lidars(shipped):
    for name, count, first, last in [
        ("UTM-30LX", 1081, -135.0, 135.0),
        ("UST-10LX", 1081, -135.0, 135.0),
        ("URG-04LX", 682, -119.53, 119.88),
    ]:
        bearings = np.degrees(shipped.get(name, Lidar).bearings_rad())
        assert len(bearings) == count
        assert bearings[0] == pytest.approx(first, abs=0.005)
        assert bearings[-1] == pytest.approx(last, abs=0.005)
        np.testing.assert_allclose(np.diff(bearings), (last - first) / (count - 1), atol=1e-4)
        assert np.abs(bearings).min() < 1e-9, "one beam looks straight ahead"


def test_what_the_issue_says_of_the_rings(shipped):
    uh = shipped.get("UH1256-02-0610-06S", SlipRing)
    assert (uh.bore_mm, uh.outer_diameter_mm) == (12.7, 56)
    assert "length_mm" in uh.unverified() and (uh.length_mm, uh.rotor.length_mm) == (88.5, 6)
    assert (uh.friction_nm, uh.data) == ((0.16, 0.2), "usb2")
    snu = shipped.get("SNU11-P0210", SlipRing)
    assert snu.price_usd == 130 and snu.length_mm == 38
    assert {ring.stator_exit for ring in (uh, snu)} == {"end"}
    assert snu.leads_mm(1) == 6 and snu.leads_mm(2) == pytest.approx(6 / 2**0.5, abs=0.005)
    assert "length_mm" in snu.unverified() and snu.friction_nm == (0.1, 0.13)


@pytest.mark.parametrize(
    ("name", "kind", "words"),
    [
        ("UTM30LX", Lidar, ["lidar", "did you mean 'UTM-30LX'"]),
        ("utm-30lx", Lidar, ["did you mean 'UTM-30LX'"]),
        ("MX-64R", Lidar, ["lidar"]),
        ("MX64", Servo, ["servo", "did you mean 'MX-64R'"]),
        ("zzz", SlipRing, ["slip ring", "known: SNU11-P0210, SRC022A-6, UH1256-02-0610-06S"]),
        ("fdm", Printer, ["printer", "did you mean 'fdm-0.4'"]),
        ("UTM30LX", Product, ["did you mean 'UTM-30LX'"]),
    ],
)
def test_an_unknown_product_suggests_the_nearest(shipped, name, kind, words):
    with pytest.raises(TaskError) as caught:
        shipped.get(name, kind)
    for word in [f"'{name}'", *words]:
        assert word in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_of_ones_own_adds_a_product_and_leaves_the_shipped_ones(tmp_path, shipped):
    mine = load_catalogue(write(tmp_path, RING))
    assert mine.get("MY-RING", SlipRing).bore_mm == 14
    assert mine.get("MY-RING", SlipRing).unverified() == ["length_mm"]
    assert {p.name for p in mine} == {p.name for p in shipped} | {"MY-RING"}
    assert "MY-RING" not in {p.name for p in load_catalogue()}


def test_a_file_of_ones_own_replaces_and_the_last_one_wins(tmp_path):
    text = RING.replace("MY-RING", "SNU11-P0210")
    first = write(tmp_path, text, "a.toml")
    second = write(tmp_path, text.replace("14.0", "15.0"), "b.toml")
    assert load_catalogue(first).get("SNU11-P0210", SlipRing).bore_mm == 14
    assert load_catalogue(first, second).get("SNU11-P0210", SlipRing).bore_mm == 15
    assert load_catalogue(second, first).get("SNU11-P0210", SlipRing).bore_mm == 14
    assert load_catalogue().get("SNU11-P0210", SlipRing).bore_mm == 12.7


LIDAR = (SHIPPED / "utm-30lx.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("kind = ", ["not a TOML file"]),
        (RING.replace('"slip_ring"', '"slipring"'), ["kind", "did you mean 'slip_ring'"]),
        (RING.replace('kind = "slip_ring"', ""), ["kind"]),
        (RING.replace('kind = "slip_ring"', "kind = []"), ["kind"]),
        (RING.replace("bore_mm", "bore"), ["bore", "did you mean 'bore_mm'"]),
        (RING.replace("14.0", "-1.0"), ["bore_mm", "-1.0", "greater than or equal to 0"]),
        (RING.replace("14.0", "nan"), ["bore_mm", "nan"]),
        (RING.replace("14.0", '"wide"'), ["bore_mm", "wide"]),
        (RING + 'mass_kg = { value = 1.0, source = "x", verified = true }\n', ["mass_kg", "did you mean 'mass_g'"]),
        (RING.replace('{ value = 14.0, source = "calipers", verified = true }', "14.0"), ["bore_mm", "source"]),
        (RING.replace(", verified = false", ""), ["length_mm", "verified"]),
        (RING.replace('"label"', "7"), ["circuits"]),
        (RING.replace("verified = false", 'verified = "perhaps"'), ["length_mm"]),
        ("\n".join(RING.splitlines()[:-1]), ["circuits", "required"]),
        (RING.replace('name = "MY-RING"', ""), ["name", "required"]),
        (RING.replace('maker = "me"', 'maker = "me"\nname_de = "Ring"'), ["name_de"]),
        (LIDAR.replace("value = 1080", "value = 1440"), ["1440", "per turn"]),
        (LIDAR.replace("value = 1080", "value = 0"), ["0..0"]),
        (LIDAR.replace("value = 100.0", "value = 40000.0"), ["range_min_mm", "range_max_mm"]),
    ],
)
def test_a_malformed_file_is_one_line_that_names_the_file_and_the_field(tmp_path, text, words):
    path = write(tmp_path, text)
    with pytest.raises(TaskError) as caught:
        load_catalogue(path)
    message = str(caught.value)
    assert "\n" not in message
    for word in [str(path), *words]:
        assert word in message


def test_a_missing_file_and_a_folder_are_one_line(tmp_path):
    (tmp_path / "latin.toml").write_bytes(b"\xff\xfe")
    for path in (tmp_path / "none.toml", tmp_path, tmp_path / "latin.toml"):
        with pytest.raises(TaskError) as caught:
            load_catalogue(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_the_table_has_a_row_for_every_product_and_a_mark_for_every_doubt(shipped):
    lines = table_lines(shipped)
    assert set(FIGURES) == set(KINDS.values())
    rows = {line.split("  ")[0]: line for line in lines}
    assert {product.name for product in shipped} <= set(rows)
    assert rows["UTM-30LX"].split()[:9] == ["UTM-30LX", "30", "15", "0.1", "270", "0.25", "40", "10", "370"]
    assert "price_usd" in shipped.named("VLP-16").unverified() and "8,000?" in rows["VLP-16"]
    assert table_lines([]) == ["no product of the catalogue matches"]


def test_a_short_table_fits_a_screen_and_leaves_no_product_out(shipped):
    for kind in (None, *KINDS):
        products = chosen(shipped, kind=kind)
        lines = [row for line in table_lines(products, in_full=False) for row in line.splitlines()]
        assert len(lines) <= 25 and max(map(len, lines)) <= 100
        words = " ".join(" ".join(lines).split())
        assert all(product.name in words for product in products)
    for product in shipped:
        rows = [row for line in product.lines(in_full=False) for row in textwrap.wrap(line, 100)]
        assert len(rows) <= 22  # the table of its figures comes before them
        assert all(f"{field} = " in " ".join(rows) for field in product.unverified())


def test_a_filter_keeps_what_is_known_to_keep_it(shipped):
    assert {p.name for p in chosen(shipped, kind="servo", max_price_usd=60)} == {
        "AX-12A",
        "STS3215",
        "XL330-M288",
        "XL430-W250",
    }
    cheap = chosen(shipped, max_price_usd=1e9)
    assert all(p.price_usd is not None for p in cheap) and "MX-28" not in {p.name for p in cheap}
    assert {p.kind for p in chosen(shipped, min_range_m=15)} == {"lidar"}
    far = {p.name for p in chosen(shipped, min_range_m=20)}
    assert "UTM-30LX-EW" in far and "UTM-30LX" not in far, "its users get 15 m"
    assert len(chosen(shipped)) == len(shipped.products)


def test_every_product_tells_its_values_in_words():
    """Records of a product too: the flange of a capsule, the circuits of a ring, the leads of a lidar."""
    for product in load_catalogue():
        assert len(product.lines()) == len(product.provenance()) + 2
    assert any('"count": 6' in line for line in load_catalogue().named("SRC022A-6").lines())


def entry(value, verified=True):
    return f'{{ value = {value}, source = "calliper", verified = {str(verified).lower()} }}'


def old_fields(text, old):
    """A product file of version 0.1: its mounting holes by other fields."""
    lines = [line for line in text.splitlines() if not line.startswith("holes = ")]
    return "\n".join([*lines, *(f"{field} = {value}" for field, value in old.items())]) + "\n"


def test_a_lidar_file_of_version_0_1_states_threads_in_the_base(tmp_path):
    text = old_fields(
        LIDAR,
        {
            "mount_screw": entry('"M2.5"'),
            "mount_holes_mm": entry("[[10, 20], [-10, 20], [0, -20]]", verified=False),
            "mount_thread_depth_mm": entry("5.0"),
        },
    )
    lidar = load_catalogue(write(tmp_path, text)).get("UTM-30LX", Lidar)
    assert lidar.base == HolePattern("M2.5", "tapped", ((10, 20), (-10, 20), (0, -20)), 0.0, 5.0)
    assert "holes" in lidar.unverified()
    assert set(lidar.provenance()) >= {"holes"} and "mount_screw" not in lidar.provenance()


def test_a_servo_file_of_version_0_1_states_ears_for_nuts(tmp_path):
    text = old_fields(
        (SHIPPED / "mx-64r.toml").read_text(encoding="utf-8"),
        {
            "case_screw": entry('"M3"'),
            "case_holes_mm": entry("[[11, 4], [-11, 4]]"),
            "case_holes_z_mm": entry("-6.0"),
            "case_rear_holes_mm": entry("[[9, 4], [-9, 4], [9, -4], [-9, -4]]"),
            "case_rear_holes_z_mm": entry("-30.0"),
        },
    )
    servo = load_catalogue(write(tmp_path, text)).get("MX-64R", Servo)
    assert servo.front == HolePattern("M3", "through", ((11, 4), (-11, 4)), -6.0, 2.0)
    assert (len(servo.rear.places), servo.rear.z_mm) == (4, -30.0)
    assert "holes" not in servo.unverified()


def test_an_old_file_that_lacks_one_of_the_fields_is_refused(tmp_path):
    text = old_fields(LIDAR, {"mount_screw": entry('"M3"'), "mount_thread_depth_mm": entry("5.0")})
    with pytest.raises(TaskError, match="holes"):
        load_catalogue(write(tmp_path, text))


def test_no_screw_of_a_case_no_pin_and_no_slot_is_ever_used(shipped):
    for product in shipped:
        for hole in getattr(product, "holes", ()):
            if hole.kind in ("case_screw", "pin", "slot"):
                pattern = mounting_holes([hole], hole.axis)
                assert pattern.places == (), product.name


# typed from the makers' drawings
@pytest.mark.parametrize(
    ("name", "screw", "kind", "places"),
    [
        ("STL27L", "M2", "through", {(0, 23.4), (23.4, -8.5), (-23.4, -8.5)}),
        ("UST-10LX", "M3", "tapped", {(20, 20), (-20, -20)}),
        ("RPLIDAR C1", "M2.5", "tapped", {(21.5, 21.5), (-21.5, 21.5), (-21.5, -21.5), (21.5, -21.5)}),
        ("LMS111", "M3", "tapped", set()),
    ],
)
def test_a_plate_uses_the_holes_that_the_base_of_a_lidar_has(shipped, name, screw, kind, places):
    base = shipped.get(name, Lidar).base
    assert (base.screw, base.kind, set(base.places)) == (screw, kind, places)


def test_an_x_servo_is_held_by_its_front_alone(shipped):
    for name, depth in (("XL430-W250", 3.8), ("XM430-W350", 3.0)):
        servo = shipped.get(name, Servo)
        assert servo.rear.places == ()
        assert set(servo.front.places) == {(11, -8), (-11, -8)}
        assert (servo.front.screw, servo.front.depth_mm, servo.front.z_mm) == ("M2.5", depth, -2.0)


@pytest.mark.parametrize(
    ("name", "range_mm", "sigma_mm"),
    [
        ("UST-10LX", [100, 9000], [30, 30]),
        ("STL27L", [1000, 5000, 20000], [5, 15, 25]),
        ("URG-04LX", [500, 2000, 4000], [10, 20, 40]),  # Schubert 2016, Table 1: 1 % beyond 1 m
        ("RPLIDAR A1", [1500, 3000, 6000], [15, 60, 240]),  # square of the range
    ],
)
def test_the_noise_of_a_range_depends_on_the_range(shipped, name, range_mm, sigma_mm):
    assert shipped.get(name, Lidar).sigma_mm(range_mm) == pytest.approx(sigma_mm)


def test_noise_without_an_end_is_that_at_the_end_of_the_range(shipped):
    a1 = shipped.get("RPLIDAR A1", Lidar)
    assert a1.sigma_mm(np.inf) == a1.sigma_mm(a1.range_max_mm)


# typed from the makers' sheets: lowest and highest voltage at the device
@pytest.mark.parametrize(
    ("name", "volts"),
    [
        ("RPLIDAR C1", (4.8, 5.2)),
        ("RPLIDAR S2", (4.9, 5.2)),
        ("RPLIDAR S1", (4.8, 5.5)),
        ("RPLIDAR A2", (4.9, 5.5)),
        ("RPLIDAR A3", (4.9, 5.5)),
        ("LD06", (4.5, 5.5)),
        ("LD19", (4.5, 5.5)),
        ("STL27L", (4.5, 5.5)),
        ("UTM-30LX", (10.8, 13.2)),
        ("UST-10LX", (10.0, 30.0)),
        ("TiM561", (9.0, 28.0)),
        ("LMS111", (10.8, 30.0)),
        ("XL430-W250", (6.5, 12.0)),
        ("XL330-M288", (3.7, 6.0)),
        ("AX-12A", (9.0, 12.0)),
        ("MX-64R", (10.0, 14.8)),
    ],
)
def test_supplies_are_those_that_the_makers_allow(shipped, name, volts):
    assert shipped.named(name).supply_v == volts


def test_start_and_inrush_currents_are_those_of_the_makers(shipped):
    lidars = {name: shipped.get(name, Lidar) for name in ("RPLIDAR A2", "RPLIDAR A3", "RPLIDAR S2", "STL27L", "LD19")}
    assert {name: (lidar.current_a, lidar.peak_a, lidar.inrush_a) for name, lidar in lidars.items()} == {
        "RPLIDAR A2": (0.6, 2.5, None),
        "RPLIDAR A3": (0.6, 2.5, None),
        "RPLIDAR S2": (0.6, 1.5, 2.5),
        "STL27L": (0.29, 0.54, None),
        "LD19": (0.18, 0.3, None),
    }


@pytest.mark.parametrize("name", ["LD19", "XL430-W250"])
def test_the_file_of_a_product_is_found(name):
    assert load_product(file_of(name)).name == name
