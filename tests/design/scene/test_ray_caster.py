"""The ray caster: an analytic room, an obvious oracle on triangle soup, real meshes, and one line per broken file.

What finds the triangle is embree or an R-tree: both stand the same tests, and agree on real meshes.
"""

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from scanwright.design import frames
from scanwright.design.errors import SceneError
from scanwright.design.scene.nearest import by_boxes, by_embree
from scanwright.design.scene.ray_caster import Scene, build_scene, cast, load_scene, load_triangles

seeds = st.integers(0, 2**32 - 1)
each_search = pytest.mark.parametrize("search", [by_embree, by_boxes])


def searched(search, scene):
    return Scene(scene.triangles_m, scene.normals, scene.origin_m, search(scene.triangles_m - scene.origin_m))


def box_triangles(half, centre=(0, 0, 0)):
    return np.array(trimesh.creation.box(extents=2 * np.asarray(half, float)).triangles) + np.asarray(centre, float)


def unit_vectors(rng, count):
    direction = rng.normal(size=(count, 3))
    return direction / np.linalg.norm(direction, axis=1)[:, None]


def walls_of_a_room(half, origins, directions):
    """Range and incidence from inside a box about 0, and how far the hit is from its nearest edge."""
    to_wall = (np.sign(directions) * half - origins) / directions
    wall = np.argmin(to_wall, axis=1)
    rows = np.arange(len(wall))
    hit = origins + to_wall[rows, wall][:, None] * directions
    to_edge = half - np.abs(hit)
    to_edge[rows, wall] = np.inf
    return to_wall[rows, wall], np.arccos(np.abs(directions[rows, wall])), to_edge.min(axis=1)


@each_search
@settings(max_examples=50, deadline=None)
@given(
    half=st.tuples(*[st.floats(0.1, 30)] * 3),
    centre=st.tuples(*[st.floats(-1000, 1000)] * 3),
    scale=st.sampled_from([1e-3, 1.0, 1e3]),
    seed=seeds,
)
def test_in_a_room_every_beam_has_the_analytic_range(search, half, centre, scale, seed):
    half, centre = np.array(half) * scale, np.array(centre) * scale
    rng = np.random.default_rng(seed)
    directions, origins = unit_vectors(rng, 500), rng.uniform(-0.99, 0.99, (500, 3)) * half
    found = cast(searched(search, build_scene(box_triangles(half, centre))), origins + centre, directions)
    range_m, incidence_rad, to_edge = walls_of_a_room(half, origins, directions)
    clear = to_edge > 1e-6 * half.max()
    # double precision of coordinates as large as the centre
    np.testing.assert_allclose(found.range_m[clear], range_m[clear], rtol=1e-9, atol=1e-9 * scale)
    np.testing.assert_allclose(found.incidence_rad[clear], incidence_rad[clear], atol=1e-6)
    np.testing.assert_allclose(found.range_m[~clear], range_m[~clear], rtol=1e-4)


def nearest_triangle(triangles, origin, direction):
    """Moeller and Trumbore, one ray against all triangles: range and row of the nearest, and the smallest margin."""
    a, b, c = triangles.transpose(1, 0, 2)
    across = np.cross(direction, c - a)
    det = np.einsum("ij,ij->i", b - a, across)
    u = np.einsum("ij,ij->i", origin - a, across) / det
    over = np.cross(origin - a, b - a)
    v = over @ direction / det
    t = np.einsum("ij,ij->i", over, c - a) / det
    inside = np.minimum(np.minimum(u, v), 1 - u - v)
    t = np.where((inside >= 0) & (t > 0), t, np.inf)
    return t.min(), int(t.argmin()) if np.isfinite(t).any() else -1, np.abs(inside).min()


@each_search
@settings(max_examples=10, deadline=None)
@given(seed=seeds)
def test_in_triangle_soup_it_finds_what_an_obvious_search_finds(search, seed):
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-1, 1, (40, 1, 3)) * 5 + rng.normal(size=(40, 3, 3))
    origins, directions = rng.uniform(-5, 5, (100, 3)), unit_vectors(rng, 100)
    found = cast(searched(search, build_scene(triangles)), origins, directions)
    for ray, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        range_m, triangle, margin = nearest_triangle(triangles, origin, direction)
        if margin > 1e-4:  # away from every edge
            assert found.triangle[ray] == triangle
            assert found.range_m[ray] == pytest.approx(range_m, rel=1e-9)


@each_search
def test_what_hits_nothing_says_so(search):
    found = cast(searched(search, build_scene(box_triangles((1, 1, 1)))), (5, 0, 0), [[1.0, 0, 0], [-1, 0, 0]])
    assert found.range_m.tolist() == [np.inf, 4.0]
    assert found.triangle[0] == -1
    assert np.isnan(found.incidence_rad[0])
    assert found.incidence_rad[1] == 0


def test_more_rays_than_a_batch_are_the_same_rays():
    scene = build_scene(box_triangles((5, 4, 1.5)))
    directions = unit_vectors(np.random.default_rng(0), 300_000)
    whole = cast(scene, np.zeros(3), directions)
    part = cast(scene, np.zeros(3), directions[131_000:131_200])
    np.testing.assert_array_equal(whole.range_m[131_000:131_200], part.range_m)
    np.testing.assert_array_equal(whole.triangle[131_000:131_200], part.triangle)
    assert np.isfinite(whole.range_m).all()


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".dae", ".glb"])
def test_every_format_holds_the_same_box(tmp_path, suffix):
    path = tmp_path / f"box{suffix}"
    trimesh.creation.box(extents=(1, 2, 3)).export(path)
    found = cast(load_scene(path), np.zeros(3), np.concatenate([np.eye(3), -np.eye(3)]))
    np.testing.assert_allclose(found.range_m, [0.5, 1, 1.5, 0.5, 1, 1.5], rtol=1e-6)


