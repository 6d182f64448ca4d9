"""The exported parts of whole scanners, read back and measured by code that shares nothing with cad/."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import cadquery as cq
import manifold3d
import numpy as np
import pytest
import trimesh
from quick_tests import samples
from scanners import GROUND_AHEAD, UPRIGHT, mount_offset_mm, scanner_at

from scanwright.cad.checks.products import unverified_checks
from scanwright.cad.layout.deck import FOOT_MM
from scanwright.cad.layout.names import SERVO_CABLE, STATOR_LEADS

# name: alpha_rot, beta_rot, alpha_laser, beta_laser, lidar, servo; hundreds more: `python -m benchmarks.cad.parts`
SETTINGS = {
    "upright": (*UPRIGHT, "UTM-30LX", "MX-64R"),
    "ground_ahead": (*GROUND_AHEAD, "UTM-30LX", "MX-64R"),
    "ceiling": (180, 0, 45, -30, "UTM-30LX", "MX-64R"),
    "small": (160, -50, 33, 12, "URG-04LX", "AX-12A"),  # hangs, and so does the ceiling's
}
MODULES = ["tripod_foot"]  # nobody asked for them
BEARING = {"ground_ahead", "small"}
BALANCED = {"ground_ahead"}  # elsewhere gravity does not turn it, the horn bears no more, or no room
SEAT = {"UTM-30LX": (55.0, 26.5), "URG-04LX": (53.15, 20.0)}  # optical height, hole offset
SCREW_HOLE = 3.4  # M3 on fdm-0.4
TRAVEL = {"UTM-30LX": 0.0, "URG-04LX": 1.838}  # of screws in slots: nobody has verified the holes of the second


def rot(axis, degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array(
        {
            "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
            "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
        }[axis]
    )


def scanner_for(name):
    *setting_deg, lidar, servo = SETTINGS[name]
    scanner = scanner_at(setting_deg, sensor=lidar, servo=servo)
    offset = mount_offset_mm(scanner)
    return replace(scanner, angles=scanner.angles.model_copy(update={"t_world_rot_mm": offset}))


def merged(vertices, faces):
    """Closed mesh of a re-imported solid, whose tessellation repeats vertices face by face."""
    points, index = np.unique(np.round(vertices, 5), axis=0, return_inverse=True)
    faces = index.reshape(-1)[np.asarray(faces)]
    keep = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return trimesh.Trimesh(points, faces[keep], process=False)


@pytest.fixture(scope="module", params=samples(SETTINGS, ("ground_ahead",)))
def built(request, built_once):
    setting = SETTINGS[request.param]
    scanner = scanner_for(request.param)
    folder, result = built_once(scanner)
    solids = {}
    for child in cq.Assembly.importStep(str(folder / "assembly.step")).children:
        solids[child.name] = cq.Compound.makeCompound(child.toCompound().Solids())
    meshes = {}
    for name, solid in solids.items():
        vertices, faces = solid.tessellate(0.02, 0.2)
        meshes[name] = merged(np.array([v.toTuple() for v in vertices]), faces)
    stl = {part.name: trimesh.load(folder / "parts" / f"{part.name}.stl") for part in result.parts}
    R_world = rot("x", setting[0]) @ rot("y", setting[1])
    return SimpleNamespace(
        name=request.param,
        folder=folder,
        result=result,
        solids=solids,
        meshes=meshes,
        stl=stl,
        R=rot("y", setting[3]) @ rot("x", setting[2]),
        R_world=R_world,
        lidar=setting[4],
        t_world=np.array(scanner.angles.t_world_rot_mm),
    )


def circle(points):
    """Centre and diameters of vertices on a circle, in the plane, by least squares."""
    A = np.column_stack([2 * points, np.ones(len(points))])
    centre = np.linalg.lstsq(A, (points**2).sum(axis=1), rcond=None)[0][:2]
    return centre, 2 * np.linalg.norm(points - centre, axis=1)


def test_every_stl_is_one_closed_body_of_the_right_volume(built):
    for part in built.result.parts:
        mesh = built.stl[part.name]
        assert mesh.is_watertight and mesh.is_winding_consistent, part.name
        assert mesh.body_count == 1, part.name
        solid = cq.importers.importStep(str(built.folder / "parts" / f"{part.name}.step")).val()
        assert len(solid.Solids()) == 1 and solid.isValid()
        assert mesh.volume == pytest.approx(built.result.meshes[part.name].volume(), rel=1e-4)
        assert built.result.assembly.mesh(part.name).volume() == pytest.approx(solid.Volume(), rel=1e-3)
        assert part.volume_mm3 == pytest.approx(solid.Volume(), rel=1e-4)
        np.testing.assert_allclose(mesh.bounds, part.box_mm, atol=1e-3)


def test_the_seat_looks_where_the_angles_say(built):
    height, offset = SEAT[built.lidar]
    mesh = built.stl["alignment_linkage"]
    local = mesh.vertices @ built.R  # laser frame
    seat = local[np.abs(local[:, 2] + height) < 1e-3]
    world = seat @ built.R.T
    normal = np.linalg.svd(world - world.mean(axis=0))[2][2]
    normal *= np.sign(normal @ built.R[:, 2])
    off = np.degrees(np.arcsin(np.linalg.norm(np.cross(normal, built.R[:, 2]))))
    assert off < 1e-4

    centres = []
    for x, y in itertools.product((offset, -offset), repeat=2):
        out = np.array([x, y]) / np.hypot(x, y)
        along = (seat[:, :2] - [x, y]) @ out
        # a slot towards the axis, its two ends moved into one: a hole
        moved = seat[:, :2] - np.clip(along, -TRAVEL[built.lidar], TRAVEL[built.lidar])[:, None] * out
        near = np.linalg.norm(moved - [x, y], axis=1) < 2.0
        edge = moved[near]
        assert len(edge) > 20
        assert np.ptp(along[near]) == pytest.approx(SCREW_HOLE + 2 * TRAVEL[built.lidar], abs=0.02)
        centre, diameters = circle(edge)
        np.testing.assert_allclose(diameters, SCREW_HOLE, atol=0.02)
        centres.append([*centre, seat[:, 2].mean()])
    np.testing.assert_allclose(np.mean(centres, axis=0) @ built.R.T, -height * built.R[:, 2], atol=0.01)
    turned = np.array(centres) - np.mean(centres, axis=0)
    np.testing.assert_allclose(np.abs(turned[:, :2]), offset, atol=0.01)


def test_the_bore_sits_on_the_axis_and_is_keyed_towards_the_index(built):
    vertices = built.stl["alignment_linkage"].vertices
    rim = vertices[np.abs(vertices[:, 2] - vertices[:, 2].min()) < 1e-3, :2]
    rim = rim[np.linalg.norm(rim, axis=1) < 8]
    assert rim[:, 1].max() == pytest.approx(5.425, abs=0.01)  # the flat, at +y
    _, diameters = circle(rim[rim[:, 1] < 4])
    np.testing.assert_allclose(diameters, 12.85, atol=0.02)  # 0.2 around the shaft
    centre, _ = circle(rim[rim[:, 1] < 4])
    np.testing.assert_allclose(centre, 0, atol=0.01)


def test_no_two_parts_share_room(built):
    bodies = {}
    for name, mesh in {**built.meshes, **built.stl}.items():
        bodies[name] = manifold3d.Manifold(
            manifold3d.Mesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
        )
        assert bodies[name].volume() > 1, name
    for one, other in itertools.combinations(bodies, 2):
        assert (bodies[one] ^ bodies[other]).volume() < 0.05, (one, other)


def test_the_rotor_turns_freely(built):
    def body(names, turn=0.0):
        R = rot("z", turn)
        found = [{**built.meshes, **built.stl}[name] for name in names]
        solids = [
            manifold3d.Manifold(manifold3d.Mesh((m.vertices @ R.T).astype(np.float32), m.faces.astype(np.uint32)))
            for m in found
        ]
        return manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)

    rotor = ("lidar", "alignment", "counterweight", "servo_shaft", "servo_horn", "ring_rotor", "bearing_inner")
    rotor += ("journal_sleeve", "rotor_lead")
    turning = [name for name in built.meshes if name.startswith(rotor)]
    standing = [name for name in built.meshes if name not in turning]
    still = body(standing)
    for turn in (20.0, 90.0, 135.0, 250.0):
        assert (still ^ body(turning, turn)).volume() < 0.05, turn


def test_everything_stands_clear_of_the_deck(built):
    hangs = built.R_world[2, 2] < -1e-6
    height = {}
    for name, mesh in built.meshes.items():
        z = (mesh.vertices @ built.R_world.T + built.t_world)[:, 2] * (-1 if hangs else 1)
        height[name] = z.min()
    if "base_mount" not in built.meshes:
        assert built.name == "upright"
        assert height["servo_case"] == pytest.approx(0, abs=1e-3)
        return
    assert height.pop("base_mount") == pytest.approx(0, abs=1e-3)
    lying = [height.pop(name) for name in (SERVO_CABLE, STATOR_LEADS) if name in height]
    assert min(lying, default=np.inf) > FOOT_MM[0]
    assert min(height.values()) > 8
    # the lidar's sphere misses the foot in every position
    radius = max(np.linalg.norm(built.meshes[n].vertices, axis=1).max() for n in built.meshes if n.startswith("lidar"))
    assert built.t_world[2] * (-1 if hangs else 1) - radius > 8


def test_the_deck_holes_surround_the_world_origin(built):
    if "base_mount" not in built.stl:
        pytest.skip("no mount: the axis is upright")
    vertices = built.stl["base_mount"].vertices @ built.R_world.T + built.t_world
    face = vertices[np.abs(vertices[:, 2]) < 1e-3, :2]
    for x, y in itertools.product((40, -40), repeat=2):
        edge = face[np.linalg.norm(face - [x, y], axis=1) < 3.0]
        centre, diameters = circle(edge)
        np.testing.assert_allclose(diameters, 4.4, atol=0.02)
        np.testing.assert_allclose(centre, [x, y], atol=0.01)


def test_the_shaft_fits_the_horn_and_passes_the_ring(built):
    vertices = built.stl["servo_shaft"].vertices
    servo = SETTINGS[built.name][5]
    count, pitch, hole = {"MX-64R": (8, 22.0, 2.9), "AX-12A": (4, 16.0, 2.4)}[servo]
    horn = vertices[:, 2].min()
    rim = vertices[np.abs(vertices[:, 2] - horn) < 1e-3, :2]
    for k in range(count):
        at = (
            pitch / 2 * np.array([np.cos(np.pi / 2 + 2 * np.pi * k / count), np.sin(np.pi / 2 + 2 * np.pi * k / count)])
        )
        centre, diameters = circle(rim[np.linalg.norm(rim - at, axis=1) < hole / 2 + 0.3])
        np.testing.assert_allclose(diameters, hole, atol=0.02)
        np.testing.assert_allclose(centre, at, atol=0.01)
    ring = built.meshes["ring_rotor"].bounds[:, 2]
    inside = vertices[vertices[:, 2] > ring[0]]
    assert np.linalg.norm(inside[:, :2], axis=1).max() == pytest.approx(6.325, abs=1e-3)  # bore 12.7
    hub = built.stl["alignment_linkage"].bounds[0, 2]
    journal = 8.5 if built.name in BEARING else 0.0  # 0.5 above a bearing of 7, 1 below it
    assert inside[:, 2].max() - hub == pytest.approx(11.0, abs=1e-3)
    room = 10.0 if built.name in BEARING else 12.0 + 4.24 / 2 + 0.85  # for the bend of the leads under the hub
    assert hub - journal - ring[1] == pytest.approx(room, abs=1e-3)  # over the collar of the ring


def test_findings_name_what_to_do(built):
    found = {finding.code: finding for finding in built.result.findings}
    assert "aluminium or steel" in found["turn_from_metal"].hint
    assembly = built.result.assembly
    notes = list(unverified_checks(assembly))
    assert any("SNU11-P0210: length_mm = 38.0" in f.message and "measure" in f.hint for f in notes)
    assert "tilt_moment" not in found
    left_out = [out.what for out in built.result.left_out if out.unit == "parts"]
    if built.name == "upright":
        assert left_out == ["servo_frame", "bearing_cage", "base_mount", "counterweight", *MODULES]
        assert "M2.5" in found["servo_on_deck"].hint and "[deck]" in found["servo_on_deck"].hint
    else:
        bearing = [] if built.name in BEARING else ["bearing_cage"]
        assert left_out == ["servo_frame", *bearing] + ([] if built.name in BALANCED else ["counterweight"]) + MODULES
