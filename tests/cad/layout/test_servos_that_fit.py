"""Which servos and rings go together: small horns get a thinner shaft, and a refusal says whose number it rests on."""

import pytest

from cad.assembly.make import make_parts
from cad.checks.clearance import clearance_checks
from cad.checks.retention import retention_checks
from cad.layout.all_joints import joints_of
from cad.layout.direct.sizing import direct_stack
from cad.layout.layout import layout_of
from cad.screws import SCREWS
from design.angles import Angles, AngleSet
from design.catalogue.catalogue import load_catalogue
from design.catalogue.products import SlipRing
from design.errors import BuildError
from design.scanner import scanner_of

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
    layout = layout_of(scanner_for("XM430-W350", lidar, ring))
    assert {joint.onto for joint in joints_of(layout)} >= {"lidar_body", "servo_case", "servo_horn"} - (
        {"servo_horn"} if layout.drive.shaft == "main_shaft" else set()
    )


@pytest.mark.parametrize(
    ("servo", "lidar", "angles"),
    [("STS3215", "UST-10LX", (0, 0, 60, -30)), ("STS3215", "LD06", TILTED), ("XL330-M288", "LD06", TILTED)],
)
def test_a_small_horn_gets_a_shaft_between_the_heads_of_its_screws(servo, lidar, angles):
    scanner = scanner_for(servo, lidar, None, angles)
    stack, screw = direct_stack(scanner), SCREWS[scanner.servo.horn_screw]
    assert 8.0 <= stack.shaft_diameter < 12.0
    assert stack.collar_radius <= (scanner.servo.horn_circle_mm - screw.head_diameter) / 2  # the heads pass it
    assert stack.collar_radius >= scanner.servo.horn_boss_diameter_mm / 2 + 1.4
    assembly = make_parts(scanner)
    checks = [*retention_checks(scanner, assembly), *clearance_checks(assembly)]
    assert {check.severity for check in checks} == {"pass"}


def test_a_horn_with_room_keeps_the_plain_shaft():
    assert direct_stack(scanner_for("MX-64R", "UTM-30LX", None)).shaft_diameter == 12.0


def test_a_refusal_that_rests_on_a_number_nobody_has_verified_says_so():
    with pytest.raises(BuildError, match=r"a circle of 14 mm \(nobody has verified it: measure yours\) leave 4.25"):
        layout_of(scanner_for("STS3215", "UTM-30LX", "UH1256-02-0610-06S"))
    with pytest.raises(
        BuildError, match=r"-32.75\)\] \(nobody has verified it: measure yours\): STS3215 needs two pairs"
    ):
        layout_of(scanner_for("STS3215", "UST-10LX", None))
