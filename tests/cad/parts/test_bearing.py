"""The bearing of a tilted axis: when it is needed, how it shares the load, and how its cage fits together."""

import itertools
from dataclasses import replace

import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st

from cad.assembly.make import make_parts
from cad.assembly.masses import link_bodies, rotor_weight
from cad.checks.remarks import findings_of, left_out_of
from cad.geometry.mesh import checked_mesh
from cad.layout.direct.cage import cage_of, stiffness_n_per_m
from cad.layout.direct.loads import bearing_for, supported, waist_nm_per_rad
from cad.layout.direct.sizing import direct_stack
from cad.layout.layout import config_hash, layout_of
from cad.layout.loads import Weight
from cad.parts.all_parts import parts_of
from design.angles import Angles, AngleSet
from design.catalogue.catalogue import load_catalogue
from design.catalogue.products import Bearing, Servo
from design.errors import BuildError
from design.scanner import scanner_of

degrees = st.floats(-90, 90)
ROLLING, GROUND_AHEAD = (0, 90, 0, -90), (0, -55, -80, 75)


def scanner_for(alpha_rot, beta_rot, alpha, beta, lidar="UTM-30LX", servo="MX-64R"):
    angles = AngleSet(
        task="test",
        angles_deg=Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha, beta_laser=beta),
        sensor=lidar,
        servo=servo,
        slip_ring="UH1256-02-0610-06S",
    )
    return scanner_of(angles, "fdm-0.4", load_catalogue())


def rated(scanner, newton):
    return replace(scanner, servo=Servo.model_validate(scanner.servo.model_dump() | {"radial_load_n": newton}))


SCANNERS = {
    "ground_ahead": scanner_for(*GROUND_AHEAD),
    "no_ring": replace(scanner_for(0, 90, 30, -30), slip_ring=None),
    "small": rated(scanner_for(20, -50, 33, 12, "URG-04LX", "AX-12A"), 10.0),
}


@pytest.fixture(scope="module", params=SCANNERS)
def made(request):
    scanner = SCANNERS[request.param]
    assembly = make_parts(scanner)
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
    bodies = link_bodies(scanner, assembly)
    weight = rotor_weight(scanner, assembly.layout.stack, bodies)
    limit = scanner.servo.radial_load_n * 0.010
    assert weight.moment_nm > limit  # so it needs the bearing
    assert not [f for f in findings_of(scanner, assembly, bodies) if f.code == "tilt_moment"]
    left_out = [entry.what for entry in left_out_of(assembly) if entry.what != "counterweight"]
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
    for name, diameter, sign in (("bearing_cage", bearing.outer_mm, 1), ("alignment_linkage", bearing.bore_mm, -1)):
        section = meshes[name].section(plane_origin=[0, 0, (low + high) / 2], plane_normal=[0, 0, 1])
        radius = np.linalg.norm(section.vertices[:, :2], axis=1)
        edge = radius[np.abs(radius - diameter / 2) < 0.5]
        assert len(edge) > 20
        np.testing.assert_allclose(2 * edge, diameter + sign * fit / 2, atol=0.02)
    # the lip holds the outer ring only, the hub's step the inner ring only
    lip = meshes["bearing_cage"].section(plane_origin=[0, 0, low - 1.0], plane_normal=[0, 0, 1])
    assert bearing.bore_mm / 2 + 3 < np.linalg.norm(lip.vertices[:, :2], axis=1).min() < bearing.outer_mm / 2 - 1
    step = meshes["alignment_linkage"].section(plane_origin=[0, 0, high + 0.25], plane_normal=[0, 0, 1])
    assert np.linalg.norm(step.vertices[:, :2], axis=1).max() < bearing.bore_mm / 2 + 1.5


def test_the_cage_comes_down_over_ring_and_arms(made):
    name, _, _, meshes = made
    inside = [key for key in ("ring_stator", "ring_rotor", "slip_ring_adapter", "cage_base") if key in meshes]
    if name == "no_ring":
        assert inside == ["cage_base"]
    still = body([meshes[key] for key in inside])
    for lift in (0.5, 5.0, 20.0, 45.0, 70.0):
        raised = meshes["bearing_cage"].copy()
        raised.apply_translation([0, 0, lift])
        assert (still ^ body([raised])).volume() < 0.05, lift


def test_wires_of_the_ring_pass_the_bearing(made):
    name, _, assembly, meshes = made
    if name == "no_ring":
        pytest.skip("no ring, no wires")
    stack = assembly.layout.stack
    azimuth = sum(assembly.layout.linkage.cross_azimuths) / 2
    out = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    radius = stack.bearing.bore_mm / 2 - 2.5
    start = radius * out + [0, 0, stack.ring_top + 1]
    for mesh in meshes.values():
        # straight up from the ring's end face, then out above the cage
        up = mesh.ray.intersects_location([start], [[0, 0, 1.0]])[0]
        assert not (up[:, 2] < stack.shoulder + 6).any()
        aside = mesh.ray.intersects_location([[*(radius * out)[:2], stack.shoulder + 4]], [out])[0]
        assert not (np.linalg.norm(aside[:, :2], axis=1) < 30).any()


def test_an_upright_axis_is_left_without_and_says_so():
    scanner = scanner_for(0, 0, 60, -45)
    stack = direct_stack(scanner)
    assert stack.bearing is None and cage_of(scanner, stack) is None
    weak = rated(scanner, 1.0)
    assert direct_stack(weak).bearing.name == "61806-2RS"


