"""The steps of the assembly: what each one shows, and its picture."""

import io
from dataclasses import replace

import numpy as np
import pytest
from lib3mf import get_wrapper
from PIL import Image
from scipy.spatial import ConvexHull

from scanwright.cad.assembly.scenes import scenes_of
from scanwright.cad.files.manual.instructions import picture_name, step_files
from scanwright.cad.files.manual.pictures import SIZE_PX, WORDS_PX, StepPictures
from scanwright.cad.files.plates import EDGE_MM, GAP_MM, plates_of
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.geometry.print_pose import on_bed


@pytest.fixture(scope="module")
def scenes(made):
    assembly = made.result.assembly
    return scenes_of(assembly)


def pixels(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), int)


def coloured(picture):
    """Pixels of the colours of what comes, without the words and the red of its way."""
    seen = picture[:, : SIZE_PX[0] - WORDS_PX]
    orange = (seen[..., 0] > 1.5 * seen[..., 2]) & (seen[..., 1] > 1.5 * seen[..., 2])
    return (orange | (seen[..., 2] > 1.5 * seen[..., 0])) & (seen.max(axis=-1) > 60)  # few colours: black is bluish


def test_a_step_shows_what_earlier_ones_left_and_the_last_one_all(scenes, made):
    assembly = made.result.assembly
    every = {*assembly.made, *assembly.bought}
    assert {*scenes[-1].there, *scenes[-1].comes} == every
    assert sum(len(scene.joints) for scene in scenes) == len(assembly.layout.joints)
    known = set()
    for scene in scenes:
        assert scene.comes and not {*scene.there} & {*scene.comes}
        carried = {body for joint, _ in scene.joints for body in (joint.part, joint.onto)} | {scene.thing}
        assert {*scene.there} - known <= carried  # what nobody has brought yet is what this step works on
        known |= {*scene.there, *scene.comes}


def test_the_lidar_goes_onto_its_seat_on_the_bench_and_comes_with_the_linkage(scenes):
    by_thing = {scene.thing: scene for scene in scenes}
    assert by_thing["lidar"].there == ("alignment_linkage",)
    assert "lidar_body" in by_thing["alignment_linkage"].comes
    assert "servo_shaft" in by_thing["alignment_linkage"].there
    assert by_thing["base_mount"].there == ("base_mount",) and "servo_case" in by_thing["base_mount"].comes


def test_what_comes_is_coloured_and_stands_where_it_comes_from(scenes, made):
    assembly = made.result.assembly
    pictures = StepPictures(assembly.meshes(), frozenset(assembly.made))
    scene = next(scene for scene in scenes if scene.thing == "ring")
    picture = pixels(pictures.picture(scene, [], scenes[: scenes.index(scene)]))
    assert picture.shape == (SIZE_PX[1], SIZE_PX[0], 3)
    rows, _ = np.nonzero(coloured(picture))
    seen = picture[:, : SIZE_PX[0] - WORDS_PX]
    grey = (np.ptp(seen, axis=2) < 12) & (seen.max(axis=2) < 240)
    assert rows.mean() < np.nonzero(grey)[0].mean() - 50  # the ring above the shaft, which is not hidden by it
    assert np.ptp(rows) < SIZE_PX[1] / 2 and len(rows) > 1000


def test_what_is_new_is_coloured_and_earlier_screws_stay(scenes, made):
    assembly = made.result.assembly
    pictures = StepPictures(assembly.meshes(), frozenset(assembly.made))
    by_thing = {scene.thing: (scene, scenes[: scenes.index(scene)]) for scene in scenes}
    seat, before = by_thing["lidar"]
    known = [*before, replace(seat, comes=(), joints=())]  # as if the linkage had been there before
    torques = [""] * len(seat.joints)
    fresh, grey = (coloured(pixels(pictures.picture(seat, torques, steps))) for steps in (before, known))
    assert fresh.sum() > grey.sum() + 1000
    ring, before = by_thing["ring"]
    bare = [replace(step, joints=()) for step in before]
    held, loose = (pixels(pictures.picture(ring, [], steps)) for steps in (before, bare))
    assert (np.abs(held - loose).max(axis=-1) > 40).sum() > 100


def test_every_step_has_its_picture_in_the_folder_and_the_same_bytes_again(scenes, made):
    assembly = made.result.assembly
    text = (made.folder / "assembly.md").read_text(encoding="utf-8")
    again = step_files(assembly, made.result.meshes, [])
    for number, scene in enumerate(scenes, start=1):
        name = picture_name(number)
        assert f"]({name})" in text and scene.step.check in text
        assert (made.folder / name).read_bytes() == again[name]
    assert text.count("Before you go on: ") == len(scenes)


BED = (220.0, 220.0, 250.0)


def block(*size):
    corners = np.array([[x, y, z] for x in (0, size[0]) for y in (0, size[1]) for z in (0, size[2])], float)
    return TriMesh(corners + np.array([3.0, 4.0, 0.0]), ConvexHull(corners).simplices.astype(np.int64))


def test_parts_share_plates_without_meeting_and_in_their_own_pose():
    sizes = {"long": (180, 60, 20), "flat": (100, 100, 5), "deep": (90, 120, 40), "small": (20, 20, 80)}
    printed = {name: block(*size) for name, size in sizes.items()}
    plates = plates_of(printed, BED)
    assert sorted(name for plate in plates for name in plate) == sorted(sizes) and len(plates) == 1
    boxes = {name: (mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)) for name, mesh in plates[0].items()}
    for name, (low, high) in boxes.items():
        np.testing.assert_allclose(high - low, sizes[name])
        np.testing.assert_allclose(plates[0][name].vertices - low, printed[name].vertices - [3, 4, 0])
        assert (low[:2] >= EDGE_MM).all() and (high[:2] <= np.array(BED[:2]) - EDGE_MM).all() and low[2] == 0
        for other, (first, last) in boxes.items():
            apart = np.maximum(first - high, low - last)[:2]
            assert other == name or apart.max() >= GAP_MM - 1e-6


def test_what_finds_no_room_gets_a_plate_of_its_own():
    printed = {name: block(150, 120, 20) for name in "abc"}
    assert [list(plate) for plate in plates_of(printed, BED)] == [["a"], ["b"], ["c"]]


def test_alone_and_on_a_plate_a_part_lies_in_the_one_pose_of_its_assembly(made):
    assembly = made.result.assembly
    seen = []
    first = {made.folder / f"print/{name}.3mf" for name in ("fit_coupon", "test_plate")}
    for file in sorted({*made.folder.glob("print/*.3mf")} - first):
        model = get_wrapper().CreateModel()
        reader = model.QueryReader("3mf")
        reader.SetStrictModeActive(True)
        reader.ReadFromFile(str(file))
        assert reader.GetWarningCount() == 0
        objects = model.GetMeshObjects()
        while objects.MoveNext():
            part = objects.GetCurrentMeshObject()
            points = np.array([tuple(v.Coordinates) for v in part.GetVertices()])
            pose, mesh = assembly.print_pose(part.GetName()), made.result.meshes[part.GetName()]
            assert pose is assembly.print_pose(part.GetName())
            shift = points.min(axis=0) - on_bed(mesh, pose).vertices.min(axis=0)
            assert shift[2] == pytest.approx(0, abs=1e-4)
            np.testing.assert_allclose(points, on_bed(mesh, pose).vertices + shift, atol=2e-4)
            seen.append(part.GetName())
        assert model.GetBuildItems().Count() == model.GetMeshObjects().Count()
    assert sorted(seen) == sorted(2 * [name for name in assembly.made if name not in assembly.metal()])
