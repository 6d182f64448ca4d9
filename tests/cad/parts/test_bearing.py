"""The bearing of a tilted axis: when it is needed, how it shares the load, and how its cage fits together."""

import itertools
from dataclasses import replace

import cadquery as cq
import manifold3d
import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st
from quick_tests import samples
from scanners import GROUND_AHEAD, ROLLING, digest_of, scanner_at

from scanwright.cad.assembly.assembly import link_bodies, rotor_weight
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.checks.loads.mechanics import load_checks
from scanwright.cad.checks.loads.retention import worst_shares
from scanwright.cad.geometry.mesh import checked_mesh
from scanwright.cad.layout.direct.cage import BearingCage, stiffness_n_per_m
from scanwright.cad.layout.direct.loads import ALUMINIUM, STEEL, bearing_for, heaviest, supported
from scanwright.cad.layout.direct.misalignment import contributions, offsets_mm, worst_moment_nm
from scanwright.cad.layout.direct.sizing import direct_stack
from scanwright.cad.layout.envelope import envelope_of
from scanwright.cad.layout.hub import CROSS_M3
from scanwright.cad.layout.loads import Weight
from scanwright.cad.layout.names import ROTOR_LEAD
from scanwright.cad.layout.placement import drive_of
from scanwright.cad.layout.tightening import ALUMINIUM as METAL
from scanwright.cad.layout.tightening import BOUGHT, MOULDED, PRINTED, hold_of
from scanwright.cad.parts.all_parts import laid_out, parts_of
from scanwright.cad.parts.shafts.servo_shaft import on_horn
from scanwright.cad.screws import SCREWS
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.holes import Hole
from scanwright.design.catalogue.products import Bearing
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import BuildError

degrees = st.floats(-90, 90)


def scanner_for(alpha_rot, beta_rot, alpha, beta, lidar="UTM-30LX", servo="MX-64R"):
    return scanner_at((alpha_rot, beta_rot, alpha, beta), sensor=lidar, servo=servo)


def rated(scanner, newton):
    return replace(scanner, servo=Servo.model_validate(scanner.servo.model_dump() | {"radial_load_n": newton}))


ASKED_FOR = {"counterweight", "servo_frame", "tripod_foot"}  # by balance, a servo without rear holes, or a task


SCANNERS = {
    "ground_ahead": scanner_for(*GROUND_AHEAD),
    "no_ring": replace(scanner_for(0, 90, 30, -30), slip_ring=None),
    "small": rated(scanner_for(20, -50, 33, 12, "URG-04LX", "AX-12A"), 30.0),
}


@pytest.fixture(scope="module", params=samples(SCANNERS, ("ground_ahead", "no_ring")))
def made(request, parts_of):
    scanner = SCANNERS[request.param]
    assembly = parts_of(scanner)
    meshes = {}
    for name, solid in (assembly.made | assembly.bought).items():
        mesh = checked_mesh(solid, name)
        meshes[name] = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    return request.param, scanner, assembly, meshes


def body(meshes, turn=0.0):
    R = trimesh.transformations.rotation_matrix(np.radians(turn), [0, 0, 1])[:3, :3]
    bodies = [
        manifold3d.Manifold(manifold3d.Mesh((m.vertices @ R.T).astype(np.float32), m.faces.astype(np.uint32)))
        for m in meshes
    ]
    return manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add)


def test_the_horn_stays_within_its_rating(made):
    name, scanner, assembly, _ = made
    bodies = link_bodies(assembly)
    weight = rotor_weight(scanner, assembly.layout.stack, bodies)
    limit = scanner.servo.radial_load_n * 0.010
    assert weight.moment_nm > limit  # so it needs the bearing
    assert _tilt_moment(assembly.layout, link_bodies(assembly)).severity == "ok"
    left_out = [
        entry.what for entry in assembly.layout.left_out if entry.unit == "parts" and entry.what not in ASKED_FOR
    ]
    assert left_out == (["slip_ring_adapter"] if name == "no_ring" else [])
    assert "bearing_cage" in assembly.made
    assert ("cage_base" in assembly.made) == (name == "no_ring")


