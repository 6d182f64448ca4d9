"""Cables that do not turn: from servo and stator to the edge of foot or deck, clear of what turns, tied to the foot."""

from dataclasses import replace

import numpy as np
import pytest
from scanners import CAPSULE, GROUND_AHEAD, scanner_at

from scanwright.cad.layout.cables.fixed import fixed_cables_of
from scanwright.cad.layout.placement import placement_of
from scanwright.cad.parts.all_parts import laid_out
from scanwright.design.deck_holes import Rectangle

LAID = [
    (GROUND_AHEAD, {}),  # a cage around the ring
    ((0, 10, 30, 0), {}),  # arms beside it
    ((0, 19, 84, 41), {"sensor": "URG-04LX", "slip_ring": CAPSULE}),
    ((0, 0, 0, 0), {}),  # upright on the deck
]


@pytest.fixture(scope="module")
def ground_ahead():
    return laid_out(scanner_at(GROUND_AHEAD))


@pytest.mark.parametrize(("setting", "products"), LAID, ids=["cage", "arms", "belt", "deck"])
def test_every_cable_leaves_its_device_and_keeps_its_bend(setting, products):
    layout = laid_out(scanner_at(setting, **products))
    leads = layout.cables
    assert [lead.name for lead in leads] == ["servo_cable", "stator_leads"]
    for lead in leads:
        points = lead.path.points(1.0)
        assert lead.path.least_radius() >= lead.radius and lead.mass_g > 0
        assert points[:, 2].max() < layout.drive.ceiling  # below all that turns
        if layout.deck.flat:
            continue
        R, centre = layout.deck.rotation(), np.array(layout.deck.centre)
        end = (points[-1] - centre) @ R
        half = np.array(layout.deck.foot[:2])
        assert (np.abs(end[:2]) > half).any() and abs(end[2] - layout.deck.foot_mm - lead.diameter / 2) < 1.5
        assert (((points - centre) @ R)[:, 2] > lead.diameter / 2).all()
    middles = [lead.path.points(1.0) for lead in leads]
    apart = np.linalg.norm(middles[0][:, None] - middles[1], axis=2).min()
    assert apart > sum(lead.diameter for lead in leads) / 2


def test_on_the_foot_each_lies_between_two_slots(ground_ahead):
    deck = ground_ahead.deck
    for lead in ground_ahead.cables:
        points = (lead.path.points(0.5) - np.array(deck.centre)) @ deck.rotation()
        inside = []
        for seat in deck.ties:
            out = seat.direction()
            along, across = points @ out, points @ [-out[1], out[0], 0.0]
            over = (along > seat.first) & (along < seat.last) & (points[:, 2] < deck.foot_mm + lead.diameter)
            inside.append(over.any() and (np.abs(across[over]) + lead.diameter / 2 < seat.half).all())
        assert inside.count(True) == 1


def test_what_the_catalogue_does_not_tell_is_not_laid(ground_ahead):
    scanner = ground_ahead.scanner
    silent = replace(scanner, servo=scanner.servo.model_copy(update={"cable_out": None}))
    assert [lead.name for lead in fixed_cables_of(replace(ground_ahead, scanner=silent), ())] == ["stator_leads"]


def test_a_cable_that_cannot_bend_has_no_way(ground_ahead):
    scanner = ground_ahead.scanner
    stiff = scanner.servo.model_copy(update={"cable_bend_radius_mm": 40.0})
    (lead, _) = fixed_cables_of(replace(ground_ahead, scanner=replace(scanner, servo=stiff)), ())
    assert lead.path is None and lead.mass_g == 0


def test_no_slot_of_the_foot_is_where_a_screw_of_the_deck_is():
    scanner = replace(scanner_at(GROUND_AHEAD), deck=Rectangle(shape="rectangle", size_mm=(80.0, 20.0), screw="M4"))
    seats = placement_of(scanner).deck.ties
    assert {round(np.degrees(seat.azimuth)) % 180 for seat in seats} == {90}
