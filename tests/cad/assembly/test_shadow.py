"""What the parts hide of the fan, against rays cast by other code and against closed forms."""

import io

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scanners import scanner_at

from scanwright.cad.assembly.make import make_parts
from scanwright.cad.assembly.shadow import PartsWorkshop, shadow_of, triangles_of
from scanwright.cad.checks.beams import beam_checks
from scanwright.design.search.with_parts import Refused, Workshop
from scanwright.design.self_occlusion import AXIS_STEPS, SelfOcclusion, self_occlusion_bytes

LYING = (0, 0, 90, 0)  # whose parts other tests use too


def scanner_for(*setting_deg):
    return scanner_at(setting_deg)


@pytest.fixture(scope="module")
def lying(parts_of):
    scanner = scanner_for(*LYING)
    assembly = parts_of(scanner)
    return scanner, assembly, shadow_of(scanner, triangles_of(assembly), assembly.turning())


def rays(gamma):
    """Middle rays of the fan in the rotation frame: R_rot_laser = Rx(90 deg)."""
    bearing = np.radians(np.arange(-540, 541) * 0.25)
    fan = np.stack([np.cos(bearing), 0 * bearing, np.sin(bearing)], axis=1)
    c, s = np.cos(gamma), np.sin(gamma)
    return fan @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def other_caster(meshes):
    bodies = [trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) for mesh in meshes]
    return trimesh.ray.ray_triangle.RayMeshIntersector(trimesh.util.concatenate(bodies))  # rtree and numpy, no embree


def test_hidden_beams_are_those_of_another_caster_and_no_more_than_a_beam_is_wide(lying):
    _, assembly, shadow = lying
    meshes = assembly.meshes()
    assert shadow.stator.shape == (1081, AXIS_STEPS)
    some = np.arange(0, 1081, 9)
    rotor = other_caster([m for name, m in meshes.items() if name in assembly.turning() and name != "lidar_window"])
    hidden = rotor.intersects_any(np.zeros((len(some), 3)), rays(0.0)[some])
    assert shadow.beams[some][hidden].all()  # whose middle is hidden is hidden
    grown = np.convolve(hidden, np.ones(5), "same") > 0
    assert not (shadow.beams[some] & ~grown).any()  # 3 mm of aperture 45 mm away: within 4.5 deg
    assert 30 < hidden.sum() * 9 * 0.25 < 60

    stator = other_caster([m for name, m in meshes.items() if name not in assembly.turning()])
    near = np.flatnonzero(shadow.stator.any(axis=1))[::12]
    for k in (0, 131, 500):
        hit = stator.intersects_any(np.zeros((len(near), 3)), rays(2 * np.pi * k / AXIS_STEPS)[near])
        assert shadow.stator[near, k][hit].all()
        assert hit.any()


def test_only_beams_that_look_down_meet_what_stands_still(lying):
    _, _, shadow = lying
    down = rays(0.0)[:, 2] < -0.5
    assert not shadow.stator[~down].any() and shadow.stator[down].any()
    assert np.array_equal(shadow.hidden() == 1, shadow.beams | shadow.stator.all(axis=1))


def test_a_part_in_the_way_is_seen_and_only_while_it_is_there(lying):
    scanner, assembly, before = lying
    post = trimesh.creation.box((10, 10, 10))
    post.apply_translation([200, 0, 0])  # in the fan when gamma = 0, 2.9 deg wide from here
    more = triangles_of(assembly) | {"a_post": post.triangles / 1000}
    after = shadow_of(scanner, more, assembly.turning())
    added = after.stator & ~before.stator
    ahead = np.abs(np.degrees(scanner.lidar.bearings_rad())) < 1.2
    assert added[ahead][:, [0, 1, AXIS_STEPS - 1]].all()
    assert not added[:, 12:-12].any()
    assert np.array_equal(after.beams, before.beams)


def test_the_bound_hides_nothing_that_the_parts_do_not(lying):
    scanner, _, shadow = lying
    workshop: Workshop = PartsWorkshop(scanner)
    bound = workshop.bound(np.radians(LYING))
    assert bound.stator is None and 100 < bound.beams.sum()
    assert (shadow.hidden()[bound.beams] == 1).all()


@settings(deadline=None, max_examples=60)
@given(alpha=st.floats(-90, 90), beta=st.floats(-90, 90))
def test_the_bound_is_a_cone_about_the_axis(alpha, beta):
    scanner = scanner_for(0, 90, 0, 0)
    found = PartsWorkshop(scanner).bound(np.radians([0, 90, alpha, beta]))
    a, b = np.radians(np.round([alpha, beta], 2))
    bearing = scanner.lidar.bearings_rad()
    down = np.sin(b) * np.cos(bearing) - np.cos(b) * np.sin(a) * np.sin(bearing)
    if found.beams.any():
        assert down[found.beams].min() > down[~found.beams].max()
        assert 15 < np.degrees(np.arccos(down[found.beams].min())) < 25
    else:
        assert down.max() < np.cos(np.radians(15))


def test_what_cannot_be_built_is_refused_with_the_reason():
    workshop = PartsWorkshop(scanner_for(*LYING))
    for answer in (workshop.bound(np.radians([0, 0, 120, 0])), workshop.shadow(np.radians([0, 0, 120, 0]))):
        assert isinstance(answer, Refused) and "upside down" in answer.reason


def test_own_body_is_the_same_bytes_and_reads_back(lying):
    scanner, _, shadow = lying
    bearings = scanner.lidar.bearings_rad()
    data = self_occlusion_bytes(shadow, bearings)
    assert data == self_occlusion_bytes(shadow, bearings)
    table = np.load(io.BytesIO(data))
    assert np.array_equal(table["beams"], shadow.beams) and np.array_equal(table["stator"], shadow.stator)
    np.testing.assert_array_equal(table["bearing_rad"], bearings)
    bare = np.load(io.BytesIO(self_occlusion_bytes(SelfOcclusion(shadow.beams, None), bearings)))
    assert not bare["stator"].any() and bare["stator"].shape == (1081, AXIS_STEPS)


def test_a_full_fan_looks_past_the_neck_of_the_linkage():
    scanner = scanner_at((166.61, -87.48, 89.82, -42.81), sensor="LD19")
    assembly = make_parts(scanner, lambda spec: spec.name not in ("base_mount", "bearing_cage", "slip_ring_adapter"))
    triangles = triangles_of(assembly)
    shadow = shadow_of(scanner, triangles, assembly.turning())
    (own,) = [c for c in beam_checks(assembly, shadow) if c.code == "beams_linkage"]
    assert own.severity == "ok" and own.value <= 2.0  # deg; the edges of the neck had hidden 3.2
