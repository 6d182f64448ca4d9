"""The checks: that each sees what it is there for, measured on bodies whose answer is known."""

import json
import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scanners import CAPSULE, UPRIGHT, scanner_at

from scanwright.cad.assembly.make import make_parts
from scanwright.cad.checks import run
from scanwright.cad.checks.checks_json import checks_text, failure_lines, read_checks
from scanwright.cad.checks.clearance import clearance_checks, together_check, turning_check
from scanwright.cad.checks.loads import mechanics
from scanwright.cad.checks.loads.mechanics import load_checks
from scanwright.cad.checks.printing import islands_check, islands_of, part_checks, thin_walls
from scanwright.cad.checks.products import wiring_checks
from scanwright.cad.checks.table import at_least, at_most
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.geometry.mesh import TriMesh, mesh_of
from scanwright.cad.geometry.print_pose import print_pose
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.placement import drive_of, placement_of
from scanwright.cad.layout.rotor.imbalance import keeps_flank
from scanwright.cad.solids import box, location, upright
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import BuildError
from scanwright.design.findings import errors_in
from scanwright.design.motion import Sweep
from scanwright.design.scanner import scanner_of


def scanner_for(alpha_rot, beta_rot, alpha, beta, lidar="UTM-30LX", servo="MX-64R", friction_nm=None):
    """A scanner with a ring whose friction is not in the catalogue, unless it is given."""
    angles = AngleSet(
        task="test",
        angles_deg=Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha, beta_laser=beta),
        sensor=lidar,
        servo=servo,
        slip_ring="SNU11-P0210",
    )
    scanner = scanner_of(angles, "fdm-0.4", load_catalogue())
    return replace(scanner, slip_ring=scanner.slip_ring.model_copy(update={"friction_nm": friction_nm}))


def turned(mesh, angle):
    c, s = np.cos(angle), np.sin(angle)
    return TriMesh(mesh.vertices @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), mesh.faces)


def least_room(rotor, stator):
    """Of a turning and a standing body, over a whole turn."""
    return turning_check({"rotor": rotor, "stator": stator}, {"rotor"}).value


def test_the_distance_over_a_turn_of_bodies_known_by_arithmetic():
    arm = mesh_of(box((10, -2, 0), (30, 2, 4)))  # reaches to hypot(30, 2)
    post = mesh_of(box((32, -40, -5), (40, 40, 9)))  # its face is 32 from the axis
    assert least_room(arm, post) == pytest.approx(32 - np.hypot(30, 2), abs=0.011)
    assert least_room(turned(arm, 2.0), post) == pytest.approx(32 - np.hypot(30, 2), abs=0.011)
    shelf = mesh_of(box((-50, 12, 5.5), (50, 60, 8)))  # above the arm
    assert least_room(arm, shelf) == pytest.approx(1.5, abs=1e-3)
    plate = mesh_of(upright(9.0, -3.0, 7.0))  # inside the arm's circle
    assert least_room(arm, plate) == pytest.approx(1.0, abs=0.011)


def test_a_meeting_that_only_one_position_shows():
    finger = mesh_of(box((28, -1, 0), (30, 1, 3)))
    peg = mesh_of(upright(0.5, 1.0, 2.0, 0.0, -29.0))  # a quarter turn away from the finger
    assert least_room(finger, peg) == 0.0
    assert least_room(finger, mesh_of(upright(0.5, 1.0, 2.0, 0.0, -32.0))) > 1.4


def test_a_body_wholly_inside_another_meets_it():
    hollow = mesh_of(upright(40.0, -20.0, 20.0))
    inside = mesh_of(box((5, 5, -2), (7, 7, 2)))
    assert least_room(hollow, inside) == 0.0 == least_room(inside, hollow)


corner = st.floats(-30, 30)


@settings(deadline=None, max_examples=25)
@given(points=st.lists(st.tuples(corner, corner, corner), min_size=8, max_size=8), turn=st.floats(0, 6.28))
def test_no_position_is_nearer_than_the_distance_over_a_turn(points, turn):
    points = np.array(points) + np.arange(8)[:, None] * [0.0131, 0.0217, 0.0119]
    one, other = np.split(points, 2)
    one = one + np.array([60, 0, 0])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    least = least_room(TriMesh(one, faces), TriMesh(other, faces))
    spun = turned(TriMesh(one, faces), turn).vertices
    samples = [w @ body for body in (spun, other) for w in [np.random.default_rng(3).dirichlet(np.ones(4), 300)]]
    gap = np.linalg.norm(samples[0][:, None] - samples[1][None], axis=2).min()
    assert gap >= least - 0.02


