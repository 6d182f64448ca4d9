"""`assembly.glb` and `exploded.glb`: facts of the glTF 2.0 schema, and the scanner read back by trimesh."""

import itertools
import json
import struct

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from scanwright.cad.files.glb import shaded
from scanwright.cad.geometry.mesh import TriMesh

SIZE = {5123: ("<u2", 2), 5125: ("<u4", 4), 5126: ("<f4", 4)}
WIDTH = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
BOUGHT = ("servo_case", "servo_horn", "ring_", "lidar_", "bearing_inner", "bearing_outer")
TO_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def chunks(path):
    data = path.read_bytes()
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack("<I4s", data[12:20])
    assert kind == b"JSON" and size % 4 == 0
    binary, kind = struct.unpack("<I4s", data[20 + size : 28 + size])
    assert kind == b"BIN\0" and binary % 4 == 0 and 28 + size + binary == len(data)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def values(gltf, binary, accessor):
    entry = gltf["accessors"][accessor]
    view = gltf["bufferViews"][entry["bufferView"]]
    kind, size = SIZE[entry["componentType"]]
    width = WIDTH[entry["type"]]
    assert view["byteLength"] == entry["count"] * size * width
    assert view["byteOffset"] % 4 == 0 and view["byteOffset"] + view["byteLength"] <= len(binary)
    raw = np.frombuffer(binary, kind, entry["count"] * width, view["byteOffset"])
    return raw.reshape(entry["count"], width)


@pytest.fixture(params=["assembly", "exploded"])
def scene(request, made):
    return request.param, *chunks(made.folder / f"{request.param}.glb")


def test_every_reference_and_every_bound_is_true(scene):
    _, gltf, binary = scene
    assert gltf["asset"]["version"] == "2.0"
    assert gltf["buffers"] == [{"byteLength": len(binary)}]
    children = [child for node in gltf["nodes"] for child in node.get("children", [])]
    assert sorted([*children, *gltf["scenes"][0]["nodes"]]) == list(range(len(gltf["nodes"])))  # one tree
    names = [node["name"] for node in gltf["nodes"]]
    assert len(set(names)) == len(names)
    for node in gltf["nodes"]:
        assert not {"rotation", "translation"} & node.keys() or "matrix" not in node
        if "matrix" in node:
            T = np.reshape(node["matrix"], (4, 4)).T
            np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-9)
            np.testing.assert_array_equal(T[3], [0, 0, 0, 1])
    assert sorted(node["mesh"] for node in gltf["nodes"] if "mesh" in node) == list(range(len(gltf["meshes"])))
    for mesh in gltf["meshes"]:
        (primitive,) = mesh["primitives"]
        points = values(gltf, binary, primitive["attributes"]["POSITION"])
        facts = gltf["accessors"][primitive["attributes"]["POSITION"]]
        np.testing.assert_array_equal(points.min(axis=0), np.float32(facts["min"]))
        np.testing.assert_array_equal(points.max(axis=0), np.float32(facts["max"]))
        normals = values(gltf, binary, primitive["attributes"]["NORMAL"])
        assert normals.shape == points.shape
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=3e-4)
        corners = values(gltf, binary, primitive["indices"])
        assert corners.min() == 0 and corners.max() == len(points) - 1 and len(corners) % 3 == 0
        colour = gltf["materials"][primitive["material"]]["pbrMetallicRoughness"]["baseColorFactor"]
        assert len(colour) == 4 and all(0 <= c <= 1 for c in colour)


def canonical(body):
    return TriMesh(np.asarray(body.vertices, float), np.asarray(body.faces))


def test_a_ball_is_shaded_round_and_a_box_sharp():
    """The normals of the bodies that the meshes stand for, not those of their facets."""
    vertices, normals, corners = shaded(canonical(trimesh.creation.icosphere(3, 10)))
    assert len(vertices) == 642 and len(corners) == 3 * 1280
    assert np.degrees(np.arccos(np.clip((vertices / 10 * normals).sum(axis=1), -1, 1))).max() < 1.5
    vertices, normals, _ = shaded(canonical(trimesh.creation.box((10, 20, 30))))
    assert len(vertices) == 24
    np.testing.assert_array_equal(np.abs(normals).sum(axis=1), 1)  # along an axis each, outwards
    assert ((vertices * normals).sum(axis=1) > 0).all()
    vertices, normals, corners = shaded(canonical(trimesh.creation.cylinder(10, 30, sections=63)))
    round_about = np.abs(normals[:, 2]) < 0.5
    outwards = vertices[round_about] * [0.1, 0.1, 0]
    np.testing.assert_allclose(normals[round_about], outwards, atol=0.02)  # facets alone would be off by 0.05
    assert round_about.sum() == 126 and len(vertices) == 126 + 128


