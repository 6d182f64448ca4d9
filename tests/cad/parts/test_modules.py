"""Parts that a task may ask for: there with it, told as left out without, and held as all the others are."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scanners import GROUND_AHEAD, RING, UPRIGHT, digest_of, scanner_at

from scanwright.cad.assembly.make import make_parts
from scanwright.cad.assembly.scenes import steps_of
from scanwright.cad.assembly.shadow import PartsWorkshop
from scanwright.cad.checks.loads.retention import hanging_on, retention_checks, worst_shares
from scanwright.cad.checks.products import module_checks
from scanwright.cad.files.bom import items_of
from scanwright.cad.layout.names import LIDAR
from scanwright.cad.layout.placement import placement_of
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import NO_MODULES, Modules
from scanwright.design.search.with_parts import Refused


def scanner_for(angles, modules, ring=RING):
    return scanner_at(angles, slip_ring=ring, modules=modules)


def bought(assembly):
    return items_of(assembly, dict.fromkeys(assembly.made, 1.0))


ON_TRIPOD = scanner_for(GROUND_AHEAD, Modules(tripod_foot=True))
SMALL = {"slip_ring": None, "sensor": "URG-04LX", "servo": "AX-12A"}  # soon made


@pytest.fixture(scope="module")
def on_tripod(parts_of):
    return parts_of(ON_TRIPOD)


@pytest.mark.parametrize("name", Modules.model_fields)
def test_what_is_not_asked_for_is_told_as_left_out_and_changes_nothing_that_is_made(name):
    asked, without = (scanner_for(GROUND_AHEAD, Modules(**{name: value})) for value in (True, False))
    assert without.modules == NO_MODULES
    specs = [placement_of(scanner) for scanner in (asked, without)]
    assert digest_of(asked) != digest_of(without)
    assert specs[0].linkage == specs[1].linkage and specs[0].stack == specs[1].stack


def test_the_tripod_foot_is_made_with_and_left_out_without(on_tripod, parts_of):
    without = parts_of(scanner_for(GROUND_AHEAD, NO_MODULES))
    assert "tripod_foot" in on_tripod.made and "tripod_foot" not in without.parts
    assert "tripod_foot" not in [left.what for left in on_tripod.layout.left_out]
    (left,) = [left for left in without.layout.left_out if left.what == "tripod_foot"]
    assert left.why == "the task does not require it (modules.tripod_foot)" and left.saved == 1
    assert on_tripod.made["base_mount"].Volume() == pytest.approx(without.made["base_mount"].Volume())


def test_the_world_begins_where_the_tripod_does(on_tripod):
    deck, plain = on_tripod.layout.deck, placement_of(scanner_for(GROUND_AHEAD, NO_MODULES)).deck
    assert deck.tripod.thickness == 8.0
    np.testing.assert_allclose(np.subtract(deck.t_world_rot, plain.t_world_rot), [0, 0, 8.0], atol=1e-6)
    turn = on_tripod.layout.scanner.angles.T_world_rot(0.0)[:3, :3]
    world = on_tripod.mesh("tripod_foot").vertices @ turn.T + deck.t_world_rot
    assert (world[:, 2].min(), world[:, 2].max()) == pytest.approx((0.0, 8.0), abs=1e-6)
    below = world[np.abs(world[:, 2]) < 1e-6, :2]
    rim = np.linalg.norm(below, axis=1)
    assert rim.min() == pytest.approx((6.35 + 0.2) / 2, abs=0.01)  # the tripod's screw comes in at the origin


def test_the_lidar_hangs_on_a_nut_of_the_tripod_and_no_screw_ends_in_plastic(on_tripod):
    joints = {(joint.part, joint.onto): joint for joint in on_tripod.layout.joints}
    of_mount, of_tripod = joints["base_mount", "tripod_foot"], joints["tripod", "tripod_foot"]
    assert ("base_mount", "deck") not in joints
    assert of_mount.traps and of_tripod.traps and of_tripod.count == 1
    assert LIDAR in hanging_on(on_tripod, of_tripod) and "base_mount" in hanging_on(on_tripod, of_tripod)
    assert (
        of_mount.length_mm <= on_tripod.layout.deck.foot_mm + on_tripod.layout.deck.tripod.thickness
    )  # nothing stands out below
    said = [check for check in retention_checks(on_tripod) if "tripod" in check.message]
    assert {check.code for check in said} == {"retention", "screw"}
    assert {check.severity for check in said} == {"ok"}


def test_a_lone_screw_keeps_the_foot_from_tipping_over_its_edge(on_tripod):
    """Against forces tried in many directions: the pull is what turns the foot about the edge it tips over."""
    (joint,) = [joint for joint in on_tripod.layout.joints if joint.part == "tripod"]
    axis = joint.axes[0]
    along, start, heel = np.array(axis.along), np.array(axis.start) / 1000, joint.heel_mm / 1000
    centre = start + 0.12 * along + 0.19 * np.cross(along, [0.3, 0.5, 0.8])
    rng = np.random.default_rng(1)
    forces = rng.normal(size=(20000, 3))
    forces /= np.linalg.norm(forces, axis=1)[:, None]
    moments = np.cross(centre - start, forces)
    tipping = np.linalg.norm(moments - np.outer(moments @ along, along), axis=1)
    tried = (np.abs(forces @ along) + tipping / heel).max()
    assert worst_shares(joint, centre)[0] == pytest.approx(tried, rel=1e-3)


def test_the_nut_is_bought_and_the_screw_of_the_tripod_is_not(on_tripod):
    items = bought(on_tripod)
    assert [item.quantity for item in items if item.number == "ASME B18.2.2 1/4-20 UNC"] == [1]
    assert not [item for item in items if item.kind == "screw" and "UNC" in item.number]
    titles = [step.title for _, step in steps_of(on_tripod)]
    assert titles.index("Tripod foot") == titles.index("Servo into the mount") + 1


def test_an_upright_axis_gets_its_mount_for_the_tripod():
    assert placement_of(scanner_for(UPRIGHT, NO_MODULES)).deck.flat
    deck = placement_of(scanner_for(UPRIGHT, Modules(tripod_foot=True))).deck
    assert not deck.flat and math.isclose(deck.normal[2], 1.0)


def on_bed_of(scanner, bed_mm):
    printer = scanner.printer.model_copy(update={"bed_mm": bed_mm})
    return replace(scanner, printer=printer)


def test_a_part_that_no_bed_holds_is_refused_with_its_size_and_what_would_serve():
    scanner = scanner_at((0, 40, -20, -70), **SMALL, modules=Modules(tripod_foot=True))
    small, foot = on_bed_of(scanner, (99.0, 200.0, 99.0)), lambda spec: spec.name == "tripod_foot"
    with pytest.raises(BuildError) as refused:
        make_parts(small, foot)
    assert str(refused.value) == (
        "tripod_foot: 100 x 100 x 8 mm in its print pose: the bed of fdm-0.4 is 99 x 200 x 99 mm (bed_mm); use a "
        "printer with bed_mm = [100.0, 100.0, 8.0], or a smaller pattern of holes in [deck], or other angles"
    )
    assert "tripod_foot" in make_parts(on_bed_of(scanner, (100.0, 100.0, 8.0)), foot).made


def test_the_search_goes_on_to_the_next_setting_where_a_bed_is_too_small():
    setting_deg = (0, 40, -20, -70)
    scanner = on_bed_of(scanner_at(setting_deg, **SMALL), (60.0, 60.0, 60.0))
    answer = PartsWorkshop(scanner).shadow(np.radians(setting_deg))
    assert isinstance(answer, Refused) and "in its print pose: the bed of fdm-0.4 is 60 x 60 x 60 mm" in answer.reason


def test_a_module_that_the_task_requires_and_that_has_no_place_is_an_error():
    asked, plain = (scanner_for(GROUND_AHEAD, modules) for modules in (Modules(tripod_foot=True), NO_MODULES))
    left = (LeftOut("tripod_foot", "no tripod holds it", 1, "parts"),)

    def checked(scanner, left_out):
        return module_checks(SimpleNamespace(layout=SimpleNamespace(scanner=scanner, left_out=left_out)))

    (failed,) = checked(asked, left)
    assert (failed.severity, failed.code, failed.subject) == ("error", "module", "tripod_foot")
    assert "no tripod holds it" in failed.message
    assert checked(plain, left) == [] and checked(asked, ()) == []
