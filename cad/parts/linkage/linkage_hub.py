"""The hub of the alignment linkage: seat of the shaft, channel of the wires, ear of the bar; tabs for cable ties.

Frame: rotation frame at gamma = 0 (`cad/layout/hub.py`), mm.
"""

import math

import cadquery as cq
import numpy as np

from scanwright.cad import outlines, solids
from scanwright.cad.geometry.blends import BLEND_MM, MIDDLE
from scanwright.cad.layout.hub import JOURNAL_WALL
from scanwright.cad.layout.rotor.cross_screws import cross_seat_mm
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage, Ear
from scanwright.cad.layout.tie_seat import GROOVE, SLOT_ACROSS, TieSeat

LEAST_HALF_WIDTH, LEAST_ABOVE = 4.2, 7.0  # of the channel for leads of unknown size
OVER_LEADS = 1.5  # height of the channel over its leads
IN_HUB = 0.5  # end of that height, before the slots of a tab
NECK_FLAT = 0.4  # of a facet of the neck inside its radius, at most
INSIDE = 1.0  # radius that the bore removes
TAB_CORNER = 1.5  # radius
EAR_CORNER = 0.3  # of its half width


def hub(p: AlignmentLinkage) -> cq.Shape:
    """Return the hub with the ear of a counterweight, blended with the neck where that is narrower."""
    stack = p.stack
    outer, neck, high = stack.hub_radius, stack.neck_radius, -stack.h
    hub: cq.Shape = solids.upright(outer, stack.shoulder, high)
    if outer - neck > BLEND_MM:
        edge = MIDDLE * BLEND_MM
        ring = [(outer, stack.shoulder), (outer, high), (neck + BLEND_MM, high), (neck + edge, high + edge)]
        ring.append((neck - NECK_FLAT, high + BLEND_MM + NECK_FLAT))
        hub = solids.lathe([(INSIDE, stack.shoulder), *ring, (INSIDE, high + BLEND_MM + NECK_FLAT)])
    if p.ear is not None:
        hub = hub.fuse(_ear(p.ear, (stack.shaft_diameter / 2 + stack.hub_radius) / 2))
    if p.hub_tie is not None:
        hub = hub.fuse(tie_lug(p.hub_tie))
    return hub


def hub_cuts(p: AlignmentLinkage) -> list[cq.Shape]:
    """Return the cuts of the hub: cross screws, wires, index groove, bore, slots of ear and tab."""
    ties = [] if p.hub_tie is None else tie_slots(p.hub_tie)
    return [*_crossed(p), *_wires(p), _index_groove(p), _bore(p), *_ear_slots(p), *ties]


def tie_lug(seat: TieSeat) -> cq.Shape:
    """Return the tab of a cable tie, in the frame of its seat."""
    low = (seat.inner, seat.aside - seat.half_width, seat.low)
    high = (seat.end, seat.aside + seat.half_width, seat.high)
    return solids.slab(low, high, (0.0, TAB_CORNER, TAB_CORNER, 0.0)).moved(solids.about_axis(seat.azimuth))


def tie_slots(seat: TieSeat) -> list[cq.Shape]:
    """Return the two slots of a tab, and the groove that joins them."""
    beyond = 1.0
    cuts = [
        solids.box(
            (seat.first, seat.aside + min(side * seat.half, side * (seat.half + SLOT_ACROSS)), seat.low - beyond),
            (seat.last, seat.aside + max(side * seat.half, side * (seat.half + SLOT_ACROSS)), seat.high + beyond),
        )
        for side in (1.0, -1.0)
    ]
    if seat.grooved:
        out = seat.half + SLOT_ACROSS
        z = (seat.low - beyond, seat.low + GROOVE) if seat.below else (seat.high - GROOVE, seat.high + beyond)
        cuts.append(solids.box((seat.first, seat.aside - out, z[0]), (seat.last, seat.aside + out, z[1])))
    return [cut.moved(solids.about_axis(seat.azimuth)) for cut in cuts]


