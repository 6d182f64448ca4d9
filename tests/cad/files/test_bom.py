"""`bom.csv` and `assembly.md`: what the solids ask for, against the catalogue and plain arithmetic."""

import csv
import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scanners import CAPSULE, RING, ROLLING, TILTED, scanner_at

from scanwright.cad.assembly.make import make_parts
from scanwright.cad.assembly.print_settings import hours_in_words, print_hours
from scanwright.cad.assembly.scenes import scenes_of
from scanwright.cad.checks.access import blades_mm
from scanwright.cad.files.bom import _wiring, bom_text, items_of
from scanwright.cad.files.manual.instructions import instructions_text
from scanwright.cad.files.prices import EACH_USD
from scanwright.cad.geometry.holes import rounds_of
from scanwright.cad.layout.joints import LENGTHS, shank_mm
from scanwright.cad.layout.placement import placement_of
from scanwright.cad.parts.all_parts import laid_out, parts_of
from scanwright.cad.parts.part_spec import PartSpec
from scanwright.cad.screws import INSERT_LENGTH, SCREWS
from scanwright.design.angles import Angles
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.product_base import Provenance
from scanwright.design.catalogue.servo import Servo


@pytest.fixture(scope="module")
def rows(made):
    return list(csv.DictReader((made.folder / "bom.csv").read_text(encoding="utf-8").splitlines()))


@pytest.fixture(scope="module")
def steps(made):
    return (made.folder / "assembly.md").read_text(encoding="utf-8")


def test_every_made_part_is_listed_once_with_its_mass(rows, made):
    listed = {row["part"]: row for row in rows if row["kind"] in ("printed", "turned", "sawn")}
    assert listed.keys() == {part.name for part in made.result.parts}
    for part in made.result.parts:
        assert float(listed[part.name]["mass_g"]) == pytest.approx(part.mass_g, abs=0.051)
    assert listed["servo_shaft"]["kind"] == "turned"
    assert len({row["number"] for row in listed.values()}) == len(listed)


def test_a_turned_part_weighs_what_its_alloy_does(rows, made):
    densities = {"7075": 2.81, "6082": 2.70}  # g/cm3
    notes = {row["part"]: row["note"] for row in rows if row["kind"] == "turned"}
    assert {"servo_shaft", "journal_sleeve"} <= notes.keys()
    for part in made.result.parts:
        if part.name in notes:
            density = next(value for alloy, value in densities.items() if alloy in notes[part.name])
            assert part.mass_g == pytest.approx(density * part.volume_mm3 / 1e3, rel=1e-4)


def test_prices_are_the_catalogues_and_unknown_ones_stay_empty(rows, made):
    bought = {row["part"]: row for row in rows if row["kind"] == "bought"}
    assert float(bought["lidar"]["unit_usd"]) == made.scanner.lidar.price_usd == 5000
    assert bought["lidar"]["verified"] == bought["slip ring"]["verified"] == "yes"
    assert all(row["source"] for row in rows if row["unit_usd"])
    assert all(row["unit_usd"] == "" for row in rows if row["kind"] in ("screw", "nut", "wiring", "printed", "turned"))
    total = next(row for row in rows if row["kind"] == "total")
    assert float(total["total_usd"]) == sum(float(row["total_usd"]) for row in bought.values() if row["total_usd"])
    without = sum(row["total_usd"] == "" for row in rows)
    assert f"{without} rows without a price" in total["note"]
    assert total["quantity"] == ""


def test_every_row_has_a_price_or_a_stated_estimate_and_the_total_is_their_range(rows):
    assert [row["part"] for row in rows if row["low_usd"] == ""] == []
    for row in rows:
        assert 0 <= float(row["low_usd"]) <= float(row["high_usd"])
        if row["kind"] not in ("printed", "total") and row["total_usd"] == "":
            assert "usual prices in 2026" in row["note"] + row["source"], row
        if row["total_usd"] and row["kind"] != "total":  # none is both verified and of these years
            assert float(row["low_usd"]) < float(row["total_usd"]) < float(row["high_usd"])
    *parts, total = rows
    for end in ("low_usd", "high_usd"):
        assert float(total[end]) == pytest.approx(sum(float(row[end]) for row in parts), abs=0.5)
    assert next(row["priced"] for row in rows if row["part"] == "lidar") == "2016"
    plastic = next(row for row in rows if row["kind"] == "material")
    printed = sum(float(row["mass_g"]) for row in rows if row["kind"] == "printed")
    assert float(plastic["mass_g"]) == pytest.approx(1.1 * printed, abs=0.1)
    assert float(plastic["high_usd"]) == pytest.approx(1.1 * printed / 1000 * 35, abs=0.01)
    assert {"threadlocker, medium strength", "grub screw"} <= {row["part"] for row in rows}
    assert sum(row["kind"] == "tool" for row in rows) >= 4
    assert "EN AW-7075-T6" in next(row["note"] for row in rows if row["part"] == "servo_shaft")
    assert all(row["number"] or row["supplier"] for row in rows if row["kind"] in ("bought", "screw", "nut"))


