"""The leads as bodies: they touch nothing, hide no beam, and a bad way is seen."""

from dataclasses import replace

import numpy as np
import pytest
from scanners import scanner_at

from scanwright.cad.assembly.bought import lead_solid
from scanwright.cad.assembly.scenes import steps_of
from scanwright.cad.assembly.shadow import shadow_of, triangles_of
from scanwright.cad.checks.cables import rotor_cable_checks
from scanwright.cad.checks.clearance import clearance_checks
from scanwright.cad.layout.cables.lead_joint import JOINT_LENGTH, TUBE_WALL
from scanwright.cad.layout.cables.route import Path


@pytest.fixture(scope="module")
def lying(parts_of):
    return parts_of(scanner_at((0, 0, 90, 0)))


def test_leads_touch_nothing_and_bend_no_further_than_they_may(lying):
    checks = [*rotor_cable_checks(lying), *clearance_checks(lying)]
    assert [check.message for check in checks if check.severity not in ("ok", "note")] == []
    assert [check.code for check in checks].count("lead_bend") == 2


def test_a_tube_has_the_volume_of_its_wires_and_its_joint(lying):
    for number, lead in enumerate(lying.layout.leads, start=1):
        half, wide = lead.diameter / 2, lead.diameter / 2 + TUBE_WALL
        wanted = np.pi * (
            half**2 * (lead.path.length() - JOINT_LENGTH) + wide**2 * JOINT_LENGTH
        )  # Pappus: the middle is the centroid
        assert lying.bought[f"rotor_lead_{number}"].Volume() == pytest.approx(wanted, rel=1e-4)


def test_a_lead_straight_through_the_linkage_is_seen(lying):
    first = lying.layout.leads[0]
    short = Path((first.path.corners[0], first.path.corners[-1]), first.radius)
    bad = replace(lying, bought=lying.bought | {"rotor_lead_1": lead_solid(replace(first, path=short, joint=None))})
    (found,) = [check for check in clearance_checks(bad) if check.code == "interference"]
    assert found.severity == "error" and "rotor_lead_1" in found.subject and found.value > 10


def test_no_beam_meets_a_lead_that_was_not_hidden_before(lying):
    triangles = triangles_of(lying)
    assert {"rotor_lead_1", "rotor_lead_2"} <= triangles.keys()
    without = {name: corners for name, corners in triangles.items() if not name.startswith("rotor_lead")}
    scanner, turning = lying.layout.scanner, lying.turning()
    hidden, before = (shadow_of(scanner, each, turning).hidden() for each in (triangles, without))
    assert float(np.sum(hidden >= 1.0)) == float(np.sum(before >= 1.0))


def test_no_way_is_told_with_its_numbers(lying):
    blocked = replace(
        lying, layout=replace(lying.layout, leads=(replace(lying.layout.leads[0], path=None, radius=32.0),))
    )
    (check,) = rotor_cable_checks(blocked)
    assert check.severity == "warning" and check.limit == 32.0 and "y = -15 mm" in check.message


def test_the_last_step_tells_where_each_lead_runs(lying):
    thing, step = steps_of(lying)[-1]
    assert thing == "rotor_leads"
    for lead in lying.layout.leads:
        assert f"is {lead.path.length():.0f} mm long" in step.words
    assert "plug the lidar's USB-A plug into it" in step.words and "into the terminal block, 2 poles" in step.words
    assert "jacket" not in step.words