def test_nothing_in_the_cage_shares_room_and_the_journal_turns(made):
    _, _, assembly, meshes = made
    for one, other in itertools.combinations(meshes, 2):
        if {one, other} & {"bearing_cage", "bearing_inner", "bearing_outer", "cage_base", "slip_ring_adapter"}:
            assert (body([meshes[one]]) ^ body([meshes[other]])).volume() < 0.05, (one, other)
    rotor = [mesh for name, mesh in meshes.items() if name in assembly.turning()]
    stator = body([mesh for name, mesh in meshes.items() if name not in assembly.turning()])
    for turn in (17.0, 100.0, 230.0):
        assert (stator ^ body(rotor, turn)).volume() < 0.05


def test_seat_and_journal_take_the_bearing(made):
    _, scanner, assembly, meshes = made
    bearing, fit = assembly.layout.stack.bearing, scanner.printer.fit_clearance_mm
    low, high = meshes["bearing_outer"].bounds[:, 2]
    assert high - low == pytest.approx(bearing.width_mm, abs=1e-3)
    for name, diameter, sign in (("bearing_cage", bearing.outer_mm, 1), ("journal_sleeve", bearing.bore_mm, 0)):
        section = meshes[name].section(plane_origin=[0, 0, (low + high) / 2], plane_normal=[0, 0, 1])
        radius = np.linalg.norm(section.vertices[:, :2], axis=1)
        edge = radius[np.abs(radius - diameter / 2) < 0.5]
        assert len(edge) > 20
        wanted = diameter + fit / 2 if sign else diameter - 0.02  # g6
        np.testing.assert_allclose(2 * edge, wanted, atol=0.02 if sign else 0.012)
    # the lip holds the outer ring only; the hub stands clear of both, the sleeve slides in the inner one
    lip = meshes["bearing_cage"].section(plane_origin=[0, 0, low - 1.0], plane_normal=[0, 0, 1])
    assert bearing.bore_mm / 2 + 3 < np.linalg.norm(lip.vertices[:, :2], axis=1).min() < bearing.outer_mm / 2 - 1
    assert meshes["alignment_linkage"].bounds[0, 2] == pytest.approx(high + 0.5, abs=1e-3)
    sleeve = meshes["journal_sleeve"].bounds[:, 2]
    assert sleeve[0] < low - 0.5 and high < sleeve[1] < high + 0.5


def tie_around(stator, adapter):
    """Return a tight cable tie of 4.8 x 1.3 mm in the grooves of the adapter: where its arms are thinnest."""
    heights = np.arange(stator.bounds[0, 2] + 0.5, adapter.bounds[1, 2] - 0.5, 0.25)
    arms = [adapter.section(plane_origin=[0, 0, z], plane_normal=[0, 0, 1]).vertices for z in heights]
    reach = np.array([np.abs(points[:, 0]).max() for points in arms])
    groove = np.flatnonzero(reach < reach.max() - 1.0)
    rings = [stator.section(plane_origin=[0, 0, heights[groove[0]]], plane_normal=[0, 0, 1]).vertices, arms[groove[0]]]
    inner = shapely.convex_hull(shapely.MultiPoint(np.vstack(rings)[:, :2]))
    tie = trimesh.creation.extrude_polygon(inner.buffer(1.3).difference(inner), 4.8)
    tie.apply_translation([0, 0, heights[groove].mean() - 2.4])
    return body([tie])


def test_the_cage_comes_down_over_ring_arms_and_tie(made):
    name, _, _, meshes = made
    inside = [key for key in ("ring_stator", "ring_rotor", "slip_ring_adapter", "cage_base") if key in meshes]
    if name == "no_ring":
        assert inside == ["cage_base"]
    still = body([meshes[key] for key in inside])
    if name != "no_ring":
        still = still + tie_around(meshes["ring_stator"], meshes["slip_ring_adapter"])
    for lift in (0.5, 5.0, 20.0, 45.0, 70.0):
        raised = meshes["bearing_cage"].copy()
        raised.apply_translation([0, 0, lift])
        assert (still ^ body([raised])).volume() < 0.05, lift


FLAT = "the flat of the shaft"
FROM_FLAT_DEG = {
    f"on the side of {FLAT}": 0,
    f"opposite {FLAT}": 180,
    f"a quarter turn anticlockwise from {FLAT}, seen from above": 90,
    f"a quarter turn clockwise from {FLAT}, seen from above": -90,
}