def test_shared_room_is_found_by_name():
    meshes = {
        "alignment_linkage": mesh_of(box((0, 0, 0), (10, 10, 10))),
        "lidar_body": mesh_of(box((9, 0, 0), (20, 10, 10))),
        "base_mount": mesh_of(box((-30, -30, -30), (30, 30, -20))),
    }
    turning = ("alignment_linkage", "lidar_body")
    clearance, shared = turning_check(meshes, turning), together_check(meshes, turning)
    assert clearance.severity == "ok" and shared.severity == "error"
    assert (shared.value, shared.subject) == (pytest.approx(100, rel=1e-3), "alignment_linkage and lidar_body")
    meshes["lidar_body"] = mesh_of(box((10, 0, -19.9), (20, 10, 10)))
    clearance, shared = turning_check(meshes, turning), together_check(meshes, turning)
    assert clearance.severity == "error" and clearance.subject == "lidar_body and base_mount"
    assert clearance.value == pytest.approx(0.1, abs=1e-3)
    assert shared.severity == "ok"


def test_a_thin_wall_is_measured_and_a_wedge_is_none():
    slab = box((0, 0, 0), (40, 40, 10))
    fin = slab.fuse(box((0, 0, 9), (0.8, 40, 30))).Solids()[0]
    walls = thin_walls(mesh_of(fin), 1.2)
    area = trimesh.Trimesh(*[getattr(mesh_of(fin), k) for k in ("vertices", "faces")]).area
    assert walls.surface_mm2 == pytest.approx(area)
    assert walls.area_mm2 == pytest.approx(2 * 40 * 20, rel=0.05)
    assert walls.thinnest_mm == pytest.approx(0.8) and walls.at == pytest.approx([0.4, 20, 20], abs=1.0)
    assert walls.at[0] == pytest.approx(0.4)
    assert thin_walls(mesh_of(fin), 0.7).area_mm2 == 0
    assert thin_walls(mesh_of(slab), 1.2).area_mm2 == 0
    wedge = slab.cut(box((0, 0, 0), (80, 80, 80)).rotate((0, 0, 0), (0, 1, 0), 30)).Solids()[0]
    assert thin_walls(mesh_of(wedge), 1.2).area_mm2 == 0


def printed(printer, part):
    mesh = mesh_of(part)
    return list(part_checks("part", part, mesh, print_pose(mesh, printer.bed_mm), printer))


def test_the_thinnest_spot_and_the_hole_beside_it_are_told():
    printer = load_catalogue().products["fdm-0.4"]
    drilled = box((0, 0, 0), (40, 30, 20)).cut(upright(5.0, -1, 21, 5.6, 12), upright(2.0, -1, 21, 30, 15)).Solids()[0]
    (wall,) = [c for c in printed(printer, drilled) if c.code == "wall"]
    thickness, *place = map(
        float, re.search(r"([\d.]+) mm, at \(([-\d.]+), ([-\d.]+), ([-\d.]+)\)", wall.message).groups()
    )
    assert wall.message.endswith("near a hole of 10 mm")
    assert thickness == pytest.approx(0.6, abs=0.02) and place[:2] == pytest.approx([0.3, 12.0], abs=0.4)


def test_printing_tells_bed_wall_and_hole():
    printer = load_catalogue().products["fdm-0.4"]
    part = box((0, 0, 0), (300, 30, 20)).cut(upright(0.5, -1, 21, 20, 15)).fuse(box((0, 0, 19), (0.5, 30, 60)))
    part = part.Solids()[0]
    checks = {c.code: c for c in printed(printer, part)}
    assert (checks["bed"].severity, checks["bed"].value) == ("error", 300)  # nor does it fit aslant
    assert checks["wall"].severity == "error" and checks["wall"].value > 2000
    assert (checks["smallest_hole"].severity, checks["smallest_hole"].value) == ("error", 1.0)
    assert all(check.subject == "part" for check in checks.values())