@pytest.mark.parametrize("slip_ring", [RING, CAPSULE])
def test_every_small_thing_of_a_drive_has_an_estimate(slip_ring):
    parts = parts_of(placement_of(scanner_at(ROLLING, slip_ring=slip_ring)))
    needs = [row for part in parts if isinstance(part, PartSpec) for row in part.rows]
    assert needs and {need.estimate for need in needs} <= EACH_USD.keys()


def test_the_steps_warn_before_the_first_wire(steps):
    (wiring,) = (step for step in steps.split("\n## ") if "Look, then wire" in step.splitlines()[0])
    assert wiring.index("Caution, before you join a wire") < wiring.index("with a multimeter")
    assert wiring.index("with a multimeter") < wiring.index("Turn the linkage by hand")


def test_the_tools_are_those_that_the_steps_ask_for(rows, made):
    steps = (made.folder / "assembly.md").read_text(encoding="utf-8")
    tools = {row["part"] for row in rows if row["kind"] == "tool"}
    assert ("join the leads" in steps) == ("crimping pliers" in tools)
    assert ("heat-set insert" in steps) == ("soldering iron" in tools)
    assert ("spring scale" in steps) == ("spring scale" in tools)
    assert any("crimps" in row["part"] for row in rows)


def test_a_driver_longer_than_a_key_is_in_the_steps_and_among_the_tools(made):
    assembly = made.result.assembly
    first, *others = (joint for joint in assembly.layout.joints if joint.screw.name == "M3")
    blades = {first: 80, others[0]: 120, others[1]: 151}
    text = instructions_text(assembly, scenes_of(assembly), [], blades)
    assert [text.count(f", with a long driver (blade {n} mm).**") for n in (80, 120)] == [1, 1]
    assert text.count(", with a long driver (blade over 150 mm).**") == 1
    items = items_of(assembly, dict.fromkeys(assembly.made, 1.0), [], blades)
    assert [item.part for item in items if item.estimate == "long driver"] == [
        "hexagon driver for M3 (blade over 150 mm)"
    ]


def test_the_drivers_of_a_build_are_those_of_its_steps(rows, made):
    blades = blades_mm(made.result.assembly)
    steps = (made.folder / "assembly.md").read_text(encoding="utf-8")
    assert steps.count("with a long driver") == len(blades)
    sizes = {row["part"].split()[3] for row in rows if row["part"].startswith("hexagon driver")}
    assert sizes == {joint.screw.name for joint in blades}


def test_a_spare_of_each_fuse_is_counted_and_paid(rows, made):
    wiring = (made.folder / "wiring.md").read_text(encoding="utf-8")
    for row in rows:
        if "blade fuse" in row["part"]:
            used = len(re.findall(rf"^- F\d+, .*fuse {row['part'].removeprefix('blade fuse, ')},", wiring, re.M))
            assert (int(row["quantity"]), row["note"].split(";")[0]) == (used + 1, f"{used} in use, 1 spare")
            assert float(row["low_usd"]) == pytest.approx(0.3 * (used + 1))


def test_there_is_a_cable_tie_for_every_place_that_the_layout_has(rows, made):
    (row,) = [row for row in rows if row["part"] == "cable tie, 2.5 mm"]
    layout = made.result.assembly.layout
    assert layout.linkage.hub_tie is not None and not layout.linkage.plate_ties
    assert (row["quantity"], row["note"].split(";")[0]) == (
        "4",
        "1 at the hub, 2 at the coil, 1 at the foot of the mount",
    )


def test_what_the_paper_asks_for_is_there(rows):
    wiring = [row["part"] for row in rows if row["kind"] == "wiring"]
    assert any("12 V" in part for part in wiring)


@pytest.mark.parametrize("lidar", [product.name for product in load_catalogue() if isinstance(product, Lidar)])
def test_what_takes_each_cable_of_a_lidar_is_bought_and_no_cable_that_is_fixed_to_it(lidar):
    scanner = scanner_at(ROLLING, sensor=lidar)
    items = list(_wiring(scanner))
    parts = [item.part for item in items]
    assert {item.estimate for item in items if item.estimate} <= EACH_USD.keys()
    for cable in scanner.lidar.cables:
        taken = "terminal block" if cable.end == "bare" else f"{cable.end} socket"
        assert any(part.startswith(taken) for part in parts)
    assert sum("lead for the plug" in part for part in parts) == sum(not cable.fixed for cable in scanner.lidar.cables)
    assert not any("socket" in item.part for item in _wiring(replace(scanner, slip_ring=None)))


