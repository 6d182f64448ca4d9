"""Which servos and rings go together, what stands on the horn, and a refusal says whose number it rests on."""

from dataclasses import replace

import cadquery as cq
import numpy as np
import pytest
from quick_tests import samples

from scanwright.cad.assembly.make import make_parts
from scanwright.cad.checks.clearance import clearance_checks
from scanwright.cad.checks.loads.retention import retention_checks
from scanwright.cad.layout.joints import fixing_in
from scanwright.cad.layout.placement import drive_of
from scanwright.cad.parts.all_parts import laid_out
from scanwright.cad.screws import SCREWS
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.products import SlipRing
from scanwright.design.errors import BuildError
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


@pytest.mark.parametrize("lidar", ["UST-10LX", "URG-04LX", "UTM-30LX"])
@pytest.mark.parametrize("ring", [*RINGS, None])
def test_an_xm430_is_laid_out_with_every_ring_and_every_hokuyo(ring, lidar):
    layout = laid_out(scanner_for("XM430-W350", lidar, ring))
    assert {joint.onto for joint in layout.joints} >= {"lidar_body", "servo_case", "servo_horn"} - (
        {"servo_horn"} if layout.drive.shaft == "main_shaft" else set()
    )


CUPS = [("STS3215", "UST-10LX", (0, 0, 60, -30)), ("XL330-M288", "LD06", TILTED), ("STS3215", "LD06", TILTED)]


@pytest.mark.parametrize(("servo", "lidar", "angles"), samples(CUPS, CUPS[:1]))
def test_without_a_ring_every_horn_gets_a_printed_cup_around_the_heads_of_its_screws(servo, lidar, angles):
    scanner = scanner_for(servo, lidar, None, angles)
    stack, screw = drive_of(scanner).stack, SCREWS[scanner.servo.horn_screw]
    assert stack.cup_bore >= scanner.servo.horn_circle_mm + screw.head_diameter  # the heads pass it
    assembly = make_parts(scanner)
    assert {part.process for part in assembly.parts.values()} == {"printed"} and "horn_cup" in assembly.parts
    checks = [*retention_checks(scanner, assembly), *clearance_checks(assembly)]
    assert {check.severity for check in checks} == {"ok"}


@pytest.mark.parametrize("printer", ["fdm-0.4", "fdm-0.4-insert"])
def test_a_cup_holds_the_hub_by_what_the_printer_gives_threads(printer):
    """Read from the solids: the hole that the joint tells is there, and behind it the nut's room or the wall."""
    scanner = scanner_for("XL430-W250", "STL27L", None, (0, 0, 0, 50))
    scanner = replace(scanner, printer=CATALOGUE.products[printer])
    stack, assembly = drive_of(scanner).stack, make_parts(scanner)
    joint = next(joint for joint in laid_out(scanner).joints if joint.onto == "horn_cup")
    assert [printer, fixing_in(joint.thread), joint.inserts] in (
        ["fdm-0.4", "trap", False],
        ["fdm-0.4-insert", "thread", True],
    )
    cup = assembly.made["horn_cup"]

    def solid(axis, depth_mm, beside_mm):
        inwards, up = np.array(axis.along), np.array([0.0, 0.0, 1.0])
        at = (depth_mm - stack.shaft_diameter / 2) * inwards + axis.start[2] * up
        return cup.isInside(cq.Vector(*(at + beside_mm * np.cross(inwards, up))))

    for axis in joint.axes:
        for depth_mm in (0.5, 2.5, 6.5):
            assert not solid(axis, depth_mm, 0.49 * joint.thread.hole)
        assert solid(axis, 2.5, 0.51 * joint.thread.hole)
        assert solid(axis, 4.0, 0.6 * joint.thread.hole) == (not joint.traps)
        tip_mm = float(np.linalg.norm(axis.start[:2])) - joint.length_mm
        assert tip_mm > stack.cup_bore / 2 - 1.0  # above the heads of the horn's screws nothing is in the way
    assert {check.severity for check in retention_checks(scanner, assembly)} == {"ok"}


def test_a_ring_still_asks_for_a_turned_shaft():
    stack = drive_of(scanner_for("MX-64R", "UTM-30LX", "UH1256-02-0610-06S")).stack
    assert stack.cup_bore == 0 and stack.shaft_diameter == 12.0 and stack.shaft == "servo_shaft"


def test_a_refusal_that_rests_on_a_number_nobody_has_verified_says_so():
    with pytest.raises(BuildError, match=r"a circle of 14 mm \(nobody has verified it: measure yours\) leave 4.25"):
        laid_out(scanner_for("STS3215", "UTM-30LX", "UH1256-02-0610-06S"))
    with pytest.raises(
        BuildError, match=r"-32.75\)\] \(nobody has verified it: measure yours\): STS3215 needs two pairs"
    ):
        laid_out(scanner_for("STS3215", "UST-10LX", None))


@pytest.mark.parametrize(
    ("ring", "changed", "why"),
    [
        (None, {"case_rear_holes_mm": ()}, r"base_mount: deck: case_rear_holes_mm = .* MX-64R has no four holes"),
        (
            "SRC022A-6",
            {"case_max_mm": (20.1, 10.0, -30.0)},
            r"drive_pulley: foot: case_max_mm = .* MX-64R stands 30 mm above its case, and the belt",
        ),
    ],
)
def test_a_servo_that_the_parts_cannot_hold_is_refused_with_the_value_in_the_way(ring, changed, why):
    scanner = scanner_for("MX-64R", "LD06", ring)
    with pytest.raises(BuildError, match=why):
        laid_out(replace(scanner, servo=scanner.servo.model_copy(update=changed)))
