"""Tongues for cable ties: their slots are open, a tie goes around them, and where there is none it says so."""

import numpy as np
import pytest
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_State
from scanners import CAPSULE, GROUND_AHEAD, scanner_at

from scanwright.cad.assembly.scenes import steps_of, tied_at
from scanwright.cad.layout.cables.leads import tied_mm
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, BASE_MOUNT, COUNTERWEIGHT, HUB_TIE, PLATE_TIE, ROTOR_LEADS
from scanwright.cad.layout.tie_seat import GROOVE, SLOT_ACROSS
from scanwright.cad.parts.all_parts import laid_out

TIE = (2.5, 1.1)  # width and thickness


@pytest.fixture(scope="module", params=[(0, 0, 90, 0), (-180, 55.68, 78.49, -80)], ids=["open hub", "shipped"])
def tied(request, parts_of):
    return parts_of(scanner_at(request.param))


def filled(assembly, points, part=ALIGNMENT_LINKAGE):
    where = BRepClass3d_SolidClassifier(assembly.made[part].wrapped)  # one: each takes a tenth of a second to make
    found = []
    for point in points.tolist():
        where.Perform(gp_Pnt(*point), 1e-6)
        found.append(where.State() == TopAbs_State.TopAbs_IN or where.IsOnAFace())
    return np.array(found)


def loop(seat):
    """Of a tie around the tongue: in both slots and over it, shape (n, 3)."""
    middle = (seat.first + seat.last) / 2
    along = middle + np.array([-TIE[0] / 2, 0.0, TIE[0] / 2])
    sides = seat.half + SLOT_ACROSS / 2 + np.array([-TIE[1] / 2, TIE[1] / 2])
    over = seat.high - GROOVE if seat.grooved else seat.high
    heights = np.linspace(seat.low - 1.0, over + TIE[1], 12)
    slots = [seat.points(along, sign * sides, heights) for sign in (1, -1)]
    top = seat.points(along, np.linspace(-seat.half, seat.half, 9), over + np.array([0.1, TIE[1]]))
    return np.concatenate([*slots, top])


def seats_of(assembly):
    p = assembly.layout.linkage
    return [(p.hub_tie, np.eye(3)), *((seat, p.stack.R().T) for seat in p.plate_ties)]


def test_a_tie_goes_around_every_tongue(tied):
    for seat, turn in seats_of(tied):
        assert not filled(tied, loop(seat) @ turn).any()
        across = np.linspace(-seat.half + 0.2, seat.half - 0.2, 7)
        inside = seat.points(
            np.array([seat.first + 0.2, seat.last]), across, np.array([seat.low + 0.2, seat.low + 1.5])
        )
        assert filled(tied, inside @ turn).all()


def test_a_tie_goes_through_the_foot_and_below_it(parts_of):
    assembly = parts_of(scanner_at(GROUND_AHEAD))
    deck, seats = assembly.layout.deck, assembly.layout.deck.ties
    assert len(seats) == 4
    for seat in seats:
        middle = np.array([(seat.first + seat.last) / 2])
        across = np.linspace(0.0, seat.half + SLOT_ACROSS / 2, 8)
        groove = seat.points(middle, np.concatenate([-across, across]), np.array([0.1, TIE[1]]))
        sides = (seat.half + SLOT_ACROSS / 2) * np.array([-1.0, 1.0])
        slots = seat.points(middle, sides, np.linspace(0.0, deck.foot_mm + 1.0, 8))
        tie = np.concatenate([groove, slots]) @ deck.rotation().T + np.array(deck.centre)
        assert not filled(assembly, tie, BASE_MOUNT).any()


def test_the_leads_leave_the_ring_under_the_tongue_near_enough_to_be_pulled_up(tied):
    seat = tied.layout.linkage.hub_tie
    laid = [lead for lead in tied.layout.leads if lead.path is not None]
    assert laid and all(0.3 < tied_mm(lead, seat) < 1.0 for lead in laid)


def test_the_bar_of_a_counterweight_lies_on_the_ear_and_not_on_the_tie(parts_of):
    seat = parts_of(scanner_at(GROUND_AHEAD)).layout.linkage.hub_tie
    assert seat.grooved and seat.high - GROOVE + TIE[1] < seat.high


def test_a_tie_is_counted_for_every_tongue_and_for_the_foot_of_a_mount(tied):
    layout, left_out = tied.layout, {entry.what for entry in tied.layout.left_out}
    plates = 0 if PLATE_TIE in left_out else len(layout.scanner.lidar.cable_y_mm)
    foot = 0 if layout.deck.flat else 1
    assert tied_at(layout) == ["hub"] + 2 * ["coil"] + plates * ["plate"] + foot * ["foot of the mount"]


def test_a_tie_that_went_in_under_the_bar_is_closed_and_no_other_asked_for(tied):
    steps = dict(steps_of(tied))
    words = steps[ROTOR_LEADS].words
    waits = COUNTERWEIGHT in steps and "First lay a cable tie" in steps[COUNTERWEIGHT].words
    assert waits == tied.layout.linkage.hub_tie.grooved
    assert ("Close the cable tie that is in the groove" in words) == waits
    assert ("Pull a cable tie through the two slots of the hub's tab" in words) != waits


def test_what_has_no_tongue_is_told():
    layout = laid_out(scanner_at((0, 19, 84, 41), sensor="URG-04LX", slip_ring=CAPSULE))
    (told,) = [entry for entry in layout.left_out if entry.what == HUB_TIE]
    assert layout.linkage.hub_tie is None and "hollow shaft" in told.why