def test_a_layer_that_starts_in_the_air_is_found_where_it_starts():
    table = box((0, 0, 0), (6, 20, 30)).fuse(box((0, 0, 30), (40, 20, 34)), box((0, 0, 0), (40, 20, 4)))
    assert islands_of(mesh_of(table.Solids()[0])) == []  # a ledge hangs on its layer
    gallows = table.fuse(box((34, 5, 12), (40, 15, 30))).Solids()[0]
    (island,) = islands_of(mesh_of(gallows))
    assert island.height == pytest.approx(12, abs=0.4) and island.area_mm2 == pytest.approx(60, rel=1e-3)
    lying = gallows.rotate((0, 0, 0), (1, 0, 0), 90).moved(location(np.eye(3), (100, 0, 0)))  # stands on its y
    pose = print_pose(mesh_of(lying), (220.0, 220.0, 250.0))
    pose = replace(pose, T_bed_part=np.array([[1, 0, 0, -100], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]]))
    said = islands_check("part", mesh_of(lying), pose).message
    assert re.search(r"1 layer starts .* at \(137, -1[12](\.\d)?, 10\) in the rotation frame, the largest 60 mm2", said)
    two = gallows.fuse(box((20, 5, 20.3), (24, 15, 30))).Solids()[0]
    assert sorted(round(i.area_mm2) for i in islands_of(mesh_of(two))) == [40, 60]


def bodies(mass, z):
    inertia = mass * 0.03**2 * np.eye(3)
    return {
        "rot": Inertial(mass, np.array([0.012, 0.0, z]), inertia),
        "laser": Inertial(1e-9, np.zeros(3), inertia * 0),
    }


def test_loads_against_hand_calculation():
    scanner = scanner_for(0, 90, 30, -30)
    alone = replace(scanner, bearings=(), slip_ring=None)
    stack = drive_of(alone).stack
    lever = -stack.horn / 1000 - 0.030
    found = {c.code: c for c in load_checks(placement_of(alone), bodies(2.0, -0.030))}
    weight = 2.0 * 9.80665
    assert found["tilt_moment"].value == pytest.approx(weight * lever, rel=1e-3)
    assert found["tilt_moment"].severity == "error"
    rubs = 0.005  # of cables, or of a ring whose friction is not stated
    assert found["static_torque"].value == pytest.approx(weight * 0.012 + rubs, rel=1e-3)
    about_axis = 2.0 * (0.03**2 + 0.012**2)
    assert found["spin_up_torque"].value == pytest.approx(
        weight * 0.012 + rubs + about_axis * 2 * np.pi / 0.2, rel=1e-3
    )
    assert found["axial_load"].value == pytest.approx(0, abs=1e-6)
    weight = 0.5 * 9.80665
    held = {c.code: c for c in load_checks(placement_of(scanner), bodies(0.5, -0.030))}
    assert held["tilt_moment"].severity == "ok" and held["bearing_load"].value > weight
    assert held["static_torque"].value == pytest.approx(weight * 0.012 + rubs, rel=1e-3)
    upright = scanner_for(0, 0, 30, -30)
    heavy = {c.code: c.severity for c in load_checks(placement_of(upright), bodies(3.0, -0.030))}
    assert heavy["axial_load"] == "error"


def test_a_counterweight_is_worked_out_where_gravity_swings_the_gears():
    scanner = scanner_for(0, 90, 30, -30)
    found = {c.code: c for c in load_checks(placement_of(scanner), bodies(0.5, -0.030))}["flanks"]
    assert (found.severity, found.value) == ("warning", pytest.approx(0.5 * 9.80665 * 0.012, rel=1e-3))
    grams, at, azimuth = (
        float(n) for n in re.search(r"(\d+) g at (\d+) mm from the axis, (\d+) deg", found.hint).groups()
    )
    assert grams * at == pytest.approx(500 * 12, rel=0.01) and azimuth == 180  # the imbalance is at +x
    upright = scanner_for(0, 0, 30, -30)
    found = {c.code: c for c in load_checks(placement_of(upright), bodies(0.5, -0.030))}["flanks"]
    assert found.severity == "ok"
    exact = replace(scanner, servo=scanner.servo.model_copy(update={"backlash_deg": 0.01}))
    found = {c.code: c for c in load_checks(placement_of(exact), bodies(0.5, -0.03))}["flanks"]
    assert found.severity == "note"


def test_the_friction_of_a_ring_counts_in_every_torque_and_its_least_holds_a_flank():
    free, rubbing = scanner_for(0, 90, 30, -30), scanner_for(0, 90, 30, -30, friction_nm=(0.16, 0.2))
    loads = [{c.code: c for c in load_checks(placement_of(each), bodies(0.5, -0.030))} for each in (free, rubbing)]
    for kind in ("static_torque", "spin_up_torque"):
        assert loads[1][kind].value - loads[0][kind].value == pytest.approx(0.2 - 0.005, rel=1e-3)
    assert (loads[1]["flanks"].severity, loads[1]["flanks"].limit) == ("ok", 0.16)


