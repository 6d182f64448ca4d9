"""Which servos and rings go together, what stands on the horn, and a refusal says whose number it rests on."""

import math
from dataclasses import replace
from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest
from quick_tests import samples

from benchmarks.cad.combinations import screws_without_a_hole
from scanwright.cad.assembly.bought import servo_case, servo_horn
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.checks.clearance import clearance_checks
from scanwright.cad.checks.loads.retention import retention_checks, worst_shares
from scanwright.cad.layout.direct.frame import EAR_DEPTH, ServoFrame
from scanwright.cad.layout.joints import fixing_in
from scanwright.cad.layout.placement import drive_of, placement_of
from scanwright.cad.layout.tightening import BOUGHT, MOULDED, PRINTED, hold_of
from scanwright.cad.parts.all_parts import laid_out, parts_of
from scanwright.cad.screws import SCREWS
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import scanner_of

CATALOGUE = load_catalogue()
TILTED = (0, -55, -80, 75)
RINGS = [name for name, product in CATALOGUE.products.items() if isinstance(product, SlipRing)]


def scanner_for(servo, lidar, ring, angles=TILTED):
    keys = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")
    found = AngleSet(
        task="fits",
        angles_deg=Angles(**dict(zip(keys, angles, strict=True))),
        sensor=lidar,
        servo=servo,
        slip_ring=ring,
    )
    return scanner_of(found, "fdm-0.4", CATALOGUE)


@pytest.mark.parametrize(("lidar", "holes"), [("UST-10LX", 2), ("URG-04LX", 2), ("UTM-30LX", 4), ("STL27L", 3)])
def test_an_xm430_is_laid_out_with_a_frame_and_every_lidar_by_the_holes_it_has(lidar, holes):
    layout = laid_out(scanner_for("XM430-W350", lidar, None, (0, 0, 0, 50)))
    joints = {joint.onto: joint for joint in layout.joints}
    assert joints["servo_case"].part == "servo_frame" and joints["servo_case"].fixing == "thread"
    assert {axis.start[:2] for axis in joints["servo_case"].axes} == {(11.0, -8.0), (-11.0, -8.0)}
    assert joints["servo_case"].length_mm - joints["servo_case"].grip_mm == 2.5  # of 3.0, one diameter
    assert joints["lidar_body"].count == holes
    assert joints["lidar_body"].fixing == ("nut" if lidar == "STL27L" else "thread")


@pytest.mark.parametrize("servo", [product.name for product in CATALOGUE if isinstance(product, Servo)])
def test_no_horn_is_drawn_inside_its_case(servo):
    record = CATALOGUE.products[servo]
    assert servo_case(record, 0.0).intersect(servo_horn(record, 0.0)).Volume() < 1e-6


def test_every_screw_into_a_device_meets_a_hole_and_one_that_does_not_is_found():
    for servo, lidar, ring in (("XL430-W250", "STL27L", None), ("MX-64R", "UST-10LX", "SNU11-P0210")):
        layout = laid_out(scanner_for(servo, lidar, ring, (0, 0, 0, 50)))
        assert list(screws_without_a_hole(layout)) == []
    turned = layout.scanner.lidar.model_copy(update={"holes": CATALOGUE.products["RPLIDAR C1"].holes})
    wrong = replace(layout, scanner=replace(layout.scanner, lidar=turned))
    assert [line[:46] for line in screws_without_a_hole(wrong)] == [
        "alignment_linkage on lidar_body: no hole for M"
    ] * 2


TWO_THREADS = ("XL430-W250", "XM430-W350", "XH430-W350", "XM540-W270")