@pytest.mark.parametrize(
    ("servo", "listed", "price"),
    [
        ("STS3215", ["USB bus board for Feetech servos, such as Waveshare's", "servo cable, 3 pins, with power"], 10.6),
        (
            "XL330-M288",
            [
                "USB adapter to Dynamixel servos, such as ROBOTIS U2D2",
                "servo cable, 3 pins, with power",
            ],
            None,
        ),
    ],
)
def test_a_servo_brings_its_adapter_and_cable(made, servo, listed, price):
    scanner = replace(made.scanner, servo=load_catalogue().get(servo, Servo))
    rows = [item for item in _wiring(scanner) if "lidar" not in item.part]
    assert [item.part for item in rows][1 : 1 + len(listed)] == listed
    assert [item.total_usd for item in rows if item.total_usd is not None] == ([] if price is None else [price])


def test_screws_are_those_of_the_catalogue_and_none_bottoms(rows, made):
    counts = {}
    for row in rows:
        if row["kind"] == "screw":
            for count, part, onto in re.findall(r"(\d+) (\w+) to (\w+)", row["note"]):
                counts[part, onto] = (int(count), row["number"])
    lidar, servo = made.scanner.lidar, made.scanner.servo
    assert counts["servo_shaft", "servo_horn"] == (servo.horn_holes, "ISO 4762 M2.5 x 6")
    count, number = counts["alignment_linkage", "lidar_body"]
    assert count == len(lidar.base.places)
    length = int(number.removeprefix(f"ISO 4762 {lidar.base.screw} x "))
    plate = 8.0
    assert 2 * 3.0 <= length - plate < lidar.base.depth_mm
    assert counts["base_mount", "servo_case"][0] == 4 and counts["base_mount", "deck"] == (4, "ISO 4762 M4 x 16")
    assert counts["alignment_linkage", "servo_shaft"] == (2, "ISO 4762 M3 x 12")
    assert [row["quantity"] for row in rows if row["number"].startswith("ISO 4026")] == ["2"]  # of the sleeve


def test_steps_and_list_name_the_same_screws(rows, steps):
    listed = {row["number"]: int(row["quantity"]) for row in rows if row["kind"] == "screw"}
    used = {}
    for count, number in re.findall(r"(\d+) x (ISO \d+ M[\d.]+ x \d+)", steps):
        used[number] = used.get(number, 0) + int(count)
    assert used == listed
    nuts = {row["number"].split()[-1]: int(row["quantity"]) for row in rows if row["kind"] == "nut"}
    told = {}
    for count, size in re.findall(r"(?:with|onto) (\d+) nuts (M[\d.]*\d)", steps):
        told[size] = told.get(size, 0) + int(count)
    assert told == nuts
    assert "{" not in steps


def test_the_shaft_comes_before_what_goes_over_it(steps):
    titles = [re.sub(r"^## \d+\. ", "", line) for line in steps.splitlines() if line.startswith("## ")]
    order = ["Servo into the mount", "Shaft on the horn", "Adapter on the servo", "Slip ring", "Linkage on the shaft"]
    assert [title for title in titles if title in order] == order


@given(
    st.sampled_from(sorted(LENGTHS)),
    st.floats(2, 12),
    st.sampled_from(["thread", "nut", "deck", "grub"]),
    st.floats(1.5, 12),
)
def test_a_screw_never_bottoms_and_holds_where_it_can(name, grip, fixing, depth):
    length = shank_mm(SCREWS[name], grip, fixing, depth)
    assert length in LENGTHS[name]
    if fixing == "thread":
        assert length <= grip + depth - 0.5 or length == min(LENGTHS[name])
        longer = [n for n in LENGTHS[name] if length < n <= grip + depth - 0.5]
        assert length >= grip + 2 * SCREWS[name].nominal or not longer
    elif fixing in ("nut", "deck"):
        assert length >= grip + depth + 0.8 * SCREWS[name].nominal or length == max(LENGTHS[name])


@pytest.fixture(scope="module")
def upright(made):
    """An upright scanner without mount and ring, its hub in the way of a screw, its ring without a price."""
    angles = Angles(alpha_rot=0, beta_rot=0, alpha_laser=25, beta_laser=-20)
    return replace(
        made.scanner, angles=made.scanner.angles.model_copy(update={"angles_deg": angles, "slip_ring": None})
    )


