"""Parts that a task may ask for: there with it, told as left out without, and held as all the others are."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from quick_tests import samples
from scanners import GROUND_AHEAD, RING, ROLLING, UPRIGHT, scanner_at

from scanwright.cad.assembly.make import make_parts
from scanwright.cad.assembly.shadow import PartsWorkshop
from scanwright.cad.assembly.steps import steps_of
from scanwright.cad.checks.clearance import clearance_checks
from scanwright.cad.checks.remarks import left_out_of
from scanwright.cad.checks.retention import hanging_on, retention_checks, worst_shares
from scanwright.cad.checks.run import module_checks
from scanwright.cad.files.bom import items_of
from scanwright.cad.layout.all_joints import joints_of
from scanwright.cad.layout.deck import FOOT_THICKNESS
from scanwright.cad.layout.layout import config_hash, layout_of
from scanwright.cad.layout.modules.homing_flag import bracket_of, passes_at_deg, vane_half_deg
from scanwright.cad.layout.modules.ring_cover import cover_of
from scanwright.cad.layout.names import LIDAR
from scanwright.cad.parts.all_parts import parts_of
from scanwright.design.electrics.rules import broken_rules
from scanwright.design.electrics.wiring import network_of
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import NO_MODULES, Modules
from scanwright.design.search.with_parts import Refused


def scanner_for(angles, modules, ring=RING):
    return scanner_at(angles, slip_ring=ring, modules=modules)


def bought(assembly):
    scanner = assembly.layout.scanner
    masses = dict.fromkeys(assembly.made, 1.0)
    return items_of(scanner, assembly, joints_of(assembly.layout), masses, config_hash(scanner))


COVERED_ON_TRIPOD = scanner_for(GROUND_AHEAD, Modules(ring_cover=True, tripod_foot=True))
HOMED = [scanner_for(angles, Modules(homing_flag=True)) for angles in (GROUND_AHEAD, UPRIGHT)]
SMALL = {"slip_ring": None, "sensor": "URG-04LX", "servo": "AX-12A"}  # soon made
PRINTED = {"slip_ring": None, "sensor": "STL27L", "servo": "XL430-W250"}


@pytest.fixture(scope="module")
def on_tripod(parts_of):
    return parts_of(COVERED_ON_TRIPOD)


@pytest.mark.parametrize("name", Modules.model_fields)
def test_what_is_not_asked_for_is_told_as_left_out_and_changes_nothing_that_is_made(name):
    asked, without = (scanner_for(GROUND_AHEAD, Modules(**{name: value})) for value in (True, False))
    assert without.modules == NO_MODULES
    specs = [layout_of(scanner) for scanner in (asked, without)]
    assert config_hash(asked) != config_hash(without)
    assert replace(specs[0].linkage, flag=None) == specs[1].linkage and specs[0].stack == specs[1].stack


def test_the_tripod_foot_is_made_with_and_left_out_without(on_tripod, parts_of):
    without = parts_of(scanner_for(GROUND_AHEAD, NO_MODULES))
    assert "tripod_foot" in on_tripod.made and "tripod_foot" not in without.parts
    assert "tripod_foot" not in [left.what for left in left_out_of(on_tripod)]
    (left,) = [left for left in left_out_of(without) if left.what == "tripod_foot"]
    assert left.why == "the task does not ask for it by modules.tripod_foot" and left.saved == 1
    assert on_tripod.made["base_mount"].Volume() == pytest.approx(without.made["base_mount"].Volume())


def test_the_world_begins_where_the_tripod_does(on_tripod):
    deck, plain = on_tripod.layout.deck, layout_of(scanner_for(GROUND_AHEAD, NO_MODULES)).deck
    assert deck.tripod.thickness == 8.0
    np.testing.assert_allclose(np.subtract(deck.t_world_rot, plain.t_world_rot), [0, 0, 8.0], atol=1e-6)
    turn = on_tripod.layout.scanner.angles.T_world_rot(0.0)[:3, :3]
    world = on_tripod.mesh("tripod_foot").vertices @ turn.T + deck.t_world_rot
    assert (world[:, 2].min(), world[:, 2].max()) == pytest.approx((0.0, 8.0), abs=1e-6)
    below = world[np.abs(world[:, 2]) < 1e-6, :2]
    rim = np.linalg.norm(below, axis=1)
    assert rim.min() == pytest.approx((6.35 + 0.2) / 2, abs=0.01)  # the tripod's screw comes in at the origin


def test_the_lidar_hangs_on_a_nut_of_the_tripod_and_no_screw_ends_in_plastic(on_tripod):
    joints = {(joint.part, joint.onto): joint for joint in joints_of(on_tripod.layout)}
    of_mount, of_tripod = joints["base_mount", "tripod_foot"], joints["tripod", "tripod_foot"]
    assert ("base_mount", "deck") not in joints
    assert of_mount.traps and of_tripod.traps and of_tripod.count == 1
    assert LIDAR in hanging_on(on_tripod, of_tripod) and "base_mount" in hanging_on(on_tripod, of_tripod)
    assert of_mount.length_mm <= FOOT_THICKNESS + on_tripod.layout.deck.tripod.thickness  # nothing stands out below
    said = [check for check in retention_checks(on_tripod.layout.scanner, on_tripod) if "tripod" in check.message]
    assert {check.kind for check in said} == {"retention", "screw"}
    assert {check.severity for check in said} == {"pass"}


def test_a_lone_screw_keeps_the_foot_from_tipping_over_its_edge(on_tripod):
    """Against forces tried in many directions: the pull is what turns the foot about the edge it tips over."""
    (joint,) = [joint for joint in joints_of(on_tripod.layout) if joint.part == "tripod"]
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
    assert layout_of(scanner_for(UPRIGHT, NO_MODULES)).deck.flat
    layout = layout_of(scanner_for(UPRIGHT, Modules(tripod_foot=True)))
    assert not layout.deck.flat and math.isclose(layout.deck.normal[2], 1.0)


@pytest.fixture(scope="module", params=[COVERED_ON_TRIPOD, scanner_for(UPRIGHT, Modules(ring_cover=True))])
def covered(request, parts_of):
    return parts_of(request.param)


def test_the_cover_hides_the_ring_from_the_side_and_neither_it_nor_the_foot_touches_anything(covered):
    assert {check.severity for check in clearance_checks(covered)} == {"pass"}
    assert "ring_cover" not in [left.what for left in left_out_of(covered)]
    mesh, stack = covered.mesh("ring_cover"), covered.layout.stack
    tube = trimesh.Trimesh(mesh.vertices, mesh.faces)
    z = np.linspace(stack.ring_bottom + 12.5, min(mesh.vertices[:, 2].max(), stack.ring_top) - 0.5, 9)
    azimuth = np.linspace(0, 2 * np.pi, 48, endpoint=False) + 0.01
    out = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(48)], axis=1)
    starts = np.array([[0, 0, height] for height in z for _ in azimuth])
    hit = tube.ray.intersects_any(starts, np.tile(out, (len(z), 1)))
    assert hit.mean() > 0.98  # all but the holes of its two screws


def test_the_cover_goes_over_what_holds_the_ring_before_the_lidar_comes(covered):
    titles = [step.title for _, step in steps_of(covered)]
    before = "Bearing and cage" if covered.layout.stack.bearing else "Slip ring"
    assert titles.index(before) < titles.index("Cover around the ring") < titles.index("Lidar on its seat")
    (joint,) = [joint for joint in joints_of(covered.layout) if joint.part == "ring_cover"]
    assert joint.count == 2 and joint.length_mm < joint.grip_mm + joint.thread_mm  # no screw reaches the ring
    assert LIDAR not in hanging_on(covered, joint)
    said = [check for check in retention_checks(covered.layout.scanner, covered) if "ring_cover" in check.message]
    assert len(said) == 2 and {check.severity for check in said} == {"pass"}


@pytest.mark.parametrize(
    ("ring", "why"), [(None, "this scanner has no slip ring"), ("SRC022A-6", "the tower is around the ring")]
)
def test_a_cover_without_a_ring_to_cover_is_left_out_with_the_reason(ring, why):
    layout = layout_of(scanner_for(GROUND_AHEAD, Modules(ring_cover=True), ring))
    left = cover_of(layout.scanner, layout.stack)
    assert isinstance(left, LeftOut) and left.why == why
    assert "ring_cover" not in [spec.name for spec in parts_of(layout)]


def test_without_a_cover_nothing_is_drilled_for_it(covered, parts_of):
    scanner = replace(covered.layout.scanner, modules=NO_MODULES)
    onto = "bearing_cage" if covered.layout.stack.bearing else "slip_ring_adapter"
    plain = parts_of(scanner)
    (left,) = [left for left in left_out_of(plain) if left.what == "ring_cover"]
    assert left.why == "the task does not ask for it by modules.ring_cover"
    missing = plain.made[onto].Volume() - covered.made[onto].Volume()
    assert missing == pytest.approx(2 * math.pi * 1.25**2 * 5.0, rel=0.02)


@pytest.fixture(scope="module", params=samples(HOMED, HOMED[:1]))
def homed(request, parts_of):
    return parts_of(request.param)


def test_the_flag_darkens_the_switch_where_the_step_says_and_nowhere_else(homed):
    layout = homed.layout
    bracket, flag = bracket_of(layout.scanner, layout.stack), layout.linkage.flag
    switch = homed.mesh("switch_body")
    turn = np.array(
        [[np.cos(bracket.azimuth), -np.sin(bracket.azimuth)], [np.sin(bracket.azimuth), np.cos(bracket.azimuth)]]
    )
    fork = switch.vertices[:, :2] @ turn  # along the radius, and across it
    reach = np.abs(fork[:, 0] - bracket.radius)
    assert reach[reach < 7.5].min() == pytest.approx(layout.scanner.switch.slot_mm / 2)
    linkage = homed.mesh("alignment_linkage")
    body = trimesh.Trimesh(linkage.vertices, linkage.faces)
    light = bracket.seat + layout.scanner.switch.beam_height_mm
    angles = np.radians(np.arange(-180.0, 180.0, 2.5))
    middle = bracket.azimuth - angles  # of the slot, to the linkage
    out = np.stack([np.cos(middle), np.sin(middle), np.zeros(len(middle))], axis=1)
    points = bracket.radius * out + [0.0, 0.0, light]
    dark = np.degrees(angles[body.contains(points)])
    told = passes_at_deg(bracket, flag)
    off = (dark - told + 180) % 360 - 180
    assert len(dark) >= 3 and np.abs(off).max() <= vane_half_deg(flag) + 0.1 and np.abs(off).min() < 1.3
    (words,) = [step.words for name, step in steps_of(homed) if name == "homing_bracket"]
    assert f"in the light at {told:.1f} deg" in words


def test_the_flag_meets_nothing_and_its_bracket_comes_before_the_linkage(homed):
    assert {check.severity for check in clearance_checks(homed)} == {"pass"}
    names = [name for name, _ in steps_of(homed)]
    onto = "bearing_cage" if homed.layout.stack.bearing else "slip_ring_adapter"
    assert names.index(onto) < names.index("homing_bracket") < names.index("alignment_linkage")
    said = [check for check in retention_checks(homed.layout.scanner, homed) if "homing_bracket" in check.message]
    assert len(said) == 4 and {check.severity for check in said} == {"pass"}


def test_the_switch_is_bought_and_wired(homed):
    rows = [item for item in bought(homed) if item.number == "EE-SX672"]
    assert [(row.quantity, row.supplier) for row in rows] == [(1, "Omron")]
    assert [item.quantity for item in bought(homed) if "EE-1001" in item.part] == [1]
    network = network_of(homed.layout.scanner, homed.layout.drive.switch)
    assert broken_rules(network) == []
    ends = {wire.end[1]: wire.net for wire in network.wires if wire.end[0] == "switch of the flag"}
    assert ends == {"+": "5 V", "-": "0 V", "OUT": "home"}


def test_without_a_flag_the_hub_is_round_and_nothing_is_drilled(homed, parts_of):
    plain = parts_of(replace(homed.layout.scanner, modules=NO_MODULES, switch=None))
    (left,) = [left for left in left_out_of(plain) if left.what == "homing_flag"]
    assert left.why == "the task does not ask for it by modules.homing_flag"
    assert "homing_flag" not in [left.what for left in left_out_of(homed)]
    assert "homing_bracket" not in plain.parts and "switch_body" not in plain.bodies
    onto = "bearing_cage" if homed.layout.stack.bearing else "slip_ring_adapter"
    missing = plain.made[onto].Volume() - homed.made[onto].Volume()
    assert missing == pytest.approx(2 * math.pi * 1.25**2 * 5.0, rel=0.02)
    assert homed.mesh("alignment_linkage").vertices[:, 2].min() < plain.layout.stack.shoulder - 5.0


@pytest.mark.parametrize(
    ("asked", "ring", "angles", "why"),
    [
        ({}, "SRC022A-6", GROUND_AHEAD, "the tower around the capsule has no place for its bracket"),
        ({"ring_cover": True}, RING, GROUND_AHEAD, "the ring cover stands where its bracket would"),
        ({}, None, UPRIGHT, "neither ring nor bearing needs anything beside the shaft"),
    ],
)
def test_a_flag_without_a_place_for_its_switch_is_left_out_with_the_reason(asked, ring, angles, why):
    layout = layout_of(scanner_for(angles, Modules(homing_flag=True, **asked), ring))
    left = bracket_of(layout.scanner, layout.stack)
    assert isinstance(left, LeftOut) and left.why.startswith(why)
    assert (
        layout.linkage.flag is None
        and layout.drive.switch is None
        and "homing_bracket" not in [spec.name for spec in parts_of(layout)]
    )


def on_bed_of(scanner, bed_mm):
    printer = scanner.printer.model_copy(update={"bed_mm": bed_mm})
    return replace(scanner, printer=printer)


def test_a_part_that_no_bed_holds_is_refused_with_its_size_and_what_would_serve():
    scanner = scanner_at((0, 40, -20, -70), **SMALL, modules=Modules(tripod_foot=True))
    small, foot = on_bed_of(scanner, (99.0, 200.0, 99.0)), lambda spec: spec.name == "tripod_foot"
    with pytest.raises(BuildError) as refused:
        make_parts(small, foot)
    assert str(refused.value) == (
        "tripod_foot: 100 x 100 x 8 mm as it is printed: the bed of fdm-0.4 is 99 x 200 x 99 mm (bed_mm); a printer "
        "with bed_mm = [100.0, 100.0, 8.0] would hold it, or a smaller pattern of holes in [deck], or other angles"
    )
    assert "tripod_foot" in make_parts(on_bed_of(scanner, (100.0, 100.0, 8.0)), foot).made


def test_the_search_goes_on_to_the_next_setting_where_a_bed_is_too_small():
    setting_deg = (0, 40, -20, -70)
    scanner = on_bed_of(scanner_at(setting_deg, **SMALL), (60.0, 60.0, 60.0))
    answer = PartsWorkshop(scanner).shadow(np.radians(setting_deg))
    assert isinstance(answer, Refused) and "as it is printed: the bed of fdm-0.4 is 60 x 60 x 60 mm" in answer.reason


@pytest.mark.parametrize(
    ("module", "options", "why"),
    [
        ("homing_flag", PRINTED, "neither ring nor bearing"),
        ("homing_flag", {"slip_ring": "SRC022A-6"}, "the tower around the capsule"),
        ("ring_cover", PRINTED, "no slip ring"),
        ("ring_cover", {"slip_ring": "SRC022A-6"}, "the tower is around the ring"),
    ],
)
def test_a_module_that_the_task_requires_and_that_has_no_place_is_an_error(module, options, why):
    angles = ROLLING if options["slip_ring"] else (0, 0, 0, 50)
    scanner = scanner_at(angles, modules=Modules(**{module: True}), **options)
    layout = layout_of(scanner)
    without = replace(layout, scanner=replace(scanner, modules=NO_MODULES))
    found = [module_checks(each.scanner, left_out_of(SimpleNamespace(layout=each))) for each in (layout, without)]
    (failed,), none = found
    assert (failed.severity, failed.kind, failed.where) == ("error", "module", module) and why in failed.message
    assert none == []
