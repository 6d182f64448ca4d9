"""Print files: the pose by its rule on shapes whose answer is plain, and 3MF as a strict reader takes it."""

import itertools
import shutil
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from lib3mf import get_wrapper
from scipy.spatial.transform import Rotation

from benchmarks.cad.slicer import PROGRAM, sliced
from scanwright.cad.assembly.print_settings import print_words, slicer_settings
from scanwright.cad.files.plates import plates_of, threemf_bytes
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.geometry.print_pose import on_bed, print_pose
from scanwright.cad.labels.lettering import GLYPHS, text_width
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.products import Printer

SETTINGS = {"layer_height": "0.25", "fill_density": "100%"}
BED = (220.0, 220.0, 250.0)
TABLE = trimesh.boolean.union(
    [
        trimesh.creation.box(bounds=[[-20, -20, 10], [20, 20, 14]]),
        trimesh.creation.box(bounds=[[-3, -3, 0], [3, 3, 12]]),
    ]
)


def mesh(shape):
    return TriMesh(np.asarray(shape.vertices, dtype=float), np.asarray(shape.faces, dtype=np.int64))


def turned(shape, quaternion, shift=(0, 0, 0)):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    T[:3, 3] = shift
    return mesh(shape.copy().apply_transform(T))


quaternions = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)


@given(quaternions, st.tuples(*[st.floats(-50, 50)] * 3))
@settings(max_examples=40, deadline=None)
def test_a_table_is_printed_upside_down_whichever_way_it_was_modelled(quaternion, shift):
    pose = print_pose(turned(TABLE, quaternion, shift), BED)
    assert pose.overhang_mm2 == 0 and pose.support_mm3 == 0 and pose.fits
    assert pose.contact_mm2 == pytest.approx(1600, abs=0.01)
    np.testing.assert_allclose(pose.size_mm, (40, 40, 14), atol=1e-3)
    lying = on_bed(turned(TABLE, quaternion, shift), pose)
    np.testing.assert_allclose(lying.vertices.min(axis=0), (90, 90, 0), atol=1e-3)
    assert lying.volume() == pytest.approx(TABLE.volume, rel=1e-5)  # turned, not mirrored


def split_near_a_corner(triangles, k, gap):
    """Return a closed mesh with one more vertex on the first edge of triangle k, near its first end or beyond it."""
    a, b, c = triangles.faces[k]
    (i,) = (i for i, face in enumerate(triangles.faces) if {a, b} < set(face) and c not in face)
    (d,) = set(triangles.faces[i]) - {a, b}
    at, m = triangles.vertices, len(triangles.vertices)
    middle = at[a] + gap * (at[b] - at[a]) / np.linalg.norm(at[b] - at[a])
    halves = [(a, m, c), (m, b, c), (b, m, d), (m, a, d)]
    return TriMesh(np.vstack([at, middle]), np.vstack([np.delete(triangles.faces, [k, i], axis=0), halves]))


def test_vertices_that_a_file_rounds_to_one_are_one_unless_that_opens_the_surface():
    rng, apart = np.random.default_rng(3), 0
    for splits in (1, 1, 1, 12) * 15:
        close = turned(TABLE, rng.normal(size=4))
        for _ in range(splits):  # with many of them, some are beyond the end of a short edge: merging folds the surface
            close = split_near_a_corner(close, rng.integers(len(close.faces)), 10 ** rng.uniform(-6.5, -4))
        assert close.is_closed()
        lying = on_bed(close, print_pose(close, BED))
        (again,) = plates_of({"a": lying}, BED)[0].values()
        assert lying.is_closed() and again.is_closed()
        for each in (lying, again):
            assert each.volume() == pytest.approx(TABLE.volume, rel=1e-5)
        merged = [len(np.unique(each.vertices, axis=0)) == len(each.vertices) for each in (lying, again)]
        assert all(merged) or splits > 1
        apart += not all(merged)
    assert apart


@pytest.mark.parametrize(
    ("size", "fits"), [((260, 20, 10), True), ((150, 215, 10), True), ((215, 150, 10), True), ((280, 40, 10), False)]
)
def test_a_part_is_turned_on_the_bed_until_it_fits(size, fits):
    bed = (160.0, 220.0, 50.0)
    pose = print_pose(mesh(trimesh.creation.box(size)), bed)
    lying = on_bed(mesh(trimesh.creation.box(size)), pose)
    inside = (lying.vertices.min(axis=0) > -1e-3).all() and (lying.vertices.max(axis=0) < np.add(bed, 1e-3)).all()
    assert pose.fits == inside == fits
    assert np.linalg.det(pose.T_bed_part[:3, :3]) == pytest.approx(1)