@pytest.mark.parametrize("seed", samples(range(12), (0, 1)))
def test_plates_on_a_frame_leave_its_servo_and_all_that_turns_free(seed):
    """Random servos with two front threads, rings, lidars and attitudes, without routed leads."""
    draw = np.random.default_rng(seed)
    for servo in TWO_THREADS:
        lidar, ring = draw.choice(["LD19", "UST-10LX", "URG-04LX", "TiM571"]), str(draw.choice(RINGS))
        angles = (0.0, 0.0, 0.0, 50.0) if draw.random() < 0.4 else tuple(draw.uniform((-60, -60, -80, 20), 80).round(1))
        scanner = scanner_for(servo, str(lidar), ring, angles)
        scanner = replace(
            scanner, printer=CATALOGUE.products[draw.choice(["fdm-0.4", "fdm-0.4-insert", "fdm-0.4-nut"])]
        )
        try:
            place = placement_of(scanner)
        except BuildError as error:
            assert ring == "UH1256-02-0610-06S" and "the axis needs a bearing around shaft and leads" in str(error)
            continue
        joints = [joint for part in parts_of(place) if not isinstance(part, LeftOut) for joint in part.joints]
        found = SimpleNamespace(scanner=scanner, drive=place.drive, stack=place.stack, joints=joints)
        assert list(screws_without_a_hole(found)) == []
        case = next(joint for joint in joints if joint.onto == "servo_case")
        assert case.count == 2 and case.heel_mm > 15.0
        frame = place.drive.of(ServoFrame)
        assert (frame is None) == (case.part == "drive_plate")
        if frame is None:
            continue
        plate = next(joint for joint in joints if joint.onto == "servo_frame" and joint.part != "base_mount")
        ears, heads = frame.ears, SCREWS[scanner.servo.front.screw].head_diameter / 2
        assert plate.count == 4 and [axis.start[:2] for axis in plate.axes] == list(ears.holes)
        assert plate.inserts == (scanner.printer.thread == "insert") and plate.traps != plate.inserts
        tip = plate.axes[0].start[2] + 0.2 - plate.length_mm
        assert tip > frame.high - EAR_DEPTH and plate.length_mm - plate.grip_mm > plate.screw.nominal
        for x, y in ears.holes:
            assert (
                frame.half_x + 1.2 < abs(x) - ears.thread.hole / 2 and abs(x) + ears.thread.hole / 2 < ears.half_x - 1.2
            )
            assert frame.ends_y[0] + 1.2 < y - ears.thread.hole / 2 and y + ears.thread.hole / 2 < frame.ends_y[1] - 1.2
        assert frame.opening > place.stack.flange_radius + 0.4  # it turns in the opening, and next to the heads
        covered = {(x, y) for x, y, _ in ears.covers}
        for x, y in scanner.servo.front.places:
            assert math.hypot(x, y) - heads > place.stack.flange_radius + 0.4
            assert (x, y) in covered or abs(x) + heads < ears.opening


def test_a_frame_with_nuts_for_a_cage_is_as_its_joints_say_and_meets_neither_base_nor_servo():
    """Read from the solids: screw holes, nuts' slots from outside with a roof, and the base on its four feet."""
    scanner = scanner_for("XL430-W250", "UTM-30LX", None, (0, 60, 10, -30))
    assembly = make_parts(scanner, lambda spec: spec.name in ("servo_frame", "cage_base"))
    frame, base = assembly.made["servo_frame"], assembly.made["cage_base"]
    joint = next(
        joint for joint in laid_out(scanner).joints if joint.onto == "servo_frame" and joint.part == "cage_base"
    )
    record = drive_of(scanner).of(ServoFrame)
    nut = joint.thread.trap

    def solid(x, y, z):
        return frame.isInside(cq.Vector(x, y, z))

    for x, y, z in (axis.start for axis in joint.axes):
        out, seat = math.copysign(1.0, x), z - joint.grip_mm
        middle = seat - joint.thread_mm - nut.depth / 2
        assert not any(
            solid(x, y, seat - depth) for depth in np.linspace(0.1, joint.length_mm - joint.grip_mm + 0.5, 9)
        )
        assert all(solid(x + dx, y, seat - 1.5) for dx in (-2.2, 2.2)) and solid(x, y + nut.across / 2 + 0.2, middle)
        assert not any(solid(x + out * reach, y, middle) for reach in np.linspace(-nut.corner + 0.1, 7.0, 9))
        assert solid(x - out * (nut.corner + 0.2), y, middle) and solid(x, y + 2.5, seat - joint.thread_mm / 2)
        assert not base.isInside(cq.Vector(x, y, z + 1.0)) and base.isInside(cq.Vector(x + out * 2.4, y, z - 1.0))
    assert frame.intersect(base).Volume() < 1e-3
    (x0, y0, z0), (x1, y1, z1) = scanner.servo.case_min_mm, scanner.servo.case_max_mm
    horn = drive_of(scanner).stack.horn
    case = cq.Solid.makeBox(x1 - x0, y1 - y0, z1 - z0, pnt=cq.Vector(x0, y0, horn + z0))
    assert frame.intersect(case).Volume() < 1e-3
    for x, y in record.holes:
        head = cq.Solid.makeCylinder(2.25, 2.5, cq.Vector(x, y, record.high + 1e-3))
        assert base.intersect(head).Volume() == 0 and frame.intersect(head).Volume() == 0


