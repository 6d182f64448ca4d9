"""Nut traps: a nut of the standard goes in, cannot turn, is carried where the screw pulls it, and is bought."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scanners import TILTED, bare_linkage, scanner_at

from scanwright.cad import outlines, solids
from scanwright.cad.assembly.scenes import scenes_of
from scanwright.cad.checks.products import without_traps
from scanwright.cad.files.bom import items_of
from scanwright.cad.files.manual.instructions import instructions_text
from scanwright.cad.geometry.holes import rounds_of
from scanwright.cad.labels.fit_coupon import coupon_plate
from scanwright.cad.layout.direct.cage import nut_fits
from scanwright.cad.layout.placement import drive_of
from scanwright.cad.parts.linkage.alignment_linkage import alignment_linkage
from scanwright.cad.screws import SCREWS, thread_in_part, trap_of
from scanwright.design.angles import Angles
from scanwright.design.catalogue.catalogue import load_catalogue

M3 = SCREWS["M3"]
ACROSS, HEIGHT = 5.5, 2.4  # ISO 4032
PRINTER = load_catalogue().products["fdm-0.4-nut"]


@pytest.fixture(scope="module")
def nutted(parts_of):
    scanner = scanner_at(TILTED, printer="fdm-0.4-nut")
    assembly = parts_of(scanner)
    rounds = {name: rounds_of(solid) for name, solid in (assembly.made | assembly.bought).items()}
    return scanner, assembly, rounds, assembly.layout.joints


def _nut(start, along, turn_deg, length=HEIGHT):
    """A hexagon with its face at `start`, its axis `along`, a corner `turn_deg` from z, or from y if that is along."""
    helper = np.array([0.0, 0.0, 1.0]) if abs(along[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    side = np.cross(helper, along) / np.linalg.norm(np.cross(helper, along))
    frame = np.stack([side, np.cross(along, side), along], axis=1)
    outline = outlines.polygon(ACROSS / math.sqrt(3), 6, math.radians(90.0 + turn_deg))
    return solids.prism(outline, 0.0, length).moved(solids.location(frame, start))


def _shared(one, other):
    return one.intersect(other).Volume()


def _holes(rounds, part):
    size = trap_of(M3, PRINTER).hole
    return [(np.array(r.low), np.array(r.high)) for r in rounds[part] if r.hole and abs(r.diameter - size) < 1e-6]


def test_a_nut_drops_into_a_boss_before_the_ring_comes(nutted):
    _, assembly, rounds, _ = nutted
    base = assembly.made["slip_ring_adapter"]
    outer = [ends for ends in _holes(rounds, "slip_ring_adapter") if max(np.hypot(*end[:2]) for end in ends) > 29.0]
    assert len(outer) == 4
    for ends in outer:
        inner, outside = sorted(ends, key=lambda end: np.hypot(*end[:2]))
        inwards = (inner - outside) / np.linalg.norm(inner - outside)
        rests = _nut(inner, inwards, 0.0)
        assert sum(_shared(rests, body) for body in (assembly.made | assembly.bought).values()) < 1e-3
        for lift in (2.0, 4.0, 8.0):
            assert _shared(_nut(inner + np.array([0.0, 0.0, lift]), inwards, 0.0), base) < 1e-3
        assert _shared(_nut(inner, inwards, 30.0), base) > 0.5
        assert _shared(_nut(inner - 0.5 * inwards, inwards, 0.0), base) > 5.0


def test_nuts_are_in_the_documents_and_those_without_a_trap_found(nutted):
    _, assembly, _, joints = nutted
    trapped = {(joint.part, joint.onto): joint for joint in joints if joint.traps}
    cage = trapped[("bearing_cage", "slip_ring_adapter")]
    assert len(trapped) == 1 and (cage.count, cage.fixing) == (4, "trap")
    assert cage.length_mm >= cage.grip_mm + 3.0 + HEIGHT - 0.1  # the leg, the wall, the nut
    items = items_of(assembly, dict.fromkeys(assembly.made, 1.0))
    assert next(item.quantity for item in items if item.number == "ISO 4032 M3") == 4
    text = instructions_text(assembly, scenes_of(assembly), [])
    assert "onto 4 nuts M3 in slip_ring_adapter" in text and "nuts into the pockets of slip_ring_adapter" in text
    assert without_traps(PRINTER, joints) == []
    core = thread_in_part(M3, PRINTER, nut_fits=False)
    plain = [replace(cage, fixing="thread", thread=core)]
    assert [finding.subject for finding in without_traps(PRINTER, plain)] == [cage.onto]
    stack = assembly.layout.stack
    assert nut_fits(trap_of(M3, PRINTER), stack, stack.ring_bottom - 15.0, 1.2)
    assert not nut_fits(trap_of(M3, PRINTER), stack, stack.ring_bottom - 7.0, 1.2)  # the ring comes down to the nut


def test_the_ears_of_a_sub_plate_hold_in_nuts_from_below(made):
    setting = Angles(alpha_rot=0, beta_rot=0, alpha_laser=21, beta_laser=-21)
    angles = made.scanner.angles.model_copy(update={"angles_deg": setting, "t_world_rot_mm": (0.0, 0.0, 0.0)})
    scanner = replace(made.scanner, printer=PRINTER, angles=angles)
    linkage = bare_linkage(scanner)
    assert len(linkage.ear_screws) == 4
    part = alignment_linkage(linkage).moved(solids.location(drive_of(scanner).stack.R().T))  # in the laser frame
    low = linkage.top - 8.0
    for x, y in linkage.ear_screws:
        floor = np.array([x, y, low + trap_of(M3, PRINTER).depth])
        turn = 90.0 if linkage.stack.sub_plate == "x" else 0.0
        down = np.array([0.0, 0.0, -1.0])
        assert _shared(_nut(floor, down, turn, 17.0), part) < 1e-3
        assert _shared(_nut(floor, down, turn + 30.0), part) > 0.5
        assert _shared(_nut(floor - 0.5 * down, down, turn), part) > 5.0


def test_the_coupon_of_such_a_profile_has_pockets(made):
    scanner = replace(made.scanner, printer=PRINTER)
    coupon, trap = coupon_plate(scanner, made.result.assembly.layout.stack), trap_of(M3, PRINTER)
    holes = [hole for hole in rounds_of(coupon) if hole.hole and abs(hole.diameter - trap.hole) < 1e-6]
    under = sorted((h for h in holes if h.length < 1.5), key=lambda hole: hole.low[0])
    assert len(under) == 5 and {round(hole.length, 6) for hole in under} == {1.0}
    fits = [_shared(_nut(np.array(hole.high), np.array([0.0, 0.0, 1.0]), 90.0), coupon) < 1e-3 for hole in under]
    assert fits == [True] * 5
