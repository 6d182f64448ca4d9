"""The first screen of a report: title, cards, parts list, and what to do."""

from dataclasses import replace

import pytest

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.findings import Finding
from scanwright.design.motion import StopAndGo, Sweep
from scanwright.design.task.task import load_task
from scanwright.report.answer import answer
from scanwright.report.first_screen import cards, motion_in_words, title, to_do
from scanwright.report.parts_list import read_parts, usd_range

ANGLES = AngleSet(
    task="ground_ahead",
    angles_deg=Angles(alpha_rot=0, beta_rot=90, alpha_laser=0, beta_laser=-90),
    sensor="UTM-30LX",
    servo="MX-64R",
    motion={"mode": "spin", "period_s": 18.0},
    J=-5.0,
    J_error=1e-3,
)
GROUND = {"shape": "ground", "from_m": 0.5, "to_m": 3.0, "width_m": 2.0, "height_m": 0.4}
HEADER = "kind,part,number,quantity,total_usd,low_usd,high_usd,mass_g,note\n"


def ground_task():
    keys = {"name": "t", "sensor": "UTM-30LX", "servo": "MX-64R", "slip_ring": "SNU11-P0210"}
    return load_task(keys | {"motion": {"period_s": 18.0}, "weight": [GROUND]})


@pytest.fixture(scope="module")
def built():
    return answer(load_task("ground_ahead"), ANGLES)


def test_the_title_names_the_planes_of_the_task_or_the_task():
    assert title(ground_task()) == "A 3D scanner for ground 0.5 to 3 m ahead"
    assert title(load_task("ground_ahead")) == "A 3D scanner: ground ahead"


def test_cards_state_the_numbers_of_the_records(built):
    sees, gain, scan, make = cards(ANGLES, built, None)
    own, mounts = built.as_built.own, built.as_built.mounts
    assert sees.headline == "All you asked for"
    assert sees.text == (
        f"At least {own.least} beams on a disc of 21 cm, 3 m away. Scan lines at most 0.50 deg apart, 87 mm at 10 m."
    )
    factor, name = min((each.factor, each.name) for each in mounts)
    assert gain.headline == f"{factor:.2f} x {name}"
    assert (f": {1 / factor:.2f} times the beams of this scanner." in gain.text) == (factor < 0.98)
    assert all(f"{each.factor:.2f} x {each.name}" in gain.text for each in mounts[1:])
    assert scan.headline == "18 s, 778,320 beams"
    assert scan.text == "Expect about 10 mm at 3 m. One turn at constant speed: 720 lines of 1,081."
    assert make.headline == "Price unknown"


def test_blind_spots_are_named_and_no_ratio_is_stated_without_one(built):
    own = replace(built.as_built.own, blind=("blind ahead: 5 deg", "blind behind"), blind_weight=0.039)
    mounts = tuple(replace(each, gain=replace(each.gain, factor=None)) for each in built.as_built.mounts)
    changed = replace(built, as_built=replace(built.as_built, blocked=0.25, own=own, mounts=mounts))
    sees, gain, scan, _ = cards(ANGLES, changed, None)
    assert sees.headline == "3.9% of what you asked for is never seen"
    assert sees.text.startswith("Blind ahead, blind behind. Scan lines")
    assert " x " not in gain.headline + gain.text and "in J" in gain.headline
    assert scan.text.endswith("Parts block 25.0%.")


@pytest.mark.parametrize(
    ("share", "headline"), [(0.2, "All you asked for, except behind the robot"), (0.8, "The robot hides most of it")]
)
def test_a_region_that_the_robot_hides_leads(built, share, headline):
    severity = "warning" if share > 0.5 else "note"
    hidden = Finding("hidden_region", severity, "weight.0", "the robot hides most of it", share, 0.5, "1", "move it")
    sees = cards(ANGLES, replace(built, cloud=replace(built.cloud, hidden_regions=(hidden,))), None)[0]
    assert sees.headline == headline
    assert ("The robot hides most of it." in sees.text) == (share < 0.5)
    height = replace(hidden, code="deck_height", severity="warning", message="the optical centre is high")
    assert to_do((), (height,), None)[0].text == "The optical centre is high."


