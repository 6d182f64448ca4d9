"""The belt layout of a capsule ring: its parts read from their meshes, its forces from equations of their own."""

import re
from dataclasses import replace
from types import SimpleNamespace

import manifold3d
import numpy as np
import pytest
import shapely
import trimesh
from cadquery import Vector
from scanners import CAPSULE, digest_of, mount_offset_mm, scanner_at

from scanwright.cad.assembly.make import make_parts
from scanwright.cad.assembly.scenes import scenes_of
from scanwright.cad.checks.printing import thin_walls
from scanwright.cad.checks.products import without_traps
from scanwright.cad.checks.run import run_checks
from scanwright.cad.drawings.files import drawing_of
from scanwright.cad.drawings.write import Words, drawn_on
from scanwright.cad.files.bom import items_of
from scanwright.cad.files.manual.instructions import instructions_text
from scanwright.cad.files.urdf import urdf_text
from scanwright.cad.geometry.holes import rounds_of
from scanwright.cad.geometry.mesh import mesh_of, of_manifold
from scanwright.cad.layout.belt.loads import belt_nm_per_rad, belt_pull, belt_shaft_bend, carrier_forces, press_newton
from scanwright.cad.layout.belt.sizing import QUARTERS
from scanwright.cad.layout.belt.stack import TRAVEL, BeltStack, drive_corners, tower_foot_of
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.loads import Weight
from scanwright.cad.layout.names import ROTOR_LEAD
from scanwright.cad.layout.placement import drive_of
from scanwright.cad.outlines import polygon
from scanwright.cad.parts.all_parts import laid_out, parts_of
from scanwright.cad.parts.mounts.bearing_tower import bearing_tower
from scanwright.cad.solids import prism, upright
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.holes import Hole
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import BuildError


def scanner_for(alpha_rot=0, beta_rot=90, alpha=0, beta=-90, ring=CAPSULE):
    return scanner_at((alpha_rot, beta_rot, alpha, beta), slip_ring=ring)


def with_ring(**changes):
    scanner = scanner_for()
    return replace(scanner, slip_ring=SlipRing.model_validate(scanner.slip_ring.model_dump() | changes))


@pytest.fixture(scope="module")
def made(parts_of):
    scanner = scanner_for()
    assembly = parts_of(scanner)
    meshes = {n: trimesh.Trimesh(m.vertices, m.faces, process=False) for n, m in assembly.meshes().items()}
    checks, shadow = run_checks(assembly, lambda _: None)
    found = {(check.code, check.subject): check for check in checks}
    return SimpleNamespace(
        scanner=scanner, assembly=assembly, stack=assembly.layout.stack, meshes=meshes, checks=found, shadow=shadow
    )


def body(mesh, moved=(0.0, 0.0, 0.0), turn_deg=0.0):
    R = trimesh.transformations.rotation_matrix(np.radians(turn_deg), [0, 0, 1])[:3, :3]
    points = mesh.vertices @ R.T + moved
    return manifold3d.Manifold(manifold3d.Mesh(points.astype(np.float32), mesh.faces.astype(np.uint32)))


def section(mesh, z):
    """Polygons of a horizontal section."""
    flat, _ = mesh.section(plane_origin=[0, 0, z], plane_normal=[0, 0, 1]).to_2D(to_2D=shift(z))
    return shapely.union_all(flat.polygons_full)


def shift(z):
    T = np.eye(4)
    T[2, 3] = -z
    return T


def circle(points):
    """Centre and diameter of the circle through points, by least squares."""
    A = np.column_stack([2 * points, np.ones(len(points))])
    centre = np.linalg.lstsq(A, (points**2).sum(axis=1), rcond=None)[0][:2]
    return centre, 2 * np.linalg.norm(points - centre, axis=1).mean()