def test_support_is_counted_by_area_and_by_column():
    discs = [trimesh.creation.cylinder(10, segment=[[0, 0, z], [0, 0, z + 3]], sections=128) for z in (0, 23)]
    spool = trimesh.boolean.union([*discs, trimesh.creation.cylinder(2, segment=[[0, 0, 1], [0, 0, 25]], sections=128)])
    pose = print_pose(mesh(spool), BED)
    assert abs(pose.T_bed_part[2, 2]) == pytest.approx(1)  # it would roll on its rims
    assert pose.overhang_mm2 == pytest.approx(np.pi * (100 - 4), rel=2e-3)
    assert pose.support_mm3 == pytest.approx(np.pi * (100 - 4) * 23, rel=2e-3)
    assert not print_pose(mesh(spool), (25.0, 25.0, 25.0)).fits  # 20 x 20 x 26
    assert print_pose(mesh(spool), (25.0, 25.0, 26.0)).fits


def test_a_cone_steeper_than_45_degrees_needs_no_support():
    steep = trimesh.creation.cone(radius=10, height=30, sections=64)
    pose = print_pose(mesh(steep), BED)
    assert pose.overhang_mm2 == 0 and pose.T_bed_part[2, 2] == pytest.approx(1)


def hourglass(half_height):
    """Two cones tip to tip, cut off at a waist of radius 2: its upper half leans out by atan(8 / half_height)."""
    h = half_height
    return trimesh.creation.revolve([[0, 0], [10, 0], [2, h], [10, 2 * h], [0, 2 * h]], sections=128)


@pytest.mark.parametrize(("half_height", "needs_support"), [(8.3, False), (7.7, True)])  # 43.9 and 46.1 deg
def test_45_degrees_out_of_the_vertical_is_the_limit(half_height, needs_support):
    pose = print_pose(mesh(hourglass(half_height)), BED)
    cone = np.pi * 12 * np.hypot(8, half_height)
    assert pose.overhang_mm2 == pytest.approx(cone if needs_support else 0, rel=2e-3)


def test_a_part_without_a_flat_still_gets_a_pose():
    pose = print_pose(mesh(trimesh.creation.icosphere(subdivisions=2, radius=20)), BED)
    assert pose.fits and pose.size_mm[2] == pytest.approx(40, abs=1.5)


def test_the_longer_side_lies_along_x_and_decides_whether_it_fits():
    bar = trimesh.creation.box(extents=(20, 20, 200))
    pose = print_pose(turned(bar, (0.3, 0.4, 0.5, 0.6)), (210.0, 30.0, 30.0))
    assert pose.fits
    np.testing.assert_allclose(pose.size_mm, (200, 20, 20), atol=1e-6)


def test_every_printed_part_has_a_file_that_a_strict_reader_takes(made):
    printed = {f"print/{file.name}" for file in (made.folder / "print").glob("*.3mf") if "plate" not in file.name}
    names = {part.name for part in made.result.parts} - {"servo_shaft", "journal_sleeve", "counterweight"} | {
        "fit_coupon"
    }
    assert printed == {f"print/{name}.3mf" for name in names}
    assert ("print/servo_shaft.3mf", "of metal: made after its STEP file") in {
        (entry.what, entry.why) for entry in made.exports[1]
    }
    for file in printed:
        model = get_wrapper().CreateModel()
        reader = model.QueryReader("3mf")
        reader.SetStrictModeActive(True)
        reader.ReadFromFile(str(made.folder / file))
        assert reader.GetWarningCount() == 0
        assert model.GetBuildItems().Count() == 1
        objects = model.GetMeshObjects()
        assert objects.MoveNext()
        part = objects.GetCurrentMeshObject()
        assert part.IsManifoldAndOriented() and f"print/{part.GetName()}.3mf" == file
        vertices = np.array([tuple(v.Coordinates) for v in part.GetVertices()])
        faces = np.array([tuple(t.Indices) for t in part.GetTriangleIndices()])
        read = trimesh.Trimesh(vertices, faces, process=False)
        if part.GetName() in made.result.meshes:
            assert read.volume == pytest.approx(made.result.meshes[part.GetName()].volume(), rel=1e-4)
        assert read.bounds[0, 2] == 0
        assert (read.bounds[0] >= 0).all() and (read.bounds[1] <= BED).all()
        assert (read.face_normals[read.triangles_center[:, 2] < 1e-3][:, 2] < -0.999).all()  # a flat lies on the bed