def test_the_bodies_are_the_parts_in_metres_where_the_frame_chain_puts_them(made):
    read = trimesh.load(made.folder / "assembly.glb")
    T = made.scanner.angles.T_world_rot(0.0)
    for part in made.result.parts:
        stl = trimesh.load(made.folder / "parts" / f"{part.name}.stl")
        pose, name = read.graph[part.name]
        body = read.geometry[name].copy().apply_transform(pose)
        assert body.volume == pytest.approx(stl.volume * 1e-9, rel=1e-5)
        expected = (stl.vertices / 1000) @ T[:3, :3].T + T[:3, 3]
        expected = expected @ TO_Y_UP.T
        np.testing.assert_allclose(body.bounds, [expected.min(axis=0), expected.max(axis=0)], atol=1e-6)


def test_the_window_is_at_the_optical_centre_and_looks_along_the_angles(made):
    read = trimesh.load(made.folder / "assembly.glb")
    pose, name = read.graph["lidar_window"]
    T = made.scanner.angles.T_world_laser(0.0)
    centre = (pose @ [*read.geometry[name].center_mass, 1])[:3]
    np.testing.assert_allclose(centre, TO_Y_UP @ T[:3, 3], atol=1e-6)
    np.testing.assert_allclose(pose[:3, :3], TO_Y_UP @ T[:3, :3], atol=1e-6)


def test_bodies_hang_under_the_frame_that_moves_them(scene):
    _, gltf, _ = scene
    nodes = {node["name"]: node for node in gltf["nodes"]}
    under = {frame: {gltf["nodes"][child]["name"] for child in nodes[frame]["children"]} for frame in ("servo", "rot")}
    assert {"servo_case", "ring_stator", "slip_ring_adapter", "base_mount", "rot"} <= under["servo"]
    assert {"servo_horn", "ring_rotor", "servo_shaft", "alignment_linkage", "laser"} <= under["rot"]
    assert {gltf["nodes"][child]["name"] for child in nodes["world"]["children"]} == {"servo"}


def test_it_turns_once_per_period_counter_clockwise_about_the_axis(made):
    gltf, binary = chunks(made.folder / "assembly.glb")
    (animation,) = gltf["animations"]
    (channel,), (sampler,) = animation["channels"], animation["samplers"]
    assert gltf["nodes"][channel["target"]["node"]]["name"] == "rot"
    assert "matrix" not in gltf["nodes"][channel["target"]["node"]]
    times = values(gltf, binary, sampler["input"]).ravel()
    turns = Rotation.from_quat(values(gltf, binary, sampler["output"]))
    np.testing.assert_allclose(times, np.arange(5) * 4.5)
    np.testing.assert_allclose((turns[:-1].inv() * turns[1:]).as_rotvec(), [[0, 0, np.pi / 2]] * 4, atol=1e-6)


def test_the_printed_orange_is_written_as_linear_colour(made):
    gltf, _ = chunks(made.folder / "assembly.glb")
    mesh = next(mesh for mesh in gltf["meshes"] if mesh["name"] == "alignment_linkage")
    colour = gltf["materials"][mesh["primitives"][0]["material"]]["pbrMetallicRoughness"]["baseColorFactor"]
    np.testing.assert_allclose(np.array(colour[:3]) ** (1 / 2.2), (0.93, 0.45, 0.10), atol=0.04)  # sRGB is near 2.2


def test_pulled_apart_nothing_overlaps_along_the_axis_and_the_lidar_is_off_its_seat(made):
    read = trimesh.load(made.folder / "exploded.glb")
    axis = TO_Y_UP @ made.scanner.angles.axis_world()
    heights = {}
    for node in read.graph.nodes_geometry:
        pose, name = read.graph[node]
        along = trimesh.transform_points(read.geometry[name].vertices, pose) @ axis
        product = node.split("_")[0] if node.startswith(BOUGHT) else node
        low, high = heights.get(product, (np.inf, -np.inf))
        heights[product] = min(low, along.min()), max(high, along.max())
    lidar = heights.pop("lidar")
    heights.pop("counterweight", None)  # it leaves its ear along the radius
    for cable in ("servo_cable", "stator_leads"):  # they stay where they run, at the mount
        heights.pop(cable)
    spans = sorted(heights.values())
    assert all(high < low for (_, high), (low, _) in itertools.pairwise(spans))
    assert max(lidar) > spans[-1][1]
    normal = TO_Y_UP @ made.scanner.angles.T_world_laser(0.0)[:3, 2]
    seat, body = (
        trimesh.transform_points(read.geometry[read.graph[node][1]].vertices, read.graph[node][0]) @ normal
        for node in ("alignment_linkage", "lidar_body")
    )
    assert body.min() > seat.max()