def test_the_step_of_the_sleeve_says_where_the_leads_run():
    told = set()
    for angles in ((0, 90, -40, 5), (0, 60, -30, -60)):
        layout = laid_out(scanner_for(*angles))
        assert layout.stack.bearing is not None
        (sleeve,) = [part for part in parts_of(layout) if getattr(part, "name", "") == "journal_sleeve"]
        (place,) = [words for words in FROM_FLAT_DEG if f"its channel {words}; lay" in sleeve.step.words]
        x, y, _ = np.mean([lead.path.corners[0] for lead in layout.leads if lead.path], axis=0)  # in the channel
        turned = np.radians(90 + FROM_FLAT_DEG[place])  # the flat is at +y
        np.testing.assert_allclose(
            [x, y] / np.hypot(x, y), [np.cos(turned), np.sin(turned)], atol=0.25
        )  # two leads are side by side
        told.add(place)
    assert len(told) == 2


@pytest.mark.parametrize("beta_rot", [-150.0, -30.0, 20.0, 90.0, 170.0])
def test_a_scanner_that_hangs_is_built_with_its_deck_upside_down(beta_rot):
    layout = laid_out(scanner_for(0, beta_rot, 30, -30))
    (mount,) = [part for part in parts_of(layout) if getattr(part, "name", "") == "base_mount"]
    T = layout.scanner.angles.T_world_rot(0.0)
    rotor_m, deck_m = T[:3, 3], T[:3, :3] @ layout.deck.centre / 1000 + T[:3, 3]
    hangs = (T[:3, :3] @ layout.scanner.angles.T_rot_laser()[:3, 3] + rotor_m)[2] < deck_m[2]
    assert ("deck upside down" in mount.step.words) == hangs


def test_wires_of_the_ring_pass_the_bearing(made):
    name, _, assembly, meshes = made
    if name == "no_ring":
        pytest.skip("no ring, no wires")
    stack = assembly.layout.stack
    azimuth = sum(assembly.layout.linkage.cross_azimuths) / 2
    out = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    radius = stack.bearing.bore_mm / 2 - 2.5
    start = radius * out + [0, 0, stack.leads_low + 1]
    for mesh in (mesh for name, mesh in meshes.items() if not name.startswith(ROTOR_LEAD)):
        # straight up from the end of the ring's collar, then out above the cage
        up = mesh.ray.intersects_location([start], [[0, 0, 1.0]])[0]
        assert not (up[:, 2] < stack.shoulder + 6).any()
        aside = mesh.ray.intersects_location([[*(radius * out)[:2], stack.shoulder + 4]], [out])[0]
        assert not (np.linalg.norm(aside[:, :2], axis=1) < 30).any()


def test_an_upright_axis_is_left_without_and_says_so():
    scanner = scanner_for(0, 0, 60, -45)
    drive = drive_of(scanner)
    assert drive.stack.bearing is None and drive.of(BearingCage) is None
    weak = rated(scanner, 1.0)
    assert drive_of(weak).stack.bearing.name == "61806-2RS"


def test_none_of_the_catalogue_fits(parts_of):
    scanner = replace(scanner_for(*ROLLING), bearings=())
    layout, with_bearing = laid_out(scanner), parts_of(scanner_for(*ROLLING))
    assert drive_of(scanner).of(BearingCage) is None
    check = _tilt_moment(layout, link_bodies(with_bearing))
    assert check.severity == "error" and "none of the catalogue fits" in check.hint


def _tilt_moment(layout, bodies):
    return next(check for check in load_checks(layout, bodies) if check.code == "tilt_moment")


def test_a_case_without_ears_around_the_flange_is_refused():
    scanner = scanner_for(*ROLLING)
    holes = ((12.0, 0.0), (-12.0, 0.0), (12.0, -3.0), (-12.0, -3.0))
    ears = tuple(Hole(at_mm=(x, y, -6.5), axis="+z", kind="through", size="M2.5", depth_mm=2.0) for x, y in holes)
    servo = scanner.servo.model_copy(update={"holes": ears})
    wrong = replace(scanner, servo=servo)
    with pytest.raises(BuildError, match=r"servo_frame: plate: holes = .* in front: leave a wall of -3.95 mm"):
        drive_of(wrong)