def test_a_ring_that_is_not_rated_for_the_data_is_a_warning():
    ring_data = [c for c in wiring_checks(scanner_for(0, 0, 0, 0, lidar="UST-10LX")) if c.code == "ring_data"]
    assert [c.severity for c in ring_data] == ["warning"] and "Ethernet" in ring_data[0].message
    assert not [c for c in wiring_checks(scanner_for(0, 0, 0, 0)) if c.code == "ring_data"]  # USB


def test_what_nobody_tells_of_a_lidars_weight_is_told_with_every_torque(monkeypatch):
    scanner = scanner_for(0, 90, 30, -30)
    turned = scanner.angles.T_rot_laser()
    inertia = 1e-6 * np.eye(3)
    lidar = Inertial(0.4, np.linalg.inv(turned)[:3, 3], inertia)  # on the axis

    def found(x_m):
        given = {"rot": Inertial(0.1, np.array([x_m, 0.0, -0.03]), inertia), "laser": lidar}
        return {c.code: c for c in load_checks(placement_of(scanner), given)}

    # 0.4 kg that may be 2 mm off, across a level axis; of 0.5 kg that turn it is 1.6 mm
    static = found(0.001)["static_torque"]
    assert static.severity == "ok" and f"{0.1 * 9.80665 * 0.001 + 0.005:.3g} ± 0.008 N m" in static.message
    assert found(0.001)["centre_of_mass"].message.endswith("0.2 ± 2 mm")
    flanks = found(0.001)["flanks"]
    assert (flanks.severity, flanks.limit) == ("warning", 0.005)
    assert "the centre of mass of UTM-30LX is undocumented" in flanks.message
    assert "back and forth" in found(0.006)["flanks"].message
    monkeypatch.setattr(mechanics, "LIDAR_CENTRE_ERROR_MM", 0.5)
    assert found(0.001)["flanks"].severity == "ok"


def test_a_sweep_keeps_a_flank_only_if_no_doubt_turns_it():
    scanner = scanner_for(0, 90, 30, -30)
    swept = replace(
        scanner, angles=scanner.angles.model_copy(update={"motion": Sweep(limits_deg=(-30, 30), period_s=4)})
    )
    down = -swept.angles.T_world_rot(0.0)[2, :2]
    moment = np.array([down[1], -down[0]])  # turned most at the middle of the sweep, half of that at 60 deg
    assert keeps_flank(swept, moment, 0.86)  # cos 30 deg
    assert not keeps_flank(swept, moment, 0.87)


def test_a_limit_within_the_doubt_of_a_value_warns():
    found = at_most("k", 1.0, 1.5, "mm", "w", "what", 0.6)
    assert (found.severity, found.message) == ("warning", "w: what: 1 ± 0.6 mm (at most 1.5)")
    assert at_most("k", 1.0, 1.5, "mm", "w", "what", 0.5).severity == "ok"
    assert at_most("k", 1.6, 1.5, "mm", "w", "what", 0.5).severity == "error"


def test_large_numbers_are_written_in_full():
    assert at_most("k", 9.79, 2854.0, "N", "w", "load").message == "w: load: 9.79 N (at most 2,850)"
    assert at_most("k", 87_040.0, 4e5, "mm3", "w", "support", 3e-3).message == (
        "w: support: 87,000 ± 0.003 mm3 (at most 400,000)"
    )
    assert at_least("k", 999.7, 1234.5, "mm", "w", "what").message == "w: what: 1,000 mm (at least 1,230)"
    assert at_least("k", 1e-5, 0.5, "mm", "w", "what").message == "w: what: 1e-05 mm (at least 0.5)"


def test_a_servo_without_a_rating_is_noted_not_passed():
    scanner = scanner_for(0, 60, 30, -30, "URG-04LX", "AX-12A")
    found = {c.code: c for c in load_checks(placement_of(scanner), bodies(0.3, -0.03))}
    for kind in ("tilt_moment", "axial_load"):
        assert (found[kind].severity, found[kind].limit) == ("note", None)
        assert "unrated by its maker" in found[kind].message