def test_what_a_scanner_does_not_have_is_not_listed(upright):
    scanner = replace(upright, slip_ring=None, lidar=upright.lidar.model_copy(update={"price_usd": None}))
    assembly = make_parts(scanner)
    joints = assembly.layout.joints
    masses = dict.fromkeys(assembly.made, 1.0)
    items = items_of(assembly, masses)
    assert "slip ring" not in {item.part for item in items}
    lidar = next(item for item in items if item.part == "lidar")
    assert lidar.unit_usd is None and "price unknown" in lidar.note
    assert items[-1].total_usd == scanner.servo.price_usd
    assert bom_text(items).count("\n") == len(items) + 1
    text = instructions_text(assembly, scenes_of(assembly), [])
    assert "Servo on the deck" in text and "loose loop" in text and "Slip ring" not in text
    assert not any("cable tie" in item.part for item in items) and "behind the plate" not in text
    seat = next(joint for joint in joints if joint.onto == "lidar_body")
    assert (seat.part, seat.count) == ("sub_plate", 4)


def test_a_tie_behind_the_plate_is_named_without_a_ring():
    assembly = make_parts(scanner_at((0, 0, 0, 0), slip_ring=None, sensor="URG-04LX", servo="AX-12A"))
    (tie,) = (item for item in items_of(assembly, dict.fromkeys(assembly.made, 1.0)) if "cable tie" in item.part)
    assert (tie.quantity, tie.note.split(";")[0]) == (1, "1 at the plate")
    assert "the two slots of each tab behind the plate" in instructions_text(assembly, scenes_of(assembly), [])


def test_what_is_not_verified_is_measured_before_anything_is_printed(made):
    assembly, lidar = made.result.assembly, made.scanner.lidar.model_copy()
    lidar._provenance = lidar.provenance() | {"holes": Provenance(source="assumed", verified=False)}
    layout = replace(assembly.layout, scanner=replace(made.scanner, lidar=lidar))
    changed = replace(assembly, layout=layout)
    text = instructions_text(changed, scenes_of(changed), [])
    first = re.search(rf"Measure first, no source verifies [^:]*holes[^:]* of {lidar.name}: press paper", text)
    assert first and first.end() < text.index("Try the hole patterns before you print")
    assert "Measure first" not in text[text.index("## 1.") :]


def test_the_time_to_print_is_that_of_the_plates(rows, made):
    masses = {row["part"]: float(row["mass_g"]) for row in rows if row["kind"] == "printed"}
    hours = print_hours(sum(masses.values()), made.scanner.printer)
    assert hours == pytest.approx(sum(masses.values()) / 1.24 / 17.5)
    (plastic,) = (row for row in rows if row["kind"] == "material")
    assert plastic["note"].startswith(f"{hours_in_words(hours)} to print with supports")
    assert f"; {sum(masses.values()):.1f} g of parts, 10% more for supports" in plastic["note"]
    assert float(plastic["mass_g"]) == pytest.approx(1.1 * sum(masses.values()), abs=0.06)
    assert [hours_in_words(h) for h in (0.01, 0.6, 4.8, 11.4)] == [
        "about 0.5 h",
        "about 0.5 h",
        "about 5 h",
        "about 11 h",
    ]
    text = (made.folder / "assembly.md").read_text(encoding="utf-8")
    plates = re.findall(r"^Plate \d+, `print/plate_\d+.3mf`: (.*); about (.*) h\.$", text, re.M)
    assert sorted(part for names, _ in plates for part in names.split(", ")) == sorted(masses)
    assert sum(float(h) for _, h in plates) == pytest.approx(hours, abs=0.5 * len(plates) + 0.5)


def test_a_profile_with_inserts_gets_their_seats_and_lists_them(parts_of):
    scanner = scanner_at(TILTED, printer="fdm-0.4-insert")
    assembly = parts_of(scanner)
    rounds = {name: rounds_of(solid) for name, solid in assembly.made.items()}
    joints = assembly.layout.joints
    held = {(joint.part, joint.onto): joint for joint in joints if joint.inserts}
    cage = held.pop(("bearing_cage", "slip_ring_adapter"))
    assert not held and cage.count == 4
    seats = [hole for hole in rounds["slip_ring_adapter"] if hole.hole and hole.diameter == 4.0]
    assert len(seats) == 4 and min(hole.length for hole in seats) > INSERT_LENGTH
    by_threads = {(joint.part, joint.onto) for joint in laid_out(scanner_at(TILTED)).joints}
    assert {(joint.part, joint.onto) for joint in joints} == by_threads
    items = items_of(assembly, dict.fromkeys(assembly.made, 1.0))
    assert [(item.number, item.quantity) for item in items if item.kind == "insert"] == [("M3", 4)]
    assert "Melt the inserts in" in instructions_text(assembly, scenes_of(assembly), [])