def test_the_bearing_counts_in_the_hash_of_the_parts():
    scanner = scanner_for(*ROLLING)
    other = Bearing.model_validate(scanner.bearings[1].model_dump() | {"width_mm": 9.0})
    assert digest_of(scanner) != digest_of(replace(scanner, bearings=(other,)))


@pytest.mark.parametrize(
    ("servo", "ring"), [("XL430-W250", "UH1256-02-0610-06S"), ("AX-12A", None), ("XC330-M288", None)]
)
def test_an_upright_rotor_whose_shock_the_horn_does_not_hold_gets_a_bearing(servo, ring):
    found = set()
    for sensor in ("STL27L", "RPLIDAR A1", "LMS111"):
        scanner = scanner_at((0, 0, 30, 10), sensor=sensor, servo=servo, slip_ring=ring)
        stack, _ = direct_stack(scanner, envelope_of(scanner.lidar), CROSS_M3)
        alone, _ = direct_stack(replace(scanner, bearings=()), envelope_of(scanner.lidar), CROSS_M3)
        weight, joint = heaviest(scanner, alone), on_horn(scanner.servo, alone, alone.shaft)
        centre = np.array([weight.off_axis_m, 0.0, alone.horn / 1000 + weight.lever_m])
        under, into = (
            PRINTED if alone.cup_bore else METAL,
            MOULDED if scanner.servo.horn_kind == "self_tapping" else BOUGHT,
        )
        strips = 5 * weight.along_n * worst_shares(joint, centre)[0] > hold_of(joint, under, into).pull_n
        assert (stack.bearing is not None) >= strips
        found.add(strips)
    assert True in found


@settings(deadline=None, max_examples=40)
@given(alpha_rot=st.floats(-180, 180), beta_rot=degrees, alpha=degrees, beta=degrees)
@example(alpha_rot=0.0, beta_rot=31.0, alpha=6.0, beta=15.0)
def test_a_bearing_changes_the_stack_below_the_shoulder_only(alpha_rot, beta_rot, alpha, beta):
    scanner = scanner_for(alpha_rot, beta_rot, alpha, beta)
    stack = drive_of(scanner).stack
    alone, _ = direct_stack(replace(scanner, bearings=()), envelope_of(scanner.lidar), CROSS_M3)
    above = [(each.h, each.shoulder, each.cross, each.spigot_top) for each in (stack, alone)]
    # where its hub, as wide as the bearing, covers a screw, a plate is put between, which a narrow hub does without
    assert above[0] == above[1] or (stack.sub_plate is not None and alone.sub_plate is None and stack.h > alone.h)
    tilt = np.degrees(np.arccos(np.clip(scanner.angles.T_world_rot(0.0)[2, 2], -1, 1)))
    if min(tilt, 180 - tilt) < 15:
        assert stack.bearing is None
    if 40 < tilt < 140:
        assert stack.bearing is not None and bearing_for(scanner, alone) == stack.bearing
        below = 8.5 + stack.waist_length - 3.0 + 9.0  # sleeve, a waist for a gap, and the ring's shaft; less is shared
        assert alone.horn + alone.h - below - 0.01 <= stack.horn + stack.h < alone.horn + alone.h


def beam(weight, stack, cage, metal, off_m=0.0):
    """Force of the bearing, moment of the horn: collar, waist, cone and spigot by finite differences."""
    n = 40_000
    bearing = (stack.bearing_middle - stack.horn) / 1000
    z = np.linspace(0, bearing, n + 1)
    waist, spigot = metal.waist * stack.waist_diameter / 2, stack.shaft_diameter / 2
    ends = [0.0, stack.flange_thickness, stack.collar_height, stack.collar_height + stack.waist_length]
    mm = 1000 * z
    radius = np.select(
        [mm < ends[1], mm < ends[2], mm < ends[3]],
        [stack.flange_radius, stack.collar_radius, waist],
        np.minimum(spigot, waist + mm - ends[3]),
    )
    EI = metal.modulus_pa * np.pi / 4 * (radius / 1000) ** 4

    def deflection(R):
        moment = weight.across_n * (weight.lever_m - z) + weight.along_n * weight.off_axis_m - R * (bearing - z)
        curve = moment / EI
        slope = np.concatenate([[0], np.cumsum((curve[1:] + curve[:-1]) / 2)]) * bearing / n
        return np.trapezoid(slope, z), moment[0]

    at_zero, at_one = deflection(0.0)[0], deflection(1.0)[0]
    R = (at_zero - off_m) / (at_zero - at_one + 1 / cage)
    return R, deflection(R)[1]


