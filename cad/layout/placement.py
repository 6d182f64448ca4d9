"""Places of everything of one scanner; each step is a function of earlier records. No kernel."""

from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad.layout.belt.drive import belt_drive
from scanwright.cad.layout.deck import Deck, deck_of
from scanwright.cad.layout.direct.drive import direct_drive
from scanwright.cad.layout.drive import DriveLayout
from scanwright.cad.layout.envelope import envelope_of
from scanwright.cad.layout.hub import CROSS_SCREWS, CrossScrew, Hub
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.cad.layout.rotor.counterweight import Counterweight, counterweight_of
from scanwright.cad.layout.rotor.cross_screws import cross_joint, held_nm, turning_nm
from scanwright.cad.layout.rotor.imbalance import estimated_moment
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage, linkage_body_of, neck_corners
from scanwright.cad.layout.rotor.ties import hub_tie_of, plate_ties_of
from scanwright.cad.layout.tightening import HELD_G, LEAST_MARGIN
from scanwright.design.arrays import Array
from scanwright.design.electrics.wiring import require_circuits
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

SURE = 1.05  # of an estimated imbalance: 3 % for the linkage (`estimated_moment`)


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Where everything is: the input for the descriptions of parts."""

    scanner: Scanner  # angles and products
    drive: DriveLayout  # all below the hub
    deck: Deck  # that the scanner is screwed to
    linkage: AlignmentLinkage  # between hub and lidar
    neck: Array  # corners of its neck, shape (n, 3)
    counterweight: Counterweight | LeftOut  # the bar with its estimated length, or why there is none
    ties_left_out: tuple[LeftOut, ...]  # seats of cable ties that have no place

    @property
    def stack(self) -> Hub:
        """Every number along the axis."""
        return self.drive.stack


def placement_of(scanner: Scanner) -> Placement:
    """Place everything of one scanner, with the smallest cross screws that hold the linkage's angle.

    Raises:
        BuildError: something has no place, or what holds it is too weak.
    """
    if scanner.slip_ring is not None:
        require_circuits(scanner.slip_ring, scanner.lidar)
    cross: CrossScrew | None = CROSS_SCREWS[0]
    while cross is not None:
        place, turns = _placed(scanner, cross)
        joint = cross_joint(place.linkage, place.drive.shaft)
        holds, used = held_nm(place.stack, joint), place.stack.cross_screw
        if holds >= SURE * LEAST_MARGIN * turns:
            return place
        cross = next((larger for larger in CROSS_SCREWS if larger.washer > used.washer), None)
    if SURE * holds >= LEAST_MARGIN * turns:  # a check decides
        return place
    raise BuildError(
        f"{ALIGNMENT_LINKAGE}: {joint.count} x {joint.screw.name} hold its angle on {place.drive.shaft} with "
        f"{holds:.2g} N m of friction, {HELD_G:g} g and drag of the ring turn it with {turns:.2g}: margin "
        f"{holds / turns:.2g}, at least {LEAST_MARGIN:g}; take a lighter lidar, or angles with its middle nearer to "
        "the axis"
    )


def _placed(scanner: Scanner, cross: CrossScrew) -> tuple[Placement, float]:
    """Place everything with one size of cross screws; also return the torque [N m] that they must hold."""
    drive = drive_of(scanner, cross)
    deck = deck_of(scanner, drive)
    body = linkage_body_of(scanner, drive.envelope, drive.stack)
    neck = neck_corners(body, 0)
    plate = plate_ties_of(scanner.lidar, body, neck)
    plate_ties = () if isinstance(plate, LeftOut) else plate
    moment = estimated_moment(scanner, body, neck)
    bar = counterweight_of(scanner, drive, deck, body, plate_ties, neck, moment)
    ear = None if isinstance(bar, LeftOut) else bar.ear
    hub = hub_tie_of(scanner, drive, body, ear, neck)
    place = Placement(
        scanner=scanner,
        drive=drive,
        deck=deck,
        linkage=replace(body, ear=ear, hub_tie=None if isinstance(hub, LeftOut) else hub, plate_ties=plate_ties),
        neck=neck,
        counterweight=bar,
        ties_left_out=tuple(tie for tie in (hub, plate) if isinstance(tie, LeftOut)),
    )
    imbalance_gmm = 0.0 if isinstance(bar, Counterweight) else float(np.linalg.norm(moment))
    return place, turning_nm(scanner, imbalance_gmm * 1e-6)


def drive_of(scanner: Scanner, cross: CrossScrew = CROSS_SCREWS[0]) -> DriveLayout:
    """Return the drive of one scanner: a belt if the ring is a capsule, else the servo on the axis."""
    ring, envelope = scanner.slip_ring, envelope_of(scanner.lidar)
    capsule = ring is not None and ring.bore_mm == 0
    return belt_drive(scanner, envelope, cross) if capsule else direct_drive(scanner, envelope, cross)