@pytest.mark.parametrize("servo", [*TWO_THREADS, "STS3215"])
def test_the_front_screws_of_a_servo_hold_the_pull_of_its_belt(servo):
    scanner = scanner_for(servo, "LD19", "SRC022A-6", (0, 0, 0, 50))
    place = placement_of(scanner)
    stack = place.drive.stack
    joint = next(
        joint
        for part in parts_of(place)
        if not isinstance(part, LeftOut)
        for joint in part.joints
        if joint.onto == "servo_case"
    )
    hold = hold_of(joint, PRINTED, MOULDED if scanner.servo.front.kind == "self_tapping" else BOUGHT)
    tension = stack.belt.working_tension_n  # the check `belt_tension` allows no more, in either strand
    pull, push = worst_shares(joint, np.array([*stack.horn_axis, stack.belt_middle]) / 1000)
    assert 2 * tension * pull < hold.pull_n / 2
    start = np.array([axis.start[:2] for axis in joint.axes])
    arms = np.linalg.norm(start - start.mean(axis=0), axis=1)
    turns = tension * stack.pitch_radius * arms.max() / (arms**2).sum()
    assert 2 * tension * push + turns < hold.push_n / 1.5


def test_a_lidar_with_its_equal_holes_sunk_into_the_base_is_refused_with_the_holes_it_has():
    found = r"LD06 has fewer than two equal .* in the face of its base.*1 x M2.5 self tapping in -z.*not in its face"
    with pytest.raises(BuildError, match=found):
        laid_out(scanner_for("MX-64R", "LD06", None))


def test_a_frame_on_a_tilted_axis_stands_on_the_mount():
    scanner = scanner_for("XL430-W250", "STL27L", None, (0, 30, 0, 30))
    layout = laid_out(scanner)
    assert not layout.deck.flat and layout.drive.mounted.onto == "servo_frame"
    names = {joint.part for joint in layout.joints}
    assert {"servo_frame", "base_mount", "horn_cup"} <= names


def test_a_pair_of_screws_resists_tipping_by_the_edge_of_what_they_hold():
    layout = laid_out(scanner_for("XL430-W250", "STL27L", None, (0, 0, 0, 50)))
    joint = next(joint for joint in layout.joints if joint.onto == "servo_case")
    centre = np.array([0.0, 0.0, 0.1]) + np.mean([axis.start for axis in joint.axes], axis=0) / 1000
    pull, _ = worst_shares(joint, centre)
    bare, _ = worst_shares(replace(joint, heel_mm=None), centre)
    assert pull == pytest.approx(bare + 0.1 / (2 * joint.heel_mm / 1000))  # a lever of 100 mm over the heel


CUPS = [("STS3215", "UST-10LX", (0, 0, 60, -30)), ("XL330-M288", "LD19", TILTED), ("XL430-W250", "LD19", TILTED)]


@pytest.mark.parametrize(("servo", "lidar", "angles"), samples(CUPS, CUPS[:1]))
def test_without_a_ring_every_horn_gets_a_printed_cup_around_the_heads_of_its_screws(servo, lidar, angles):
    scanner = scanner_for(servo, lidar, None, angles)
    stack, screw = drive_of(scanner).stack, SCREWS[scanner.servo.horn_screw]
    assert stack.cup_bore >= scanner.servo.horn_circle_mm + screw.head_diameter  # the heads pass it
    assembly = make_parts(scanner)
    assert {part.process for part in assembly.parts.values()} == {"printed"} and "horn_cup" in assembly.parts
    checks = [*retention_checks(assembly), *clearance_checks(assembly)]
    assert {check.severity for check in checks} == {"ok"}