@settings(deadline=None, max_examples=20)
@given(
    across=st.floats(0.1, 10),
    along=st.floats(0, 10),
    lever=st.floats(0.12, 0.2),
    cage=st.floats(1e4, 1e8),
    metal=st.sampled_from([ALUMINIUM, STEEL]),
)
def test_horn_and_bearing_share_the_load_as_the_beam_equation_says(across, along, lever, cage, metal):
    stack = drive_of(SCANNERS["ground_ahead"]).stack
    weight = Weight(across, along, lever, 0.013)
    shared = supported(weight, stack, cage, metal)
    R, moment = beam(weight, stack, cage, metal)
    assert shared.bearing_force_n == pytest.approx(R, rel=1e-3)
    assert shared.horn_moment_nm == pytest.approx(abs(moment), rel=1e-2, abs=1e-3)
    off = beam(weight, stack, cage, metal, 1e-4)[1] - moment
    assert shared.misaligned_nm_per_m * 1e-4 == pytest.approx(abs(off), rel=1e-2)


@pytest.mark.parametrize("servo", ["MX-64R", "MX-106"])
@pytest.mark.parametrize("angles", [GROUND_AHEAD, ROLLING, (-90, 0, 90, 0)])
def test_all_that_is_out_of_line_leaves_half_of_the_horns_rating(servo, angles):
    """In aluminium and in steel; and by an independent sum: every offset at once in one direction."""
    scanner = scanner_for(*angles, servo=servo)
    stack = drive_of(scanner).stack
    lever = (-34.0 - stack.horn) / 1000  # of the rotor's centre, 0.8 kg, as made
    tilt = np.linalg.norm(scanner.angles.T_world_rot(0.0)[2, :2])
    weight = Weight(7.9 * tilt, 7.9 * np.sqrt(1 - min(1.0, tilt**2)), lever, 2e-4)
    cage = drive_of(scanner).of(BearingCage)
    worst = worst_moment_nm(cage, weight)
    assert len(worst) == 2 and max(worst.values()) < scanner.servo.radial_load_n * 0.010 / 2
    stiffness = stiffness_n_per_m(stack, cage.ears)
    for metal, total in zip((ALUMINIUM, STEEL), worst.values(), strict=True):
        off = sum(offsets_mm(cage.ears).values()) / 1000
        moments = [beam(weight, stack, stiffness, metal, way * off)[1] for way in (1, -1)]
        assert total == pytest.approx(np.abs(moments).max(), rel=0.02)
    listed = contributions(cage, weight)
    assert listed[0].off_mm is None and sum(each.moment_nm for each in listed) == pytest.approx(
        next(iter(worst.values()))
    )


@pytest.mark.parametrize(
    ("servo", "stall_nm", "length"), [("MX-64R", 6.0, 24.0), ("MX-28", 2.5, 20.0), ("MX-106", 8.4, 32.0)]
)
def test_the_waist_is_as_short_as_a_stalled_servo_allows_and_as_thick_as_the_horn_bears(servo, stall_nm, length):
    """A thin one twists under what is out of balance, which changes over a turn; a long one makes a soft cage."""
    scanner = scanner_for(0, 90, 0, -90, servo=servo)
    stack = drive_of(scanner).stack
    bears = scanner.servo.radial_load_n * 0.010 / 2
    thicker = replace(stack, waist_diameter=stack.waist_diameter + 0.1)
    cages = [replace(drive_of(scanner).of(BearingCage), stack=one) for one in (stack, thicker)]
    worst = [max(worst_moment_nm(cage, heaviest(scanner, stack)).values()) for cage in cages]
    assert worst[0] <= 0.92 * bears < worst[1]
    assert stack.waist_length == length
    in_steel = 0.577 * 900 * np.pi / 16 * (0.76 * stack.waist_diameter) ** 3 / 1000
    assert stall_nm <= in_steel
    assert (STEEL.waist**4 * STEEL.modulus_pa) == pytest.approx(ALUMINIUM.modulus_pa, rel=0.03)