def test_at_a_limit_is_within_it():
    assert at_most("k", 2.0, 2.0, "mm", "w", "what").severity == "ok"
    assert at_least("k", 2.0, 2.0, "mm", "w", "what").severity == "ok"
    worse = at_most("k", 2.001, 2.0, "mm", "w", "what")
    assert worse.severity == "error" and worse.message == "w: what: 2 mm (at most 2)"
    table = json.loads(checks_text([worse]))
    assert table["checks"][0] | {"message": ""} == {
        "kind": "k", "severity": "error", "value": 2.001, "limit": 2.0, "unit": "mm", "where": "w", "message": "",
    }  # fmt: skip


def test_checks_are_read_back_and_the_failed_ones_told_by_their_severity(tmp_path):
    checks = [at_most("k", 1.0, 2.0, "mm", "w", "error"), at_most("k", 3.0, 2.0, "mm", "w", "what")]
    (tmp_path / "checks.json").write_text(checks_text(checks))
    assert read_checks(tmp_path / "checks.json") == tuple(checks)
    assert errors_in(checks) == (checks[1],)
    assert failure_lines(checks) == [
        "check failed: w: what: 3 mm (at most 2)",
        "1 of 2 checks failed: do not make these parts",
    ]
    assert failure_lines(checks[:1]) == []


@pytest.mark.parametrize("content", [None, "{", "[]", '{"checks": [{"severity": "error"}]}', '{"checks": 1}'])
def test_a_file_that_no_build_wrote_is_an_error(content, tmp_path):
    if content is not None:
        (tmp_path / "checks.json").write_text(content)
    with pytest.raises(BuildError, match=r"checks\.json: not as a build writes it"):
        read_checks(tmp_path / "checks.json")


TASK = """name = "small"
sensor = "URG-04LX"
servo = "MX-64R"
slip_ring = "SNU11-P0210"
printer = "fdm-0.4"
[motion]
mode = "spin"
period_s = 18.0
[angles]
alpha_rot_deg = 0
beta_rot_deg = 0
alpha_laser_deg = 25.5
beta_laser_deg = -21.4
[density]
ball_radius_deg = 2.0
[[weight]]
shape = "all"
"""


def test_check_is_a_command_that_answers_with_its_exit_code(command, tmp_path, monkeypatch):
    (tmp_path / "task.toml").write_text(TASK)
    scanner = scanner_for(0, 0, 25.5, -21.4, "URG-04LX")
    (tmp_path / "angles.json").write_text(scanner.angles.to_json())
    code, out, _ = command("check", tmp_path, "-v")
    assert code == 0, out
    lines = out.splitlines()
    found = Counter(line.split()[0] for line in lines[1:])
    assert found["ok"] > 20 and found["note"] > 5  # the report counts them apart as well
    warned = f"{found['warning']} warning{'' if found['warning'] == 1 else 's'}"
    assert lines[0] == f"0 errors, {warned}, {found['note']} notes, {found['ok']} passed"
    assert any("sub_plate" in line for line in lines)
    assert sum(" mm at 10 m)" in line and "bend" in line and "±" in line for line in lines) == 2

    answer = [at_least("clearance", 0.1, 0.4, "mm", "a and b", "gap")]
    monkeypatch.setattr(run, "check_scanner", lambda _scanner, _say: answer)
    code, out, complaints = command("check", tmp_path, "--json")
    assert code == 1
    assert complaints[:2] == [
        "error: check failed: a and b: gap: 0.1 mm (at least 0.4)",
        "error: 1 of 1 checks failed: do not make these parts",
    ]
    failed = [entry for entry in json.loads(out)["checks"] if entry["severity"] == "error"]
    assert [entry["where"] for entry in failed] == ["a and b"]
    code, _, complaint = command("check", tmp_path / "nowhere")
    assert (code, len(complaint)) == (2, 1)


def test_nuts_of_a_fixed_part_that_meet_one_that_turns_are_an_error(monkeypatch):
    scanner = scanner_at(UPRIGHT, slip_ring=CAPSULE, servo="XM430-W350", sensor="URG-04LX")

    made = ("slip_ring_adapter", "shaft_ring")

    def least():
        return clearance_checks(make_parts(scanner, lambda spec: spec.name in made))[0]

    assert least().severity == "ok"
    monkeypatch.setattr(BeltStack, "capsule_gap", 1.5)  # the flange's nuts then reach into the ring above them
    found = least()
    assert found.severity == "error" and found.value == 0.0
    assert "screws of slip_ring_adapter in ring_stator" in found.message