def inner_circle(mesh, z, diameter):
    rings = [hole for part in shapely.get_parts(section(mesh, z)) for hole in part.interiors]
    ring = min(rings, key=lambda ring: abs(ring.length / np.pi - diameter))
    return circle(np.asarray(ring.coords)[:-1])


def test_a_capsule_gets_the_belt_and_a_bore_the_shaft():
    assert isinstance(drive_of(scanner_for()).stack, BeltStack)
    assert isinstance(drive_of(scanner_for(ring="SNU11-P0210")).stack, DirectStack)
    assert isinstance(drive_of(replace(scanner_for(), slip_ring=None)).stack, DirectStack)


def test_what_it_is_made_of(made):
    assert list(made.assembly.made) == [
        "main_shaft",
        "shaft_pulley",
        "shaft_ring",
        "bearing_tower",
        "slip_ring_adapter",
        "drive_plate",
        "drive_pulley",
        "alignment_linkage",
        "base_mount",
        "counterweight",
    ]
    assert all(mesh.is_watertight and mesh.body_count == 1 for mesh in made.meshes.values())
    stack = made.stack
    assert (stack.carrier.name, stack.tube_diameter, stack.shaft_bore, stack.shaft_diameter) == (
        "61805-2RS",
        25,
        12.8,
        12,
    )
    assert stack.upper_middle - stack.lower_middle >= 30
    assert (stack.tube_diameter - stack.shaft_bore) / 2 >= 4
    # the spigot is keyed and crossed as in direct drive, where the bore of the ring sets its diameter
    direct = drive_of(scanner_for(ring="SNU11-P0210")).stack
    assert stack.cross - stack.shoulder == direct.cross - direct.shoulder
    assert stack.shaft_diameter / 2 - stack.flat == direct.shaft_diameter / 2 - direct.flat


def test_bores_and_seats_are_coaxial_with_the_axis_and_fit(made):
    stack, fit = made.stack, made.scanner.printer.fit_clearance_mm
    bearing = stack.carrier
    wanted = [
        ("bearing_tower", stack.upper_middle, bearing.outer_mm + fit / 2),
        ("bearing_tower", stack.lower_middle, bearing.outer_mm + fit / 2),
        ("bearing_tower", (stack.upper_middle + stack.lower_middle) / 2, bearing.outer_mm - 3),
        ("bearing_tower", stack.disc_top + 1, 47.0),
        ("main_shaft", stack.upper_middle, 12.8),
        ("shaft_pulley", stack.belt_middle, bearing.bore_mm + fit / 2),
        ("shaft_ring", stack.collar_low + 2, bearing.bore_mm + fit),
        ("slip_ring_adapter", stack.disc_top - 1, 23.0),
    ]
    for name, z, diameter in wanted:
        centre, found = inner_circle(made.meshes[name], z, diameter)
        assert np.linalg.norm(centre) < 0.01, (name, z)
        assert found == pytest.approx(diameter, abs=0.03), (name, z)
    for middle in (stack.upper_middle, stack.lower_middle):
        outline = section(made.meshes["main_shaft"], middle).exterior
        centre, found = circle(np.asarray(outline.coords)[:-1])
        assert np.linalg.norm(centre) < 0.01 and 24.95 < found < 24.98  # f7