def test_none_of_the_catalogue_fits():
    scanner = replace(scanner_for(*ROLLING), bearings=())
    assembly = make_parts(scanner)
    assert "bearing_cage" not in assembly.made
    found = [f for f in findings_of(scanner, assembly, link_bodies(scanner, assembly)) if f.code == "tilt_moment"]
    assert "none of the catalogue fits" in found[0].message


def test_a_case_without_ears_around_the_flange_is_refused():
    scanner = scanner_for(*ROLLING)
    holes = ((12.0, 0.0), (-12.0, 0.0), (12.0, -3.0), (-12.0, -3.0))
    servo = Servo.model_validate(scanner.servo.model_dump() | {"case_holes_mm": holes})
    wrong = replace(scanner, servo=servo)
    with pytest.raises(BuildError, match=r"cage_base: ears: case_holes_mm"):
        cage_of(wrong, direct_stack(wrong))


def test_the_bearing_counts_in_the_hash_of_the_parts():
    scanner = scanner_for(*ROLLING)
    other = Bearing.model_validate(scanner.bearings[1].model_dump() | {"width_mm": 9.0})
    assert config_hash(scanner) != config_hash(replace(scanner, bearings=(other,)))


@settings(deadline=None, max_examples=40)
@given(alpha_rot=st.floats(-180, 180), beta_rot=degrees, alpha=degrees, beta=degrees)
@example(alpha_rot=0.0, beta_rot=31.0, alpha=6.0, beta=15.0)
def test_a_bearing_changes_the_stack_below_the_shoulder_only(alpha_rot, beta_rot, alpha, beta):
    scanner = scanner_for(alpha_rot, beta_rot, alpha, beta)
    stack = direct_stack(scanner)
    alone = direct_stack(replace(scanner, bearings=()))
    above = [(each.h, each.shoulder, each.cross, each.spigot_top) for each in (stack, alone)]
    # where its hub, as wide as the bearing, covers a screw, a plate is put between, which a narrow hub does without
    assert above[0] == above[1] or (stack.sub_plate is not None and alone.sub_plate is None and stack.h > alone.h)
    tilt = np.degrees(np.arccos(np.clip(scanner.angles.T_world_rot(0.0)[2, 2], -1, 1)))
    if min(tilt, 180 - tilt) < 15:
        assert stack.bearing is None
    if 40 < tilt < 140:
        assert stack.bearing is not None and bearing_for(scanner, alone) == stack.bearing
        assert stack.horn == alone.horn - 8.5 - 7.0  # journal, and a waist for a gap


def beam(weight, stack, cage):
    """Horn, waist, shaft and bearing by finite differences of the beam equation: an independent solution."""
    E, n = 70e9, 4000
    length = weight.lever_m
    z = np.linspace(0, length, n + 1)
    bearing = (stack.bearing_middle - stack.horn) / 1000
    EI = E * np.pi / 64 * (stack.shaft_diameter / 1000) ** 4
    hinge = 1 / waist_nm_per_rad(stack)

    def deflection(R):
        moment = weight.across_n * (length - z) + weight.along_n * weight.off_axis_m
        moment = moment - R * np.clip(bearing - z, 0, None)
        slope = hinge * moment[0] + np.concatenate([[0], np.cumsum((moment[1:] + moment[:-1]) / 2)]) * length / n / EI
        bent = np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2)]) * length / n
        return np.interp(bearing, z, bent), moment[0]

    at_zero, at_one = deflection(0.0)[0], deflection(1.0)[0]
    R = at_zero / (at_zero - at_one + 1 / cage)
    return R, abs(deflection(R)[1])


@settings(deadline=None, max_examples=20)
@given(across=st.floats(0.1, 10), along=st.floats(0, 10), lever=st.floats(0.1, 0.2), cage=st.floats(1e4, 1e8))
def test_horn_and_bearing_share_the_load_as_the_beam_equation_says(across, along, lever, cage):
    stack = direct_stack(SCANNERS["ground_ahead"])
    weight = Weight(across, along, lever, 0.013)
    shared = supported(weight, stack, cage)
    R, moment = beam(weight, stack, cage)
    assert shared.bearing_force_n == pytest.approx(R, rel=1e-3)
    assert shared.horn_moment_nm == pytest.approx(moment, rel=1e-2, abs=1e-3)


def test_a_cage_of_thicker_wall_is_stiffer():
    scanner = SCANNERS["ground_ahead"]
    cage = cage_of(scanner, direct_stack(scanner))
    assert 1e5 < stiffness_n_per_m(cage) < 1e7
    assert stiffness_n_per_m(replace(cage, opening=cage.opening + 5)) < stiffness_n_per_m(cage)


@pytest.mark.parametrize("servo", ["XM430-W350", "MX-28"])
def test_under_a_cage_the_adapter_asks_for_no_holes_of_a_fork(servo):
    """Their ears leave a fork no two pairs behind the flange; the base of a cage stands on others."""
    layout = layout_of(scanner_for(0, 55, 30, -50, servo=servo))
    (adapter,) = [part for part in parts_of(layout) if part.name == "slip_ring_adapter"]
    assert checked_mesh(adapter.make(), adapter.name).is_closed()
    with pytest.raises(BuildError, match=r"slip_ring_adapter: fork: case_holes_mm"):
        parts_of(layout_of(scanner_for(0, 0, 30, -50, servo=servo)))
