"""Models of known dimensions, and what `measure` reads from their STEP and STL files."""

import tomllib

import cadquery as cq
import numpy as np
import pytest

from scanwright.cad import solids
from scanwright.cad.geometry.mesh import mesh_of, stl_bytes
from scanwright.cad.measure.bores import bores_of, likely_screws, walls_of
from scanwright.cad.measure.files import measure_files, read_model, turned
from scanwright.cad.measure.proposal import propose, toml_text, window_of
from scanwright.design.catalogue.catalogue import SHIPPED, load_catalogue, load_product
from scanwright.design.errors import SceneError, TaskError

pytestmark = pytest.mark.quick
CORES = {"M2": 1.6, "M2.5": 2.05, "M3": 2.5, "M4": 3.3, "M5": 4.2, "M6": 5.0}


def triangles_of(solid, chord=0.05, angle=0.3):
    mesh = mesh_of(solid, chord, angle)
    return mesh.vertices[mesh.faces]


def random_block(random):
    """A block with holes in five faces, and of each hole mouth, direction out, diameter, depth, and if it is open."""
    half = np.array([30.0, 25.0, 12.0])
    solid = solids.box(tuple(-half), tuple(half))
    holes = []
    for place in random.permutation([(x, y) for x in (-20, 0, 20) for y in (-14, 0, 14)])[:6]:
        x, y = place + random.uniform(-2, 2, 2)
        size = random.choice(list(CORES))
        through, depth = bool(random.random() < 0.3), float(random.uniform(3.0, 8.0))
        diameter = float(size[1:]) + 0.3 if through else CORES[size]
        depth = 2 * half[2] if through else depth
        solid = solid.cut(solids.upright(diameter / 2, -half[2] - 1, -half[2] + depth + (1 if through else 0), x, y))
        holes.append(((x, y, -half[2]), (0, 0, -1), diameter, depth, through))
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
        out = sign * np.eye(3)[axis]
        mouth = out * half + [0, 0, 6.0] + random.uniform(-8, 8) * np.eye(3)[1 - axis]
        depth, diameter = float(random.uniform(2.5, 3.5)), CORES[random.choice(["M2", "M2.5", "M3"])]
        solid = solid.cut(solids.cylinder(diameter / 2, mouth + out, -out, depth + 1))
        holes.append((tuple(mouth), tuple(out), diameter, depth, False))
    return solid, holes


@pytest.mark.parametrize("seed", range(4))
def test_every_hole_of_a_random_block_is_measured(seed):
    solid, holes = random_block(np.random.default_rng(seed))
    triangles = triangles_of(solid)
    bores = bores_of(triangles, walls_of(triangles))
    assert len(bores) == len(holes)
    for mouth, out, diameter, depth, through in holes:
        nearest = min(bores, key=lambda bore: np.linalg.norm(np.subtract(bore.mouth, mouth)))
        np.testing.assert_allclose(nearest.mouth, mouth, atol=2e-3)
        np.testing.assert_allclose(nearest.out, out, atol=1e-5)
        assert nearest.diameter == pytest.approx(diameter, abs=2e-3)
        assert nearest.depth == pytest.approx(depth, abs=2e-3)
        assert bool(nearest.free) == through


def test_an_oblique_hole_and_its_chamfer():
    across = np.array([0.0, -np.sin(0.5), np.cos(0.5)])
    block = solids.box((-20, -20, -20), (20, 20, 20)).moved(solids.location(np.eye(3)))
    tool = solids.cylinder(1.25, across * 30, -across, 18.0).fuse(
        cq.Solid.makeCone(1.25 - 0.5, 2.25, 1.5, solids.vector(across * 19.0), solids.vector(across))
    )
    top = solids.cylinder(8, across * 5, across, 15)
    solid = block.intersect(solids.box((-20, -20, -20), (20, 20, -5))).fuse(top).cut(tool)
    triangles = triangles_of(solid)
    (bore,) = bores_of(triangles, walls_of(triangles))
    np.testing.assert_allclose(bore.out, across, atol=1e-4)
    np.testing.assert_allclose(bore.mouth, across * 20, atol=5e-3)
    assert bore.depth == pytest.approx(8.0, abs=5e-3)
    assert likely_screws(bore) == [("tapped", "M3"), ("tapped", "M2.5")]


def test_a_hole_with_a_counterbore_is_screwed_from_there():
    solid = solids.box((-10, -10, 0), (10, 10, 6)).cut(solids.upright(1.6, -1, 7), solids.upright(3, 3, 7))
    triangles = triangles_of(solid)
    (bore,) = bores_of(triangles, walls_of(triangles))
    assert bore.mouth == (0, 0, 0) and bore.out == (0, 0, -1)
    assert (bore.diameter, bore.depth) == (pytest.approx(3.2, abs=1e-3), pytest.approx(3.0, abs=1e-3))
    assert likely_screws(bore)[0] == ("through", "M3")


def test_a_slot_and_a_covered_hole():
    plate = solids.box((-15, -15, 0), (15, 15, 4)).cut(solids.slot(1.7, (-5, 3), (5, 3), -1, 5))
    cavity = solids.upright(1.25, -30, -10).intersect(solids.box((-9, -9, -25), (9, 9, -15)))
    covered = solids.box((-10, -10, -30), (10, 10, -10)).cut(cavity)
    triangles = np.concatenate([triangles_of(plate), triangles_of(covered)])
    (bore,) = bores_of(triangles, walls_of(triangles))
    assert (bore.diameter, bore.slot) == (pytest.approx(3.4, abs=5e-3), pytest.approx(13.4, abs=0.02))