def test_both_pulleys_have_the_teeth_of_the_belt_and_the_belt_its_length(made):
    stack = made.stack
    horn = stack.turn() @ [stack.centre, 0, 0]
    for name, axis in (("shaft_pulley", np.zeros(2)), ("drive_pulley", horn[:2])):
        outline = np.asarray(section(made.meshes[name], stack.belt_middle).exterior.coords) - axis
        radius = np.linalg.norm(outline, axis=1)
        outside = radius > radius.mean()
        rising = outline[1:][outside[1:] & ~outside[:-1]]
        steps = np.diff(np.unwrap(np.arctan2(rising[:, 1], rising[:, 0])))
        assert len(rising) == 80 and np.degrees(np.abs(steps)) == pytest.approx(4.5, abs=0.05)
        assert 2 * np.pi * (radius.max() + 0.254) / 80 == pytest.approx(2.0, abs=1e-3)  # pitch of 2GT
        assert radius.max() - radius.min() == pytest.approx(0.75, abs=0.02)
        assert np.linalg.norm((outline.max(axis=0) + outline.min(axis=0)) / 2) < 0.01
    # the cords lie around two circles of 80 teeth's pitch: the perimeter of their hull
    pitch = 80 * 2 / (2 * np.pi)
    circles = [shapely.Point(x, 0).buffer(pitch, quad_segs=2000) for x in (0, stack.centre)]
    assert shapely.union_all(circles).convex_hull.length == pytest.approx(2 * stack.belt_teeth, abs=1e-3)
    assert stack.belt_teeth in stack.belt.teeth


def test_nothing_shares_room_in_any_position(made):
    bodies = {name: body(mesh) for name, mesh in made.meshes.items()}
    names = sorted(bodies)
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            if (made.meshes[one].bounds[0] < made.meshes[other].bounds[1]).all() and (
                made.meshes[other].bounds[0] < made.meshes[one].bounds[1]
            ).all():
                assert (bodies[one] ^ bodies[other]).volume() < 0.05, (one, other)
    turning = made.assembly.turning()
    still = manifold3d.Manifold.batch_boolean([bodies[n] for n in names if n not in turning], manifold3d.OpType.Add)
    for turn in (11.0, 100.0, 200.0):
        for name in names:
            if name in turning and name != "lidar_window":
                assert (still ^ body(made.meshes[name], turn_deg=turn)).volume() < 0.05, (name, turn)
    # the pulley on the horn turns about the horn: what it sweeps meets nothing but the horn
    swept = made.assembly.outlines()["drive_pulley"]
    swept = body(trimesh.Trimesh(swept.vertices, swept.faces, process=False))
    assert (bodies["drive_pulley"] - swept).volume() < 3  # of 20 000: the chords of its rims
    for name in ("drive_plate", "bearing_tower", "servo_case", "belt", "shaft_pulley"):
        assert (swept ^ bodies[name]).volume() < 0.05, name


def test_the_servo_slides_far_enough_to_put_the_belt_on_and_to_tighten_it(made):
    along = made.stack.turn() @ [1.0, 0.0, 0.0]
    still = [body(made.meshes[name]) for name in ("bearing_tower", "shaft_pulley", "main_shaft", "bearing_inner_upper")]
    assert TRAVEL >= 3
    for shift in (-TRAVEL, TRAVEL):
        for name in ("drive_plate", "servo_case", "drive_pulley"):
            moved = body(made.meshes[name], shift * along)
            assert all((moved ^ other).volume() < 0.05 for other in still), (name, shift)


def test_index_grooves_of_hub_and_tower_lie_at_plus_y_whatever_the_servos_side(made):
    stack = made.stack
    outlines = [
        section(made.meshes["alignment_linkage"], stack.shoulder + 1.0),
        section(made.meshes["bearing_tower"], stack.tower_top - 1.0),
    ]
    for quarter in set(QUARTERS) - {stack.quarter}:
        printer, turned = made.scanner.printer, replace(stack, quarter=quarter)
        mesh = mesh_of(bearing_tower(turned, printer, tower_foot_of(printer, turned)))
        outlines.append(section(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False), stack.tower_top - 1.0))
    assert len(outlines) == 4
    for outline in outlines:
        edge = np.asarray(outline.exterior.coords)
        edge = edge[(np.abs(edge[:, 0]) < 3.0) & (edge[:, 1] > 0)]
        deepest = edge[np.argmin(edge[:, 1])]
        assert abs(deepest[0]) < 0.02  # the V's point lies at +y
        assert edge[:, 1].max() - deepest[1] > 0.8