@pytest.mark.parametrize(
    ("printer", "mass_g", "held"),
    [
        ("fdm-0.4", 46.0, ("M2.5", "trap", False)),
        ("fdm-0.4-insert", 46.0, ("M2.5", "trap", False)),  # there is no insert of this size
        ("fdm-0.4-insert", 2400.0, ("M4", "trap", False)),  # an insert of M3 is weaker than a nut of M2.5
    ],
)
def test_a_cup_holds_the_hub_by_screws_for_the_load_and_what_the_printer_gives_threads(printer, mass_g, held):
    """Read from the solids: the hole of the joint is there, and behind it the slot of the nut or the wall."""
    scanner = scanner_for("MX-106", "STL27L", None, (0, 0, 0, 60))
    lidar = scanner.lidar.model_copy(update={"mass_g": mass_g})
    scanner = replace(scanner, printer=CATALOGUE.products[printer], lidar=lidar)
    stack, assembly = placement_of(scanner).stack, make_parts(scanner, lambda spec: spec.name == "horn_cup")
    joint = next(joint for joint in laid_out(scanner).joints if joint.onto == "horn_cup")
    assert (joint.screw.name, fixing_in(joint.thread), joint.inserts) == held
    cup = assembly.made["horn_cup"]

    def solid(axis, depth_mm, beside_mm):
        inwards, up = np.array(axis.along), np.array([0.0, 0.0, 1.0])
        at = (depth_mm - stack.shaft_diameter / 2) * inwards + axis.start[2] * up
        return cup.isInside(cq.Vector(*(at + beside_mm * np.cross(inwards, up))))

    for axis in joint.axes:
        before = stack.cross_screw.before_nut
        for depth_mm in (0.5, before - 0.5, (stack.shaft_diameter - stack.cup_bore) / 2 - 0.5):
            assert not solid(axis, depth_mm, 0.49 * joint.thread.hole)
        assert solid(axis, before - 0.5, 0.51 * joint.thread.hole)
        assert solid(axis, before + 1.0, 0.6 * joint.thread.hole) == (not joint.traps)
        tip_mm = float(np.linalg.norm(axis.start[:2])) - joint.length_mm
        assert tip_mm > stack.cup_bore / 2 - 1.0  # above the heads of the horn's screws nothing is in the way
    assert mass_g > 1000 or {check.severity for check in retention_checks(assembly)} == {"ok"}


def test_a_ring_still_asks_for_a_turned_shaft():
    stack = drive_of(scanner_for("MX-64R", "UTM-30LX", "SNU11-P0210")).stack
    assert stack.cup_bore == 0 and stack.shaft_diameter == 12.65 and stack.shaft == "servo_shaft"


def test_a_refusal_that_rests_on_a_number_nobody_has_verified_says_so():
    scanner = scanner_for("MX-28", "UST-10LX", "UH1256-02-0610-06S")
    with pytest.raises(BuildError, match=r"lead_diameter_mm = 19.0 \(not verified: measure yours\): the axis needs"):
        laid_out(replace(scanner, slip_ring=scanner.slip_ring.model_copy(update={"lead_diameter_mm": 19.0})))


@pytest.mark.parametrize(
    ("ring", "changed", "why"),
    [
        (None, {"holes": ()}, r"servo_frame: holes: MX-64R has no four equal holes in its rear .*none"),
        (
            "SRC022A-6",
            {"case_max_mm": (20.1, 10.0, -30.0)},
            r"drive_pulley: foot: case_max_mm = .* MX-64R is 30 mm above its case, and the belt",
        ),
    ],
)
def test_a_servo_that_the_parts_cannot_hold_is_refused_with_the_value_in_the_way(ring, changed, why):
    scanner = scanner_for("MX-64R", "LD19", ring)
    with pytest.raises(BuildError, match=why):
        laid_out(replace(scanner, servo=scanner.servo.model_copy(update=changed)))
