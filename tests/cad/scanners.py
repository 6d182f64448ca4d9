"""Scanners that tests of several files take: of equal ones the fixture `parts_of` makes the parts once."""

from dataclasses import replace

from scanwright.cad.layout import layout
from scanwright.cad.layout.deck import deck_of
from scanwright.cad.layout.placement import drive_of
from scanwright.cad.layout.rotor.linkage import linkage_body_of
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.scanner import NO_MODULES, scanner_of

RING, CAPSULE = "SNU11-P0210", "SRC022A-6"
GROUND_AHEAD, ROLLING, UPRIGHT = (0, -55, -80, 75), (0, 90, 0, -90), (0, 0, 60, -30)
TILTED = (0, 35, -20, -70)
"""alpha_rot, beta_rot, alpha_laser and beta_laser in degrees."""


def scanner_at(
    setting_deg,
    *,
    friction_nm=None,
    sensor="UTM-30LX",
    servo="MX-64R",
    slip_ring=RING,
    printer="fdm-0.4",
    modules=NO_MODULES,
):
    """The scanner of products by their names at four angles; without friction a counterweight balances its rotor."""
    names = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")
    angles = AngleSet(
        task="test",
        angles_deg=Angles(**dict(zip(names, setting_deg, strict=True))),
        sensor=sensor,
        servo=servo,
        slip_ring=slip_ring,
        motion={"mode": "spin", "period_s": 18.0},
    )
    scanner = scanner_of(angles, printer, load_catalogue(), modules=modules)
    if scanner.slip_ring is None:
        return scanner
    return replace(scanner, slip_ring=scanner.slip_ring.model_copy(update={"friction_nm": friction_nm}))


def digest_of(scanner):
    """The digest of everything that shapes the parts, without their layout."""
    return layout.digest_of(scanner, drive_of(scanner))


def mount_offset_mm(scanner):
    """Where the mount puts the optical centre in the world."""
    return deck_of(scanner, drive_of(scanner)).t_world_rot


def bare_linkage(scanner):
    """The linkage without ear and seats of cable ties."""
    drive = drive_of(scanner)
    return linkage_body_of(scanner, drive.envelope, drive.stack)


def avoided(parts, *, turns):
    """Space that cables must stay clear of."""
    return [shape for part in parts if getattr(part, "turns", None) == turns for shape in part.avoid]