def test_a_mesh_in_millimetres_stands_where_its_pose_says(tmp_path):
    path = tmp_path / "box.stl"
    trimesh.creation.box(extents=(1000, 2000, 3000)).export(path)
    T_world_mesh = frames.rigid(frames.Rz(np.pi / 2), [10, 0, 0])
    corners = load_triangles(path, 0.001, T_world_mesh).reshape(-1, 3)
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], [[9, -0.5, -1.5], [11, 0.5, 1.5]], atol=1e-6)


def test_the_office_has_its_floor_and_its_ceiling(data):
    scene = load_scene(data / "meshes" / "office.dae")
    found = cast(scene, (0.0, 0.0, 1.0), [[0.0, 0, -1], [0, 0, 1]])
    assert len(scene.triangles_m) == 3790
    assert found.range_m[0] == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(scene.normals[found.triangle[0]], [0, 0, 1], atol=1e-6)


@pytest.mark.parametrize(("search", "rays"), [(by_embree, 200_000), (by_boxes, 20_000)])
def test_no_beam_leaves_a_closed_robot(data, search, rays):
    scene = searched(search, load_scene(data / "meshes" / "jackal-base.stl"))
    found = cast(scene, (0.0, 0.15, 0.0), unit_vectors(np.random.default_rng(1), rays))
    assert np.isfinite(found.range_m).all()
    assert found.range_m.max() < 0.4


@each_search
def test_no_beam_slips_through_an_edge_or_a_corner(search):
    ball = trimesh.creation.icosphere(subdivisions=3)
    aims = np.concatenate([ball.vertices, ball.vertices[ball.edges_unique].mean(axis=1)])
    directions = aims / np.linalg.norm(aims, axis=1)[:, None]
    found = cast(searched(search, build_scene(np.array(ball.triangles) + 100)), (100.0, 100.0, 100.0), directions)
    np.testing.assert_allclose(found.range_m, np.linalg.norm(aims, axis=1), atol=1e-6)


def assert_the_searches_agree(scene, origins, directions):
    """Same range and incidence, but for beams near an edge: those are few."""
    first, second = (cast(searched(search, scene), origins, directions) for search in (by_embree, by_boxes))
    with np.errstate(invalid="ignore"):  # inf - inf
        same = np.isclose(first.range_m, second.range_m, rtol=1e-9) & (
            np.isclose(first.incidence_rad, second.incidence_rad, atol=1e-6, equal_nan=True)
        )
    assert np.mean(~same) < 1e-3
    assert np.isfinite(first.range_m).mean() > 0.2


def test_embree_and_boxes_see_the_same_office(data):
    scene = load_scene(data / "meshes" / "office.dae")
    rng = np.random.default_rng(2)
    assert_the_searches_agree(scene, rng.normal((0, 0, 1), 0.3, (10_000, 3)), unit_vectors(rng, 10_000))


def test_embree_and_boxes_see_the_same_among_many_triangles():
    """Enough of them for several steps along a ray, from inside, from outside, and along the axes."""
    ball = np.array(trimesh.creation.icosphere(subdivisions=5).triangles)
    rng = np.random.default_rng(3)
    directions = unit_vectors(rng, 6_000)
    directions[:600] = np.repeat(np.concatenate([np.eye(3), -np.eye(3)]), 100, axis=0)
    scene = build_scene(np.concatenate([ball, ball * 0.3 + (0.4, 0, 0)]))
    assert_the_searches_agree(scene, rng.uniform(-1.5, 1.5, (6_000, 3)), directions)


def test_without_embree_the_boxes_are_searched(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    found = cast(build_scene(box_triangles((5, 4, 1.5))), np.zeros(3), np.eye(3))
    assert found.range_m.tolist() == [5, 4, 1.5]
    assert "by_boxes" in build_scene(box_triangles((1, 1, 1))).nearest.__qualname__


BROKEN = {
    "missing.stl": (None, "no such file"),
    "text.stl": (b"hello, this is no mesh " * 20, "no triangle"),
    "empty.stl": (b"", "no triangle"),
    "points.ply": (
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
        b"end_header\n0 0 0\n",
        "no triangle",
    ),
    "nan.obj": (b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1 of 1 triangles have a corner that is not"),
    "flat.obj": (b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no triangle"),
    "index.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n", "not a readable OBJ mesh"),
    "cut.glb": (b"glTF\0\0\0", "not a readable GLB mesh"),
    "other.dae": (b"<html></html>", "not a readable DAE mesh"),
    "part.step": (b"ISO-10303", "not a mesh by its name"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_mesh_is_one_line(tmp_path, name):
    content, says = BROKEN[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError, match=says) as caught:
        load_scene(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_is_no_mesh(tmp_path):
    (tmp_path / "a.stl").mkdir()
    with pytest.raises(SceneError, match="this is a folder"):
        load_scene(tmp_path / "a.stl")


def test_a_unit_that_the_file_contradicts_is_refused(tmp_path):
    path = tmp_path / "box.glb"
    trimesh.creation.box().export(path)
    with pytest.raises(SceneError, match=r"unit_m = 0.001, but the file states that one unit is 1 m"):
        load_scene(path, 0.001)
    with pytest.raises(SceneError, match="unit_m = 0:"):
        load_scene(path, 0)


def test_who_casts_no_ray_loads_no_mesh_library():
    heavy = "('trimesh', 'embreex', 'rtree')"
    code = f"import sys, scanwright.design.scene.ray_caster; sys.exit(any(m in sys.modules for m in {heavy}))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