@pytest.mark.parametrize("axis", [(0, 0), (0, 90), (0, -90), (90, 0), (-90, 0), (180, 0), (45, 30), (110, 20)])
def test_the_servo_turns_the_same_way_and_clears_the_deck(axis):
    scanner = scanner_for(*axis, alpha=30, beta=-30)
    stack = drive_of(scanner).stack
    turn = stack.turn()
    np.testing.assert_array_equal(turn @ [0, 0, 1], [0, 0, 1])  # its horn looks where the shaft looks
    assert np.linalg.det(turn) == pytest.approx(1)
    T = scanner.angles.T_world_rot(0.0)
    offset = np.array(mount_offset_mm(scanner))
    heights = (drive_corners(stack) @ T[:3, :3].T + offset)[:, 2]
    assert (heights > 6).all() or (heights < -6).all()


def test_leads_pass_from_the_capsule_to_below_the_hub(made):
    stack = made.stack
    shaft = made.meshes["main_shaft"]
    up = shaft.ray.intersects_location([[0, 0, stack.ring_top + 1]], [[0, 0, 1.0]])[0][:, 2]
    window = up.min() - 4.0
    assert stack.pulley_top < window < stack.shoulder
    for direction in ([1.0, 0, 0], [-1.0, 0, 0]):
        for mesh in (mesh for name, mesh in made.meshes.items() if not name.startswith(ROTOR_LEAD)):
            assert not len(mesh.ray.intersects_location([[0, 0, window]], [direction])[0])


def test_checks_tell_what_bearings_belt_and_horn_bear_and_what_the_belt_costs(made):
    for key in (("bearing_load", "bearing"), ("belt_tension", "belt"), ("tilt_moment", "servo")):
        assert made.checks[key].severity == "ok"
    pulls = made.checks["tilt_moment", "servo"]
    lever = made.stack.belt_middle - made.stack.horn
    assert pulls.value == pytest.approx(20 * lever / 1000, rel=1e-3)  # N m: two strands of 10 N
    off = made.checks["belt_angle", "belt"]
    assert off.severity == "warning" and off.value > np.degrees(0.1 / made.stack.pitch_radius)
    assert not [check.message for check in made.checks.values() if check.severity == "error"]
    # the servo stands within the blind cone of this fan but for its edge
    assert made.shadow.hidden().sum() * 0.25 < 1.0


def test_bearings_balance_the_rotor_and_the_belt(made):
    stack = made.stack
    weight, centre, pull = Weight(7.0, 0.0, 0.1, 0.0), -20.0, 20.0
    upper, lower = carrier_forces(stack, weight, centre, pull)
    # sum of forces and moments about the origin: up is +, the lower bearing pulls the other way
    z = np.array([stack.upper_middle, stack.lower_middle])
    R = np.linalg.solve(np.array([[1, 1], z]), [7.0 + pull, 7.0 * centre + pull * stack.belt_middle])
    assert (upper, -lower) == pytest.approx(tuple(R))
    heavy = belt_pull(stack, 2.0)
    assert heavy.working_n == pytest.approx(2.0 / (160 / (2 * np.pi) / 1000))
    assert heavy.strand_n > heavy.working_n / 2  # the slack strand stays tight


def test_the_shaft_bends_as_unit_loads_say(made):
    """Displacement of one load in the direction of another is the integral of their bending moments over EI."""
    stack = made.stack
    EI = 70e9 * np.pi / 64 * (0.025**4 - 0.0128**4)
    span = (stack.upper_middle - stack.lower_middle) / 1000
    over = (stack.shoulder - stack.upper_middle) / 1000
    x = (np.arange(20000) + 0.5) / 20000 * (span + over)
    dx = (span + over) / 20000
    beyond = span + over - x
    force = np.where(x > span, beyond, over * x / span)
    moment = np.where(x > span, 1.0, x / span)
    expected = np.array([[force @ force, force @ moment], [moment @ force, moment @ moment]]) * dx / EI
    np.testing.assert_allclose(belt_shaft_bend(stack).compliance, expected, rtol=1e-3)