def test_a_slicer_takes_a_print_file_without_repair(made):
    """All of a build: `python -m benchmarks.cad.slicer OUT`."""
    if shutil.which(PROGRAM) is None:
        pytest.skip(f"{PROGRAM} is not installed (apt-get install prusa-slicer): print files are not sliced")
    found = sliced(made.folder / "print" / "slip_ring_adapter.3mf")
    assert found.closed
    assert found.volume_mm3 == pytest.approx(made.result.meshes["slip_ring_adapter"].volume(), rel=1e-3)
    assert found.height_mm == pytest.approx(found.size_mm[2], abs=0.3)  # a layer of its own choice
    assert found.layer_mm == made.scanner.printer.layer_mm  # it read its settings


def test_a_slicer_is_believed_because_it_sees_a_hole(tmp_path):
    if shutil.which(PROGRAM) is None:
        pytest.skip(f"{PROGRAM} is not installed (apt-get install prusa-slicer): print files are not sliced")
    open_box = trimesh.creation.box(extents=(20, 20, 20))
    open_box.update_faces(np.arange(len(open_box.faces)) > 0)
    (tmp_path / "open.3mf").write_bytes(
        threemf_bytes({"open": mesh(open_box)}, "open", "a box that lacks a triangle", {})
    )
    assert not sliced(tmp_path / "open.3mf").closed


def test_a_slicer_is_told_of_every_part_how_it_is_printed(made):
    printer = made.scanner.printer
    said = slicer_settings(printer)
    assert said["layer_height"] == f"{printer.layer_mm:g}" and said["fill_density"] == "100%"
    assert {said[key] for key in said if key.endswith("extrusion_width")} == {f"{printer.line_mm:g}"}
    with zipfile.ZipFile(made.folder / "print" / "plate_1.3mf") as package:
        model, config = (package.read(name) for name in ("3D/3dmodel.model", "Metadata/Slic3r_PE_model.config"))
    core = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
    parts = ElementTree.fromstring(model).iter(f"{core}object")
    told = {each.get("id"): each for each in ElementTree.fromstring(config).iter("object")}
    for part in parts:
        keys = {each.get("key"): each.get("value") for each in told[part.get("id")].findall("metadata")}
        assert keys == {"name": part.get("name"), **said}
        (volume,) = told[part.get("id")].findall("volume")
        count = len(part.findall(f".//{core}triangle"))
        assert (volume.get("firstid"), volume.get("lastid")) == ("0", str(count - 1))


def test_what_lays_no_filament_has_no_lines():
    resin = load_catalogue().get("sla", Printer)
    assert slicer_settings(resin) == {} and print_words(resin) == "solid"


def test_the_zip_holds_no_date_and_no_platform(tmp_path):
    data = threemf_bytes({"a <part>": mesh(TABLE)}, "a <part>", 'of "x" & y', SETTINGS)
    assert data == threemf_bytes({"a <part>": mesh(TABLE)}, "a <part>", 'of "x" & y', SETTINGS)
    (tmp_path / "a.3mf").write_bytes(data)
    for entry in zipfile.ZipFile(tmp_path / "a.3mf").infolist():
        assert entry.date_time == (1980, 1, 1, 0, 0, 0)
        assert (entry.create_system, entry.compress_type) == (3, zipfile.ZIP_STORED)


def test_the_coupon_has_the_clearances_that_it_says(made):
    coupon = trimesh.load(made.folder / "print" / "fit_coupon.3mf").to_mesh()
    assert coupon.is_watertight
    section, _ = coupon.section(plane_origin=[0, 0, 0.9], plane_normal=[0, 0, 1]).to_2D()
    diameters = sorted(np.ptp(loop[:, 0]) for loop in section.discrete if len(loop) > 20)
    printer, shaft = made.scanner.printer, made.result.assembly.layout.stack.shaft_diameter
    assert (printer.fit_clearance_mm, printer.screw_clearance_mm) == (0.2, 0.4)
    expected = [nominal + c for nominal in (2.5, 3.0) for c in (0.2, 0.3, 0.4, 0.5, 0.6)]
    expected += [shaft + c for c in (0.0, 0.1, 0.2, 0.3, 0.4)]
    np.testing.assert_allclose(diameters, sorted(expected), atol=0.02)
    top = coupon.section(plane_origin=[0, 0, 1.7], plane_normal=[0, 0, 1])
    assert len(top.discrete) > len(section.discrete) + 15  # the lettering
    assert coupon.volume < 3500  # a slicer takes half an hour for it


def test_every_glyph_stays_on_its_grid_and_moves_with_every_stroke():
    for chains in GLYPHS.values():
        for chain in chains.split():
            points = [(int(x), int(y)) for x, y in zip(chain[::2], chain[1::2], strict=True)]
            assert len(points) > 1 and all(0 <= x <= 4 and 0 <= y <= 6 for x, y in points)
            assert all(a != b for a, b in itertools.pairwise(points))
    assert text_width("AB", 6.0) == 10.0 and text_width("", 6.0) == 0.0