def _ear(ear: Ear, start: float) -> cq.Shape:
    corner = EAR_CORNER * ear.half_width
    middle = np.array([(ear.end + start) / 2, 0.0])
    outline = outlines.octagon(ear.end - middle[0], ear.half_width, corner) + middle
    return solids.prism(outline, ear.low, ear.high, outlines.HAND).moved(solids.about_axis(ear.azimuth))


def _ear_slots(p: AlignmentLinkage) -> list[cq.Shape]:
    """Return slots with round ends, along the radius."""
    if p.ear is None:
        return []
    ear, half = p.ear, p.ear.slot_width / 2
    slots = [solids.slot(half, (a, 0.0), (b, 0.0), ear.low - 1.0, ear.high + 1.0) for a, b in ear.slots]
    return [slot.moved(solids.about_axis(ear.azimuth)) for slot in slots]


def _wires(p: AlignmentLinkage) -> list[cq.Solid]:
    """Return the channel between the two cross screws, from the bearing's sleeve out over the cage."""
    stack = p.stack
    if stack.bearing is None or stack.ring_length == 0:
        return []
    inner = (stack.shaft_diameter + p.fit) / 2 + JOURNAL_WALL
    half = max(LEAST_HALF_WIDTH, stack.leads_half_width)
    roof = max(stack.shoulder + LEAST_ABOVE, stack.leads_corner + stack.lead_diameter / 2 + OVER_LEADS)
    low, out = (inner, -half, stack.shoulder - 1.0), stack.hub_radius + 20.0
    ends = [(out, roof)]
    if p.hub_tie is not None:  # lower at the tie of the leads
        ends = [(stack.hub_radius - IN_HUB, roof), (out, p.hub_tie.low)]
    channels = [solids.box(low, (end, half, high)) for end, high in ends]
    return [each.rotate(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(p.free_azimuth)) for each in channels]


def _crossed(p: AlignmentLinkage) -> list[cq.Solid]:
    """Return the holes of the cross screws, and the paths of their heads and drivers."""
    stack, cuts = p.stack, []
    for azimuth in p.cross_azimuths:
        cuts.append(solids.radial(p.cross_hole / 2, azimuth, stack.cross))
        seat = cross_seat_mm(stack) - stack.cross_screw.washer_thick
        cuts.append(solids.radial(stack.cross_screw.path, azimuth, stack.cross, seat))
    return cuts


def _bore(p: AlignmentLinkage) -> cq.Shape:
    """Return the bore for the spigot: a cylinder with a flat at +y."""
    stack = p.stack
    radius = (stack.shaft_diameter + p.fit) / 2
    round_bore = solids.upright(radius, stack.shoulder - 1.0, stack.spigot_top)
    low = (-2 * radius, -2 * radius, stack.shoulder - 2.0)
    return round_bore.intersect(solids.box(low, (2 * radius, stack.flat + p.fit / 2, stack.spigot_top + 1.0)))


def _index_groove(p: AlignmentLinkage) -> cq.Solid:
    """Return a groove at the hub's lower end, above the wires if they leave at +y, or in an ear there."""
    stack, ear, y = p.stack, p.ear, p.stack.hub_radius
    low, high = stack.shoulder - 1.0, stack.shoulder + 4.0
    if stack.journal > 0 and math.cos(p.free_azimuth - math.pi / 2) > 0.9:
        low, high = -stack.h - 5.0, -stack.h + 1.0
        if ear is not None and _reach_along_y(ear) > y:
            y, low, high = _reach_along_y(ear), ear.low - 1.0, ear.high + 1.0
    return solids.prism(outlines.diamond(1.0, y), low, high)


def _reach_along_y(ear: Ear) -> float:
    """Return where +y leaves an ear; 0 if it is on another side."""
    along, across = math.cos(ear.azimuth - math.pi / 2), abs(math.sin(ear.azimuth - math.pi / 2))
    if along <= 0:
        return 0.0
    corner = (ear.end + (1 - EAR_CORNER) * ear.half_width) / (along + across)
    return min(ear.end / along, ear.half_width / max(across, 1e-9), corner)