def test_the_belt_holds_as_two_springs(made):
    stack = made.stack
    turned = 1e-4  # rad: each strand of 60 mm gets longer or shorter by r times it
    strain = turned * stack.pitch_radius / stack.centre
    torque = 2 * stack.belt.stiffness_n * strain * stack.pitch_radius / 1000
    assert belt_nm_per_rad(stack) == pytest.approx(torque / turned)
    # pressed in the middle by 2 mm: both halves pull back by their slope
    assert press_newton(stack, 10.0, 2.0) == pytest.approx(2 * 10.0 * 2.0 / (stack.centre / 2))


def test_every_screw_has_a_step_and_every_bought_thing_a_row(made):
    assembly = made.assembly
    joints = assembly.layout.joints
    found = {(joint.part, joint.onto): (joint.screw.name, joint.count, joint.fixing) for joint in joints}
    assert found == {
        ("shaft_pulley", "main_shaft"): ("M3", 2, "grub"),
        ("shaft_ring", "main_shaft"): ("M3", 2, "thread"),
        ("bearing_tower", "slip_ring_adapter"): ("M3", 3, "thread"),
        ("slip_ring_adapter", "ring_stator"): ("M5", 3, "nut"),
        ("drive_plate", "servo_case"): ("M2.5", 4, "nut"),
        ("drive_plate", "bearing_tower"): ("M4", 4, "thread"),
        ("drive_pulley", "servo_output"): ("M2.5", 8, "thread"),
        ("alignment_linkage", "lidar_body"): ("M3", 4, "thread"),
        ("alignment_linkage", "counterweight"): ("M4", 2, "thread"),
        ("alignment_linkage", "main_shaft"): ("M3", 2, "thread"),
        ("base_mount", "bearing_tower"): ("M3", 4, "trap"),
        ("base_mount", "deck"): ("M4", 4, "deck"),
    }
    text = instructions_text(assembly, scenes_of(assembly), [])
    titles = re.findall(r"^## \d+\. (.*)$", text, re.M)
    assert len(titles) == 15 and not [title for title in titles if " to " in title]  # no joint was left over
    assert "{" not in text and len(re.findall(r"\*\*\d+ x ISO", text)) == len(joints)
    assert (
        "280 mm" in text
        and "2048 of 4096" in text
        and "servo-setup PORT --centre" in text
        and "index groove of the hub is over that in the edge" in text
    )
    masses = dict.fromkeys(assembly.made, 1.0)
    rows = {item.part: item for item in items_of(assembly, masses)}
    assert (rows["bearing"].quantity, rows["bearing"].total_usd) == (2, 16.0)
    assert rows["belt"].supplier_number == "GT2-6, 140 teeth, 280 mm"
    assert rows["counterweight"].kind == "sawn" and "2 threads M4" in rows["counterweight"].note
    assert rows["main_shaft"].kind == "turned" and "main_shaft.step" in rows["main_shaft"].note
    (tube,) = (row for part, row in rows.items() if "soft tube" in part)
    assert tube.part.startswith("soft tube, 7 mm inside, 12 mm outside, ") and "a stub of 7.8 mm" in tube.note
    assert "adhesive tape" in rows and "a turn of tape" in text
    assert "with 3 nuts M5, loose.**" in text and f"{tube.part.split(', ')[-1].split()[0]} mm of soft tube" in text
    torques = [float(torque) for torque in re.findall(r", ([\d.]+) N m", text)]
    assert f"torque screwdriver, {min(torques):.2g} to {max(torques):.2g} N m" in rows
    (tie,) = [row for part, row in rows.items() if "cable tie" in part]  # the capsule needs none
    assert (tie.quantity, tie.note.split(";")[0]) == (
        4,
        "1 at the shaft, 2 at the coil, 1 at the foot of the mount",
    )
    assert "Close a cable tie around shaft and bundles" in text and "behind the plate" not in text
    assert len(set(re.findall(r"by the shaft's window at (\d+) deg", text))) == 2
    assert (
        "one of its windows" not in text
        and 'through the one that the step "Leads between lidar and ring" names' in text
    )