def test_planes_are_stated_in_metres():
    loaded = ground_task()
    sees = cards(ANGLES, answer(loaded, ANGLES), None)[0]
    assert sees.text.startswith("Ground 0.5 to 3 m ahead: ") and "points per m2" in sees.text
    built = answer(loaded, ANGLES)
    (plane,) = built.cloud.planes
    plane = replace(plane, empty_share=0.25)
    cloud = replace(built.cloud, planes=(plane,), empty_areas=(plane.empty(0.02),))
    sees = cards(ANGLES, replace(built, cloud=cloud), None)[0]
    assert sees.headline == "25% of the area of ground 0.5 to 3 m ahead gets no points"
    assert "points per m2, 25% gets none" in sees.text


def test_every_motion_has_its_words():
    assert motion_in_words(None) == "the motion is not known"
    sweep = Sweep(mode="sweep", period_s=12, limits_deg=(-90, 80), accel_deg_s2=200)
    assert motion_in_words(sweep) == "from -90 to 80 deg and back"
    assert motion_in_words(StopAndGo(mode="stop_and_go", stops=36, dwell_s=0.5)) == "36 stops of 0.5 s in one turn"


@pytest.fixture
def parts(tmp_path):
    rows = ["tool,multimeter,,1,,15,60,,", "bought,lidar,UTM-30LX,1,5000,5000,5000,370,", "screw,cap,M3,6,,1,2,,"]
    rows += [
        "turned,shaft,,1,,30,90,20,",
        "printed,mount,,1,,0,0,50,",
        "strange,thing,,,,,,,",
        "total,all,,,5000,5046,5152,,",
    ]
    (tmp_path / "bom.csv").write_text(HEADER + "\n".join(rows) + "\n")
    return read_parts(tmp_path / "bom.csv")


def test_parts_are_grouped_in_order_and_nothing_is_lost(parts, built):
    assert [(group.title, group.usd) for group in parts.groups] == [
        ("Devices", "5,000 USD"),
        ("Parts to print", "0 USD"),
        ("Parts to have machined", "30 to 90 USD"),
        ("Screws, nuts, washers, inserts", "1 to 2 USD"),
        ("Tools", "15 to 60 USD"),
        ("Others", "0 USD"),
    ]
    assert parts.usd == "5,046 to 5,152 USD" and parts.bought == {"UTM-30LX": "lidar"}
    make = cards(ANGLES, built, parts)[3]
    assert (make.headline, make.text) == (
        parts.usd,
        "1 part to print and 1 other to have machined, 6 screws.",
    )
    assert usd_range([{"low_usd": "0.2", "high_usd": "0.4"}]) == "0 USD"


def test_what_to_do_begins_with_what_is_wrong(parts):
    findings = [
        Finding("unverified", "note", "XM540", "XM540: a"),
        Finding("shaft_slope", "error", "servo_shaft", "d"),
    ]
    files = [
        "assembly.md",
        "template.pdf",
        "print/test_plate.3mf",
        "print/fit_coupon.3mf",
        "print/plate_2.3mf",
        "print/plate_1.3mf",
        "print/plate_1.png",
    ]
    todo = to_do(files, findings, parts)
    assert [each.title for each in todo] == [
        "Fix 1 failed check",
        "Measure 1 value",
        "Order devices, screws and wiring",
        "Print the fit coupon",
        "Try the hole patterns on your devices",
        "Have 1 part machined",
        "Print 2 plates",
        "Assemble and wire",
    ]
    assert todo[1].findings == (findings[0],)
    assert todo[4].files == ("template.pdf", "print/test_plate.3mf")
    assert todo[5].files == ("drawings/shaft.pdf",) and todo[6].files == ("print/plate_1.3mf", "print/plate_2.3mf")
    assert to_do([], [], None) == []