def test_a_stiff_waist_would_put_the_misalignment_on_the_horn():
    scanner = SCANNERS["ground_ahead"]
    stack, weight = drive_of(scanner).stack, Weight(6.7, 4.7, 0.14, 2e-4)
    stiff = supported(weight, stack, 3e5, replace(STEEL, waist=6.0 / stack.waist_diameter))
    assert stiff.misaligned_nm_per_m > 2.5 * supported(weight, stack, 3e5, STEEL).misaligned_nm_per_m


def test_a_cage_of_thicker_wall_is_stiffer():
    scanner = SCANNERS["ground_ahead"]
    cage = drive_of(scanner).of(BearingCage)
    stiffness, wider = stiffness_n_per_m(cage.stack, cage.ears), replace(cage.ears, opening=cage.ears.opening + 5)
    assert 1e5 < stiffness < 1e7
    assert stiffness_n_per_m(cage.stack, wider) < stiffness


def test_every_cage_resists_its_bearing():
    """Of every servo: an opening wider than the cage made the stiffness negative, and the frequency NaN."""
    stiff = {}
    for servo, lidar in itertools.product(load_catalogue(), ("RPLIDAR S2", "UTM-30LX", "LMS111")):
        if isinstance(servo, Servo):
            scanner = scanner_for(0, 90, 58, 7, servo=servo.name, lidar=lidar)
            for ring in (None, scanner.slip_ring):
                try:
                    drive = drive_of(replace(scanner, slip_ring=ring))
                except BuildError:
                    continue
                if (cage := drive.of(BearingCage)) is not None:
                    stiff[servo.name, lidar, ring is None] = stiffness_n_per_m(cage.stack, cage.ears)
    assert len(stiff) > 20 and min(stiff.values()) > 1e5 and max(stiff.values()) < 1e7


@pytest.mark.parametrize("servo", ["MX-28"])
@pytest.mark.parametrize("beta_rot", [55, 0])
def test_where_a_fork_finds_no_holes_the_base_of_a_cage_does(servo, beta_rot):
    """Their ears leave a fork no two pairs behind the flange: even an upright axis gets a bearing, and is built."""
    scanner = scanner_for(0, beta_rot, 30, -50, servo=servo, lidar="UST-10LX")
    layout = laid_out(scanner)
    assert layout.stack.bearing is not None
    (adapter,) = [part for part in parts_of(layout) if getattr(part, "name", "") == "slip_ring_adapter"]
    assert checked_mesh(adapter.make(), adapter.name).is_closed()
    with pytest.raises(BuildError, match=r"slip_ring_adapter: fork: holes"):
        laid_out(replace(scanner, bearings=()))


@pytest.mark.parametrize(("servo", "lidar"), [("STS3215", "TiM551"), ("XL430-W250", "UTM-30LX")])
def test_the_base_of_a_cage_stands_on_its_four_feet_over_the_heads_of_a_frame(servo, lidar):
    """An opening that left all these heads free had two of the feet in it, and a nut without a wall around it."""
    scanner = scanner_at((29.6, -39.2, -84.4, 0.3), sensor=lidar, servo=servo, slip_ring=None, printer="fdm-0.4-nut")
    assembly = make_parts(scanner, lambda spec: spec.name == "cage_base")
    cage, base = assembly.layout.drive.of(BearingCage), assembly.made["cage_base"]
    ears, seats = cage.ears, cage.stack.horn + cage.ears.seats
    assert cage.stack.cage_inner - ears.opening > 8.0 - 1e-9

    def is_solid(x, y, z):
        return base.isInside(cq.Vector(x, y, z))

    around = np.radians(np.arange(0.0, 360.0, 30.0))
    for x, y in ears.holes:
        assert not is_solid(x, y, seats + 1.0)
        assert all(is_solid(x + 2.3 * np.cos(a), y + 2.3 * np.sin(a), seats + 0.5) for a in around)
    head = SCREWS[scanner.servo.front.screw]
    for x, y in scanner.servo.front.places:
        for z in (0.3, head.head_height + 0.3):
            assert not any(is_solid(x + 2.2 * np.cos(a), y + 2.2 * np.sin(a), seats + z) for a in around)