def test_the_drawing_of_the_shaft_asks_for_the_fit_of_its_bearings(made):
    sheet = drawing_of("main_shaft", made.assembly, 80.0)
    said = [item.text for item in drawn_on(sheet) if isinstance(item, Words)]
    # ISO 286: f7 of 25 mm is -20 to -41 um; the hub's bore is a print, the collar meets nothing
    threads = [text for text in said if text.startswith("Ø2.5 THRU, TAPPED M3, RADIAL")]
    assert len(threads) == 4 and any("M3 through the spigot" in text for text in said)
    assert [text for text in said if text.startswith("Ø") and ":" not in text and text not in threads] == [
        "Ø24.96  +0.02/0",
        "Ø12.8 x 83.2 DEEP",
        "Ø27.9",
        "Ø24.96  +0.02/0",
        "Ø12  0/-0.1",
        "Ø8 THRU",
    ]
    assert {"Ø24.96 +0.02/0: f7 in the bearings, which slide on by hand, turned.", "1:1   A3"} <= set(said)


def test_what_a_print_must_keep_stands_on_its_sheet(made):
    """Of the pulleys: teeth and bore; of the tower: the seats. What is off the axis is measured from the horn's."""
    said = {}
    for name in ("drive_pulley", "bearing_tower"):
        sheet = drawing_of(name, made.assembly, 1.0)
        said[name] = [item.text for item in drawn_on(sheet) if isinstance(item, Words)]
    assert said["bearing_tower"].count("Ø37.1  ±0.1") == 2  # 37 to 37.2 mm around 61805
    seat = "Ø37.1 ±0.1: seat of 61805-2RS, from size for size to a sliding fit, as printed, sanded or reamed to it."
    assert seat in " ".join(said["bearing_tower"])
    assert "Ø10.1  0/-0.1 x 5 DEEP" in said["drive_pulley"] and "1:1   A3" in said["drive_pulley"]
    teeth = next(text for text in said["drive_pulley"] if text.startswith("80 teeth for GT2-6, pitch 2:"))
    pitch, tips = map(float, re.search(r"pitch diameter ([\d.]+), over the tips ([\d.]+)", teeth).groups())
    flat = section(made.meshes["drive_pulley"], made.stack.belt_middle)
    radii = np.linalg.norm(np.asarray(flat.exterior.coords) - made.stack.servo_origin()[:2], axis=1)
    assert pitch == pytest.approx(160 / np.pi, abs=0.005) and tips == pytest.approx(2 * radii.max(), abs=0.01)
    horn = made.stack.servo_origin()
    zero = next(text for text in said["drive_pulley"] if text.startswith("Their zero is"))
    assert list(map(float, re.findall(r"-?[\d.]+(?=,| in)", zero))) == pytest.approx(horn.tolist(), abs=0.01)


def test_the_frame_chain_names_the_servo_beside_the_axis(made):
    from scanwright.cad.assembly.assembly import link_bodies

    drive, bodies = made.assembly.layout.drive, link_bodies(made.assembly)
    servo, rot = bodies["servo"], bodies["rot"]
    text = urdf_text(made.scanner, drive, bodies, {"servo": [], "rot": []})
    horn = drive.stack.servo_origin()
    (case,) = [station.shape for station in drive.stations if station.name == "servo"]
    low, high = np.array(case)
    centre = (low + high) / 2
    assert sorted(high - low) == pytest.approx([40.2, 41.0, 61.1]) and f"{centre[0] / 1000:.6g}" in text
    assert np.linalg.norm(centre[:2] - horn[:2]) < 20
    side = servo.centre_m[:2] @ horn[:2] / np.linalg.norm(horn[:2])
    assert side > 0.005 and np.linalg.norm(rot.centre_m[:2]) < side  # what stands still leans to the servo
    assert digest_of(made.scanner) != digest_of(replace(made.scanner, belts=(_short(made),)))


