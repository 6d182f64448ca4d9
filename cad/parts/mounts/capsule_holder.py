"""Slip-ring adapter of the belt layout: a disc in the tower that the capsule's flange is screwed to.

Frame: rotation frame at gamma = 0 (`cad/layout/belt/stack.py`), mm; turned with the servo's side. The capsule hangs
through its middle, its flange on top, screws from below with nuts on the flange; then the disc slides into the tower
from below, and three radial screws hold it. The wide holes of the flange and the soft tube compensate misalignment.
"""

import math
from functools import partial

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.layout.belt.stack import DISC, DISC_SCREW, SCREW_DEPTH, BeltStack, disc_azimuths, flange_centres
from scanwright.cad.layout.joints import Joint, placed_axes, screws, upright_axes
from scanwright.cad.layout.names import BEARING_TOWER, RING, RING_STATOR, SLIP_RING_ADAPTER
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import CRIMPS, PartSpec, Row, Step
from scanwright.cad.screws import SCREWS, passing_hole, thread_in_part
from scanwright.cad.solids import building
from scanwright.design.catalogue.products import Printer

BODY_GAP = 0.5  # around the capsule's body
TUBE_INSIDE = 8.5  # of the soft tube in the shaft
SOFT_TUBE = "soft tube, {} mm inside, {} mm outside, {:.0f} mm long"
TUBE_FITS = "it grips a stub of {:g} mm and fits into a bore of {:g} mm; a turn of tape if it is loose there"
TAPE = Row("consumable", "tape", "adhesive tape", "assembly.md", "for the soft tube")
RUBBER = "mounting instructions of capsule rings: drive the rotor by rubber tubing"


RING_STEP = Step(
    "Capsule into the tower",
    "Pull the rotor's leads up the shaft and out of its windows, those of each cable through the one that the step "
    '"Leads between lidar and ring" names, if there is one. Slide the disc into the tower from below, its three '
    "threads behind the holes of the tower, and the soft tube into the bore of the shaft. "
    f"{screws(SLIP_RING_ADAPTER, BEARING_TOWER)}",
    "turned by hand, the shaft turns the rotor without slipping",
)


def holder_spec(place: Placement) -> PartSpec | None:
    """Return the disc of one scanner; None if it has no capsule."""
    stack, printer = place.drive.of(BeltStack), place.scanner.printer
    if stack is None:
        return None
    axes = placed_axes(upright_axes(flange_centres(stack.flange), stack.disc_top - DISC, 1.0), stack.turn())
    screw, thickness = SCREWS[stack.flange.screw], stack.flange.thickness_mm
    tube = TUBE_INSIDE + stack.capsule_gap
    inside, outside = (math.ceil(size) - 1 for size in (stack.rotor.diameter_mm, stack.shaft_bore))
    fits = TUBE_FITS.format(stack.rotor.diameter_mm, stack.shaft_bore)
    words = (
        "On the bench: put the slip ring, a capsule, through the disc from above, its flange on the disc, its rotor "
        "upwards. "
        f"{screws(RING_STATOR)} The nuts lie on the flange. Tighten them only until the flange can just be moved by "
        f"hand; the threadlocker holds the nuts. Cut {tube:.0f} mm of soft tube, {inside} mm inside and "
        f"{outside} mm outside, and push it over the stub of the rotor until it almost touches the body: {fits}."
    )
    return PartSpec(
        name=SLIP_RING_ADAPTER,
        turns=False,
        make=partial(capsule_holder, stack, printer),
        step=Step("Capsule on its disc", words, "the capsule moves a little by hand, and its rotor turns freely"),
        shaped_by=("slip_ring.outer_diameter_mm", "slip_ring.flange"),
        joints=(
            Joint(SLIP_RING_ADAPTER, RING_STATOR, "nut", screw, axes, grip_mm=DISC, thread_mm=thickness, loose=True),
        ),
        rows=(Row("wiring", "soft tube", SOFT_TUBE.format(inside, outside, tube), RUBBER, fits), TAPE, CRIMPS),
        steps={RING: RING_STEP},
    )


def capsule_holder(stack: BeltStack, printer: Printer) -> cq.Solid:
    """Make the disc."""
    low, high = stack.disc_top - DISC, stack.disc_top
    hole = passing_hole(SCREWS[stack.flange.screw], printer)
    thread = thread_in_part(DISC_SCREW, printer, nut_fits=False)
    with building(SLIP_RING_ADAPTER, "disc", "flange.diameter_mm", f"{stack.flange.diameter_mm:g}") as checked:
        radius = stack.chamber_radius - printer.fit_clearance_mm / 2
        cuts = [solids.upright(stack.ring_radius + BODY_GAP, low - 1.0, high + 1.0)]
        cuts += [solids.upright(hole / 2, low - 1.0, high + 1.0, x, y) for x, y in flange_centres(stack.flange)]
        for azimuth in disc_azimuths(stack):
            start = radius - SCREW_DEPTH
            cuts.append(solids.radial(thread.hole / 2, azimuth, (low + high) / 2, start, SCREW_DEPTH + 1.0))
        disc = checked(solids.upright(radius, low, high).cut(*cuts).clean())
    return disc.moved(solids.location(stack.turn()))