def lidar():
    """A body off the axis with a step, a round head, ears with holes and threads in the base."""
    solid = solids.box((-32, -25, 0), (25, 25, 30)).fuse(
        solids.upright(20, 29, 50), solids.box((-4, 25, 0), (4, 33, 3)), solids.box((-8, -8, 30), (12, 12, 40))
    )
    holes = [solids.upright(1.25, -1, 6, x, y) for x, y in ((-20, -20), (20, 20))]
    return solid.cut(*holes, solids.upright(1.7, -1, 4, 0, 30))


@pytest.mark.parametrize("suffix", [".step", ".stl"])
def test_a_lidar_from_its_files(tmp_path, suffix):
    model = tmp_path / f"lidar{suffix}"
    if suffix == ".stl":
        model.write_bytes(stl_bytes(mesh_of(lidar(), 0.05, 0.3), "lidar", "0"))
    else:
        cq.exporters.export(cq.Workplane(lidar()), str(model))
    measured = measure_files(model, tmp_path / "mine.toml", "lidar")
    values = measured.proposal.values
    assert values["body_mm"] == pytest.approx([50, 50, 50], abs=0.02)
    np.testing.assert_allclose(values["ears_mm"][0], [[-32, -25, 0], [-25, 25, 30]], atol=0.02)
    np.testing.assert_allclose(values["ears_mm"][1], [[-4, 25, 0], [4, 33, 3]], atol=0.02)
    assert values["window_z_mm"] == pytest.approx([30, 50], abs=0.1)
    assert values["window_radius_mm"] == pytest.approx(20, abs=0.05)
    kinds = {(hole["kind"], hole["size"], *hole["at_mm"]) for hole in values["holes"]}
    assert kinds == {("tapped", "M3", -20, -20, 0), ("tapped", "M3", 20, 20, 0), ("through", "M3", 0, 30, 0)}
    assert (tmp_path / "mine.svg").read_text().count("<svg") == 1


def test_a_proposal_loads_as_a_product_once_the_rest_is_added(tmp_path):
    text = toml_text(propose(triangles_of(lidar()), "lidar"), "my lidar.step", "0" * 64)
    lines = (SHIPPED / "utm-30lx.toml").read_text().splitlines()
    rest = [line for line in lines if f"# {line.partition(' =')[0]} =" in text.splitlines()]
    (tmp_path / "mine.toml").write_text("\n".join([text, *rest]))
    product = load_product(tmp_path / "mine.toml")
    assert product.name == "my lidar"
    assert {"holes", "body_mm", "window_z_mm"} <= set(product.unverified())


def test_a_servo_gives_case_and_horn():
    record = load_catalogue().named("XL430-W250")
    low, high = record.case_min_mm, record.case_max_mm
    solid = solids.box(low, high).fuse(
        solids.upright(record.horn_diameter_mm / 2, -record.horn_thickness_mm - 1, 0), solids.upright(4, -1, 1.9)
    )
    turns = np.radians(45 + 90 * np.arange(4))
    tools = [solids.upright(0.8, -3.5, 1, *(8 * np.array([-np.sin(t), np.cos(t)]))) for t in turns]
    tools += [solids.upright(1.025, high[2] - 3.8, high[2] + 1, x, -8) for x in (-11, 11)]
    values = propose(triangles_of(solid.cut(*tools)), "servo").values
    for field in ("case_min_mm", "case_max_mm", "horn_circle_mm", "horn_diameter_mm", "horn_first_hole_deg"):
        assert values[field] == pytest.approx(getattr(record, field), abs=0.02), field
    assert (values["horn_holes"], values["horn_screw"], values["horn_boss_height_mm"]) == (4, "M2", 1.9)
    front = {hole.at_mm for hole in record.holes if hole.axis == "+z" and hole.kind == "self_tapping"}
    assert {tuple(hole["at_mm"]) for hole in values["holes"]} == front


def test_the_axes_of_a_model_are_turned_to_those_of_the_device():
    lying = triangles_of(lidar())[..., [1, 2, 0]]  # x of the device along z of the model, z along y
    values = propose(turned(lying, "+y", "+z"), "lidar").values
    assert values == propose(triangles_of(lidar()), "lidar").values
    with pytest.raises(SceneError, match="two different axes"):
        turned(lying, "+y", "-y")


def test_a_window_needs_a_round_surface():
    assert window_of(triangles_of(solids.box((0, 0, 0), (10, 10, 10)))) is None


def test_what_is_no_model_is_refused(tmp_path):
    with pytest.raises(SceneError, match="no such file"):
        read_model(tmp_path / "a.step")
    (tmp_path / "a.step").write_text("ISO-10303-21;")
    with pytest.raises(SceneError, match="not a readable STEP"):
        read_model(tmp_path / "a.step")
    (tmp_path / "a.stl").write_bytes(stl_bytes(mesh_of(solids.box((0, 0, 0), (0.06, 0.06, 0.08))), "a", "0"))
    with pytest.raises(SceneError, match="try unit m"):
        read_model(tmp_path / "a.stl")
    assert np.ptp(read_model(tmp_path / "a.stl", "m"), axis=(0, 1)).max() == pytest.approx(80)
    (tmp_path / "mine.toml").write_text("kind = 'lidar'")
    with pytest.raises(TaskError, match="no proposal"):
        measure_files(tmp_path / "a.stl", tmp_path / "mine.toml", "lidar", unit="m")
    assert tomllib.loads((tmp_path / "mine.toml").read_text()) == {"kind": "lidar"}