def _short(made):
    return made.stack.belt.model_copy(update={"width_mm": 5.0})


REFUSED = {
    "wide flange": (
        {
            "flange": {
                "diameter_mm": 70.0,
                "thickness_mm": 3,
                "below_top_mm": 5,
                "circle_mm": 55,
                "holes": 3,
                "hole_mm": 5.4,
                "screw": "M5",
            }
        },
        r"bearing_tower: slip_ring SRC022A-6: flange.diameter_mm = 70: .*at most \d+\.\d",
    ),
    "thick rotor": (
        {"rotor": {"diameter_mm": 28.0, "length_mm": 8.0}, "outer_diameter_mm": 29.0},
        r"bearing_tower: .*rotor.diameter_mm = 28: .*bore_mm >= 41, the largest of the catalogue has 40",
    ),
}


@pytest.mark.parametrize("change", REFUSED)
def test_a_capsule_too_large_for_the_tower_is_refused(change):
    fields, words = REFUSED[change]
    with pytest.raises(BuildError, match=words):
        mount_offset_mm(with_ring(**fields))


def test_what_else_cannot_be_built_is_refused():
    scanner = scanner_for()
    with pytest.raises(BuildError, match=r"the catalogue has none; add a product of kind = 'belt'"):
        mount_offset_mm(replace(scanner, belts=()))
    short = scanner.belts[0].model_copy(update={"teeth": (100, 120)})
    with pytest.raises(BuildError, match=r"centre distance >= \d+\.\d mm: .*120 teeth and reaches 40.0"):
        mount_offset_mm(replace(scanner, belts=(short,)))
    with pytest.raises(BuildError, match=r"alignment_linkage: tilt = 120.00 deg"):
        mount_offset_mm(scanner_for(alpha=120, beta=0))
    wide = Servo.model_validate(scanner.servo.model_dump() | {"horn_circle_mm": 46.0})
    with pytest.raises(BuildError, match=r"drive_pulley: heads: horn_circle_mm = 46: .*teeth of a pulley of 80"):
        parts_of(laid_out(replace(scanner, servo=wide)))
    holes = ((9.0, 0.0), (-9.0, 0.0), (9.0, -3.0), (-9.0, -3.0))
    ears = tuple(Hole(at_mm=(x, y, -6.5), axis="+z", kind="through", size="M2.5", depth_mm=2.0) for x, y in holes)
    bare = scanner.servo.model_copy(update={"holes": ears})
    with pytest.raises(BuildError, match=r"drive_plate: ears: holes"):
        parts_of(laid_out(replace(scanner, servo=bare)))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"flange": None}, "bore_mm = 0 is a capsule: state its flange and rotor"),
        ({"length_mm": 2.0}, "below_top_mm 0 lies beyond length_mm"),
        ({"outer_diameter_mm": 30.0}, "circle_mm 35 puts its holes into outer_diameter_mm"),
        ({"outer_diameter_mm": 7.0}, "rotor.diameter_mm 7.8 is not below"),
    ],
)
def test_a_capsule_that_contradicts_itself_is_refused(change, words):
    with pytest.raises(ValueError, match=words):
        with_ring(**change)


def test_nuts_of_the_standard_go_into_the_tower_and_hold():
    """ISO 4032: M4 is 7.0 across and 3.2 high, M3 5.5 and 2.4; the play is the sliding fit of 0.2."""
    scanner = replace(scanner_for(), printer=load_catalogue().products["fdm-0.4-nut"])
    assembly = make_parts(scanner, lambda spec: spec.name in ("bearing_tower", "drive_plate", "base_mount"))
    tower, stack = assembly.made["bearing_tower"], assembly.layout.stack

    def nut(across, height, at, turn_deg):
        return prism(polygon(across / np.sqrt(3), 6, np.radians(turn_deg)), 0, height).translate(Vector(*at))

    def shared(one):
        return one.intersect(tower).Volume()

    rounds = {name: rounds_of(solid) for name, solid in assembly.made.items()}
    holes = {
        size: [r for r in rounds["bearing_tower"] if r.hole and abs(r.diameter - size) < 1e-6] for size in (4.2, 3.2)
    }
    plate = [np.array(hole.low) for hole in holes[4.2]]
    foot = [np.array(hole.high) for hole in holes[3.2] if abs(hole.low[2] - stack.tower_bottom) < 1e-6]
    assert (len(plate), len(foot)) == (4, 4)
    for at in plate:  # from below, pulled up
        assert at[2] == pytest.approx(stack.tower_top - 7.5)
        turn = np.degrees(stack.quarter * np.pi / 2)
        for down in (3.2, 8.0, 20.0):
            assert shared(nut(7.0, 3.2, at - [0, 0, down], turn)) < 1e-3
        assert shared(nut(7.0, 3.2, at - [0, 0, 3.2], turn + 30)) > 1.0  # it cannot turn
        assert shared(nut(7.0, 3.2, at - [0, 0, 2.7], turn)) > 5.0
    for at in foot:  # from outside along the diagonal, pulled down
        out = np.array([*np.sign(at[:2]), 0.0]) / np.sqrt(2)
        turn = np.degrees(np.arctan2(out[1], out[0]))
        for way in (0.0, 2.0, 8.0, 20.0):
            assert shared(nut(5.5, 2.4, at + way * out, turn)) < 1e-3
        assert shared(nut(5.5, 2.4, at, turn + 30)) > 0.5
        assert shared(nut(5.5, 2.4, at - [0, 0, 0.5], turn)) > 3.0
        assert shared(nut(5.5, 2.4, at - out, turn)) > 0.5  # it stands over its hole
        assert shared(upright(1.5, at[2], at[2] + 2.4 + 5.0, *at[:2])) < 1e-3  # room for the end of any screw
    joints = {(joint.part, joint.onto): joint for joint in assembly.layout.joints if joint.traps}
    lengths = {key: (joint.fixing, joint.number, joint.count) for key, joint in joints.items()}
    assert lengths[("drive_plate", "bearing_tower")] == ("trap", "ISO 4762 M4 x 16", 4)
    assert lengths[("base_mount", "bearing_tower")] == ("trap", "ISO 4762 M3 x 12", 4)
    assert "bearing_tower" not in {f.subject for f in without_traps(scanner.printer, list(joints.values()))}
    sheet = drawing_of("bearing_tower", assembly, 1.0)
    said = {item.text for item in drawn_on(sheet) if isinstance(item, Words)}
    assert {
        "Hexagons under the arms for nuts M4: 7.2 across flats.",
        "Slots in the foot for nuts M3: 5.7 wide, from its corners.",
    } <= said
    wide = replace(stack, flange=stack.flange.model_copy(update={"diameter_mm": 58.0}))
    printer = scanner.printer
    assert tower_foot_of(printer, wide).trap is None and tower_foot_of(printer, stack).trap is not None


def test_the_rails_of_the_mount_leave_the_least_wall_around_the_heads_of_their_screws(made):
    mount, deck = made.assembly.mesh("base_mount"), made.assembly.layout.deck
    rails = mount.manifold().trim_by_plane((0.0, 0.0, 1.0), deck.back_centre[2] - deck.back_mm)  # without the strut
    rails = rails.trim_by_plane((-1.0, 0.0, 0.0), -deck.back_half[0] - 0.1)  # and the foot
    assert thin_walls(of_manifold(rails), made.scanner.printer.min_wall_mm).area_mm2 == 0
