"""`report.html`: made of the files alone, whole, the same bytes again, nothing fetched, nothing smuggled in."""

import html
import io
import itertools
import json
import re
import shutil
from base64 import b64decode
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import colormaps
from matplotlib.figure import Figure
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from design.angles import STANDARD_DEG, Angles, AngleSet
from design.evaluation.picture_files import save_picture
from design.frames import R_world_rot
from design.left_out import LeftOut
from design.motion import Sweep
from design.objective.problem import NODES, problem_of
from design.objective.score import quick_J, score
from design.shadow import AXIS_STEPS, Shadow, own_body_bytes
from design.task.task import Limits, load_task
from scanwright.pipeline import records as writer
from scanwright.pipeline.manifest import is_current, read_manifest, write_json, write_manifest
from scanwright.pipeline.records import write_report
from scanwright.report import page as report_page
from scanwright.report.answer import answer, hidden_by, problem_as_built
from scanwright.report.assembly_steps import steps_html
from scanwright.report.check_pictures import CheckPictures, PlacedBody, bodies_named
from scanwright.report.density_sphere import SHADES, STEP_DEG, density_sphere
from scanwright.report.landscapes import other_mounts
from scanwright.report.page import report_html
from scanwright.report.scanner_scene import load_glb, placed_bodies, scanner_scene

SECTIONS = [
    "answer",
    "scanner",
    "density",
    "settings",
    "error",
    "checks",
    "bom",
    "steps",
    "wiring",
    "drawings",
    "files",
    "left-out",
    "again",
]
PAGE = Path(report_page.__file__).parent
CODE = [PAGE / name for name in ("page.js", "webgl.js", "scanner.js", "sphere.js")]
VOID = {"meta", "link", "img", "input", "br"}
Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
EVIL = "</script><script>alert(1)</script>"
ROLLING = Angles(
    **dict(zip(("alpha_rot", "beta_rot", "alpha_laser", "beta_laser"), STANDARD_DEG["rolling"], strict=True))
)
ALPHA, BETA = (angle.ravel() for angle in np.meshgrid(np.arange(-180, 181, 15), np.arange(-90, 91, 15)))
AXES = np.stack([ALPHA, BETA, -4 + ((ALPHA - 60) / 90) ** 2 + ((BETA - 30) / 60) ** 2], axis=1)
ANGLES = AngleSet(
    task="ground_ahead",
    angles_deg=ROLLING,
    t_world_rot_mm=(10.0, 20.0, 300.0),
    sensor="UTM-30LX",
    servo="MX-64R",
    slip_ring="UH1256-02-0610-06S",
    motion={"mode": "spin", "period_s": 18.0},
    J=-5.7636,
    J_error=5e-4,
)


class Page(HTMLParser):
    """Text by section, ids, links, and scripts of a page whose tags must match."""

    def __init__(self, text):
        super().__init__()
        self.open, self.ids, self.links, self.scripts = [], [], [], 0
        self.text = {}
        self.section = ""
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attributes):
        facts = dict(attributes)
        self.ids += [facts["id"]] if "id" in facts else []
        self.links += [facts[key] for key in ("src", "href", "srcset", "action", "data", "poster") if key in facts]
        self.scripts += tag == "script"
        self.section = facts["id"] if tag == "section" else self.section
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] not in (["script"], ["style"]):
            self.text[self.section] = self.text.get(self.section, "") + data


def own_body(beams=1081):
    stator = np.zeros((beams, AXIS_STEPS), bool)
    stator[500:600, :180] = True
    return Shadow(np.arange(beams) < 100, stator), np.linspace(-2.3, 2.3, beams)


def glb(place):
    """A box that stands still and one that turns, as glTF has it: y up."""
    scene = trimesh.Scene()
    scene.graph.update("servo", matrix=Y_UP @ ANGLES.T_world_rot(0.0))
    scene.graph.update("rot", "servo", matrix=np.eye(4))
    scene.graph.update("laser", "rot", matrix=ANGLES.T_rot_laser())
    for name, parent in (("base_mount", "servo"), ("lidar_body", "laser")):
        T = trimesh.transformations.translation_matrix(place[name])
        box = trimesh.creation.box((0.02, 0.04, 0.06))
        box.visual = TextureVisuals(material=PBRMaterial(baseColorFactor=[0.5, 0.0, 1.0, 1.0]))
        scene.add_geometry(box, name, name, parent, T)
    return scene.export(file_type="glb")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A build folder with every file that the report reads, by the writers of a build where they need no kernel."""
    folder = tmp_path_factory.mktemp("builds") / "ground_ahead"
    folder.mkdir()
    loaded = load_task(Path("ground_ahead"))
    (folder / "angles.json").write_text(ANGLES.to_json())
    writer.write_task(folder, loaded)
    a, b = (angle.ravel() for angle in np.meshgrid(np.arange(-90, 91, 45), np.arange(-90, 91, 45)))
    planes = np.stack([a, b, -5 + ((a - 45) ** 2 + (b + 90) ** 2) / 1e4, 0 * a, 90 + 0 * a], axis=1)
    header = "alpha_laser_deg,beta_laser_deg,J,alpha_rot_deg,beta_rot_deg"
    np.savetxt(folder / "search.csv", planes, "%.5g", ",", header=header, comments="")
    np.savetxt(folder / "axes.csv", AXES, "%.5g", ",", header="alpha_rot_deg,beta_rot_deg,J", comments="")
    writer.write_left_out(folder, [LeftOut("masked directions", EVIL, 12345, "square degrees")])
    save_picture(Figure(figsize=(1, 1)), folder / "density.png")
    (folder / "own_body.npz").write_bytes(own_body_bytes(*own_body()))
    apart = {"base_mount": (0, 0, -0.1), "lidar_body": (0, 0, 0.2)}
    (folder / "assembly.glb").write_bytes(glb(dict.fromkeys(apart, (0, 0, -0.1))))
    (folder / "exploded.glb").write_bytes(glb(apart))
    places = {"pass": "rotor", "note": "fdm-0.4", "warning": "base_mount", "error": "base_mount and lidar_body"}
    checks = [
        {"severity": s, "message": f"{s} of {EVIL}", "where": places[s]}
        for s in ("pass", "note", "warning", "error", "pass")
    ]
    write_json(folder / "checks.json", {"schema": "scanwright/checks/1", "checks": checks})
    rows = ["bought,lidar,UTM-30LX,1,Hokuyo,,5000.0,5000.0,5000.0,5000.0,2016,370.0,,yes,"]
    rows += ["nut,hexagon nut,ISO 4032 M4,4" + 11 * ","]
    rows += ['total,all rows,,,,,,5438.5,5400,5500,,,,,"sum of 4"']
    header = "kind,part,number,quantity,supplier,supplier_number,unit_usd,total_usd,low_usd,high_usd,priced,mass_g,"
    header += "source,verified,note"
    (folder / "bom.csv").write_text("\n".join([header, *rows, ""]))
    (folder / "assembly.md").write_text(f"# Title\n\nLook at `exploded.glb`.\n\n## 1. Servo\n\n**4 x M4** {EVIL}\n")
    (folder / "wiring.svg").write_text(
        f"<svg xmlns='http://www.w3.org/2000/svg'><text>{html.escape(EVIL)}</text></svg>"
    )
    (folder / "wiring.md").write_text(f"# Title\n\n## Power\n\n- F1 {EVIL}\n- F2\n")
    (folder / "drawings").mkdir()
    (folder / "drawings" / "base_mount.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><script>alert(1)</script></svg>'
    )
    write_manifest(folder, loaded, [])
    write_report(folder)
    return folder


@pytest.fixture(scope="module")
def text(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(text):
    return Page(text)


def test_every_section_is_there_and_every_link_leads_somewhere(page):
    assert [name for name in page.text if name] == SECTIONS
    assert len(set(page.ids)) == len(page.ids)
    assert {link[1:] for link in page.links if link.startswith("#")} == set(SECTIONS)
    assert "Left out:" not in "".join(page.text.values())


def test_nothing_is_fetched(folder, page, text):
    assert all(link.startswith(("#", "data:")) or (folder / link).is_file() for link in page.links)
    style, code = (PAGE / "style.css").read_text(), "".join(path.read_text() for path in CODE)
    assert not re.search(r"@import|url\(|//", style)
    assert not re.search(r"fetch|XMLHttpRequest|WebSocket|import\b|https?:|\.src\b", code)
    assert not re.search(r"https?://", text)
    assert "default-src 'none'; img-src data:" in text  # and the browser is told to refuse
    assert len(text.encode()) < 8e6


def test_the_command_writes_what_the_build_wrote(folder, command):
    before = {name: (folder / name).read_bytes() for name in ("report.html", "manifest.json")}
    (folder / "report.html").write_text("an older one")
    assert command("report", folder) == (0, f"wrote {folder / 'report.html'}\n", [])
    assert {name: (folder / name).read_bytes() for name in before} == before
    assert is_current(folder, load_task(folder / "task.toml"))


def test_the_manifest_is_in_the_order_of_a_manifest_written_last(folder, tmp_path):
    entered = read_manifest(folder)
    again = tmp_path / "again"
    shutil.copytree(folder, again, ignore=shutil.ignore_patterns("manifest.json"))
    write_manifest(again, load_task(again / "task.toml"), [])
    assert list(read_manifest(again)["files"]) == list(entered["files"])
    assert read_manifest(again) == entered


def test_the_answer_says_what_the_files_say(page):
    answer = " ".join(page.text["answer"].split())
    assert "0, 90 deg" in answer and "0, -90 deg" in answer
    assert "-5.7636 +- 0.0005" in answer
    assert "at least 5,438 USD" in answer and "sum of 4" in answer  # no cents of what has no price
    assert "18 s: one turn" in answer
    hidden = (100 * AXIS_STEPS + 100 * 180) / (1081 * AXIS_STEPS)
    assert f"{100 * hidden:.2f} % of all beams" in answer and "of 1081 beams 100 always, 100 at times" in answer
    assert "1 error, 1 warning, 1 note, 2 passed" in answer
    # rolling against itself, and 40 lines a second over 18 s
    assert "1.00 times the beams" in answer
    assert f"{720 * 1081:,} beams: 720 lines of 1081" in answer
    # the field of view of 270 deg leaves 90 deg open, straight behind the axis that points ahead
    assert "No beam enters the cone of 45.0 deg half angle about theta 90.0, phi 180.0." in answer


def test_what_a_setting_sees_agrees_with_other_ways_to_know_it():
    said = answer(problem_as_built(load_task(Path("ground_ahead")), ANGLES), ANGLES)
    rolling, pitching = said.standard
    assert rolling.factor == pytest.approx(1, abs=1e-3)
    assert pitching.factor == pytest.approx(np.exp(pitching.J - ANGLES.J), abs=1e-3)
    # a blind cone of 45 deg, smaller by the ball of 2 deg; the mask covers part of it
    everywhere = (1 - np.cos(np.radians(43))) / 2
    assert 0 < said.own.blind_fraction < everywhere
    assert said.masked_fraction == pytest.approx((1 - np.cos(np.radians(25))) / 2, abs=1e-6)
    assert said.own.line_gap_deg == rolling.seen.line_gap_deg == pytest.approx(0.5)
    assert said.own == rolling.seen != pitching.seen
    assert said.worst == pytest.approx(1 - np.exp(-max(said.rises.values())), abs=1e-12)
    problem = problem_of(load_task(Path("ground_ahead")))
    off = [quick_J(problem, np.radians([0, 90 + d, 0, -90]), NODES) for d in (-1, 0, 1)]
    assert said.rises["beta_rot"] == pytest.approx(max(off) - off[1], abs=1e-12)


def test_other_motions_and_objectives_make_no_claim_of_factors():
    loaded = load_task(Path("indoor_urg"))
    angles = ANGLES.model_copy(update={"sensor": "URG-04LX", "motion": loaded.task.motion, "J": None})
    assert all(standard.factor is None for standard in answer(problem_as_built(loaded, angles), angles).standard)


def test_what_is_in_the_files_stays_text(page, text):
    assert EVIL not in text
    assert page.scripts == 3  # the data of scanner and ball, and the code
    for section in ("checks", "steps", "left-out"):
        assert EVIL in page.text[section]


def test_errors_come_first_and_what_nobody_knows_with_them(page, tmp_path):
    found = re.findall(r"(error|warning|note|pass) of", page.text["checks"])
    assert found == ["error", "warning", "note", "pass", "pass"]
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    write_json(tmp_path / "checks.json", {"checks": [{"severity": "fatal", "message": "a new word"}]})
    assert "1 error" in Page(report_html(tmp_path)).text["answer"]


def test_a_folder_with_nothing_but_angles_has_every_section(tmp_path):
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    bare = Page(report_html(tmp_path))
    assert [name for name in bare.text if name] == SECTIONS
    assert "0, 90 deg" in bare.text["answer"]
    for section in SECTIONS:
        assert "Left out:" in bare.text[section]
    assert "canvas" not in bare.ids and bare.scripts == 1


def test_a_bare_setting_without_motion_ring_or_J(tmp_path):
    bare = {"slip_ring": None, "motion": None, "J": None, "J_error": None, "source": "calibration"}
    (tmp_path / "angles.json").write_text(ANGLES.model_copy(update=bare).to_json())
    assert "motion is not known" in Page(report_html(tmp_path)).text["answer"]


@pytest.mark.parametrize("content", [b"", b"{", b"PK\3\4", b'{"a": 1}'])
@pytest.mark.parametrize("name", ["checks.json", "left_out.json", "manifest.json", "own_body.npz", "assembly.glb"])
def test_a_file_that_no_build_wrote_is_one_line(name, content, tmp_path, command):
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    (tmp_path / name).write_bytes(content)
    code, out, complaint = command("report", tmp_path)
    assert (code, out, len(complaint)) == (2, "", 1)
    assert complaint[0].startswith(f"scanwright: {tmp_path}") and name in complaint[0]
    assert "build the folder again" in complaint[0]


def test_no_angles_is_one_line(tmp_path, command):
    code, _, complaint = command("report", tmp_path)
    assert code == 2 and len(complaint) == 1 and "angles.json" in complaint[0]


def world_points(body, key):
    T = np.reshape(body[key], (4, 4)).T
    points = np.frombuffer(b64decode(body["vertices"]), "<f4").reshape(-1, 3)
    return points @ T[:3, :3].T + T[:3, 3]


def drawn(folder, angles, hidden):
    """What the page draws of a folder."""
    assembly, exploded = (load_glb(folder / name) for name in ("assembly.glb", "exploded.glb"))
    return scanner_scene(assembly, exploded, angles, hidden)


def sphere(loaded, axes):
    return density_sphere(problem_as_built(loaded, ANGLES), ANGLES, axes, loaded.task.angles.step_deg)


def test_the_scene_stands_in_the_world_and_turns_about_the_axis(folder):
    shown = drawn(folder, ANGLES, own_body())
    base, lidar = shown["bodies"]
    assert [base["name"], base["turns"], lidar["name"], lidar["turns"]] == ["base_mount", False, "lidar_body", True]
    np.testing.assert_allclose(base["colour"], [0.735, 0, 1], atol=3e-3)  # sRGB of half the light
    behind = ANGLES.T_world_rot(0.0) @ [0, 0, -0.1, 1]
    np.testing.assert_allclose(world_points(base, "matrix").mean(axis=0), behind[:3], atol=1e-6)
    for key, height in (("matrix", -0.1), ("apart", 0.2)):
        expected = ANGLES.T_world_laser(0.0) @ [0, 0, height, 1]
        np.testing.assert_allclose(world_points(lidar, key).mean(axis=0), expected[:3], atol=1e-6)
    A = np.reshape(shown["axis"], (4, 4)).T
    np.testing.assert_allclose(A, ANGLES.T_world_rot(0.0), atol=1e-8)
    np.testing.assert_allclose(A @ np.reshape(shown["axis_inverse"], (4, 4)).T, np.eye(4), atol=1e-8)
    np.testing.assert_allclose(np.reshape(shown["laser"], (4, 4)).T, ANGLES.T_world_laser(0.0), atol=1e-8)
    faces = np.frombuffer(b64decode(base["faces"]), "<u2")
    assert len(faces) == 36 and faces.max() < len(world_points(base, "matrix"))
    for fit, key in (("fit", "matrix"), ("fit_apart", "apart")):
        points = np.concatenate([world_points(body, key) for body in shown["bodies"]])
        assert np.linalg.norm(points - shown[fit]["centre"], axis=1).max() <= shown[fit]["radius"] + 1e-6


def test_the_fan_knows_what_is_hidden_at_every_axis_step(folder):
    shadow, bearings = own_body()
    fan = drawn(folder, ANGLES, (shadow, bearings))["fan"]
    np.testing.assert_allclose(np.frombuffer(b64decode(fan["bearings"]), "<f4"), bearings, atol=1e-6)
    hidden = np.zeros((len(bearings), fan["steps"]), bool)
    for beam, bits in fan["hidden"].items():
        row = b64decode(bits)
        # as the page reads it
        hidden[int(beam)] = [row[step >> 3] >> (7 - (step & 7)) & 1 for step in range(fan["steps"])]
    np.testing.assert_array_equal(hidden, shadow.stator | shadow.beams[:, None])
    assert hidden.mean() == pytest.approx(hidden_by(shadow).share)


def test_a_sweep_stays_within_its_limits(folder):
    sweep = ANGLES.model_copy(update={"motion": Sweep(limits_deg=(-90, 80), period_s=12.0)})
    shown = drawn(folder, sweep, None)
    assert (shown["limits_deg"], shown["to_and_fro"], shown["period_s"]) == ([-90, 80], True, 12.0)
    assert shown["fan"] is None


def test_a_scanner_too_large_for_a_page_is_left_out(folder, monkeypatch):
    monkeypatch.setattr("scanwright.report.page.LARGEST_BYTES", 100)
    page = Page(report_html(folder))
    assert "too much for one page" in page.text["scanner"] and "canvas" not in page.ids


def test_the_code_of_the_page_asks_for_what_is_there(folder, page):
    code = (PAGE / "scanner.js").read_text()
    for path in CODE:
        assert set(re.findall(r'element\("([\w-]+)"\)', path.read_text())) <= set(page.ids)
    shown = drawn(folder, ANGLES, own_body())
    assert set(re.findall(r"scene\.(\w+)", code)) <= shown.keys()
    assert set(re.findall(r"scene\.fan\.(\w+)", code)) <= shown["fan"].keys()
    assert set(re.findall(r"\bbody\.(\w+)", code)) <= {*shown["bodies"][0], "array", "count", "type"}
    ball = sphere(load_task(Path("ground_ahead")), None).data()
    assert set(re.findall(r"scene\.(\w+)", (PAGE / "sphere.js").read_text())) <= ball.keys()


def test_the_table_of_settings_names_the_lowest(page):
    settings = " ".join(page.text["settings"].split())
    assert "As built, with its parts and at angles refined between those of the grid, J is -5.7636." in settings
    assert settings.index("kept") < settings.index("blind to"), "those first that keep what the task asks"
    assert "25 ways to mount the laser on the axis, and 325 ways to mount the axis on the robot" in settings


def test_a_lower_j_that_is_blind_is_told_to_be_blind_and_what_seeing_costs():
    """The setting of the shipped task that J alone would take, beside the best one without a hole."""
    loaded = load_task(Path("ground_ahead"))
    problem, built = problem_of(loaded), np.radians([0.0, -55.61, -78.72, 79.75])
    planes = np.array([[-80.0, 75.0, -6.1285, 0.0, -55.0], [-80.0, 80.0, -6.128, 0.0, -55.0], [0.0, 0.0, np.inf, 0, 0]])
    found = other_mounts(problem, loaded.task, built, planes)
    ((kept,), (broken,)) = found.kept, found.broken
    assert (kept.angles_deg, kept.breaks) == ((0, -55, -80, 80), "")
    assert (broken.angles_deg, broken.breaks) == ((0, -55, -80, 75), "blind to 0.019% of the weight")
    assert broken.J < kept.J == score(problem, np.radians(kept.angles_deg)).J
    assert (
        "would take (0, -55, -80, 75) with J = -6.1284, which is blind ahead and 35 deg down: 0.58 deg" in found.alone
    )
    assert found.alone.endswith("What keeps all that the task asks costs 0.086% of the beams per ball against it.")
    allowed = loaded.task.model_copy(update={"angles": loaded.task.angles.model_copy(update={"holes": "allow"})})
    assert (
        len(other_mounts(problem, allowed, built, planes).kept) == 2
        and not other_mounts(problem, allowed, built, planes).alone
    )
    limited = allowed.model_copy(update={"limits": Limits(min_density=50)})
    (other,) = other_mounts(problem, limited, built, planes).broken
    assert (other.angles_deg, other.breaks) == (broken.angles_deg, "breaks the limits")


def test_the_manifest_in_the_page_is_that_of_the_folder(folder, page, text):
    manifest = read_manifest(folder)
    rows = re.findall(r"<td>([^<]+)</td><td [^>]+>([\d,]+)</td><td><code>([0-9a-f]{64})</code>", text)
    files = {name: {"sha256": digest, "bytes": int(size.replace(",", ""))} for name, size, digest in rows}
    assert files == {name: facts for name, facts in manifest["files"].items() if name != "report.html"}
    for name, version in manifest["versions"].items():
        assert re.search(rf"{re.escape(name)}\s*{re.escape(version)}", page.text["again"])


def test_steps_are_headings_paragraphs_and_lists():
    assert steps_html("# T\n\n## A\n\none\ntwo **b** `c*`\n\n- x\n- y") == (
        "<h3>A</h3>\n<p>one two <b>b</b> <code>c*</code></p>\n<ul><li>x</li><li>y</li></ul>"
    )


def test_a_picture_of_the_steps_stands_in_the_page_itself():
    shown = steps_html("## A\n\n![A <b>](a.png)\n\n![B](b.png)", {"a.png": "data:image/png;base64,AA=="}.get)
    image = '<img src="data:image/png;base64,AA==" alt="A &lt;b&gt;">'
    assert shown == f'<h3>A</h3>\n<div class="wide">{image}</div>\n<p>![B](b.png)</p>'


@given(st.text(st.characters(exclude_characters="#*`-\r\n", exclude_categories=["C", "Z"]), min_size=1))
def test_a_step_in_plain_words_comes_through_unchanged(words):
    assert html.unescape(steps_html(words)) == f"<p>{words}</p>"


def picture(data):
    return Image.open(io.BytesIO(b64decode(data.partition(",")[2]))).convert("RGB")


def cell(direction):
    """Column and row of a direction in a picture of the sphere, by another way than the pictures are made."""
    x, y, z = direction / np.linalg.norm(direction)
    phi, theta = np.degrees(np.arctan2(y, x)), np.degrees(np.arctan2(np.hypot(x, y), z))
    return int((phi + 180) / STEP_DEG) % int(360 / STEP_DEG), int(theta / STEP_DEG)


def test_the_pictures_of_the_sphere_show_what_is_where():
    loaded = load_task(Path("ground_ahead"))
    ball = sphere(loaded, AXES)
    assert [shown.title for shown in ball.maps] == [
        "density of this scanner",
        "density of rolling",
        "density of pitching",
        "J over the direction of the axis",
    ]
    own, rolling, pitching, axes = (picture(shown.picture) for shown in ball.maps)
    assert own.tobytes() == rolling.tobytes() != pitching.tobytes()
    shades = {tuple((np.array(colormaps["cividis"](i / (SHADES - 1))[:3]) * 255).round()) for i in range(SHADES)}
    bright = max(shades, key=sum)
    # rolling is densest along its axis, ahead and behind; behind it sees nothing within 43 deg, and the robot is there
    assert own.getpixel(cell(np.array([1, 0, 0]))) == bright
    assert own.getpixel(cell(np.array([-1, 0.2, 0.2]))) == (255, 255, 255)
    assert own.getpixel(cell(np.array([-1, 0, -0.5]))) in [(221, 221, 221), (119, 119, 119)]
    assert pitching.getpixel(cell(np.array([0, 1, 0]))) == pitching.getpixel(cell(np.array([0, -1, 0]))) == bright
    theta, phi = np.radians(95), np.radians(-20)  # on the upper edge of the region
    edge = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    assert own.getpixel(cell(edge)) == (17, 17, 17)
    # the best axis is the brightest; its mirror image to the right is not
    best = R_world_rot(np.radians(60), np.radians(30))[:, 2]
    assert axes.getpixel(cell(best)) == bright != axes.getpixel(cell(best * [1, -1, 1]))
    np.testing.assert_allclose(ball.axis_world, [1, 0, 0], atol=1e-6)


def test_axes_that_nobody_searched_stay_white():
    loaded = load_task(Path("ground_ahead"))
    few = AXES[np.abs(AXES[:, 0] - 60) <= 15]
    axes = picture(sphere(loaded, few).maps[-1].picture)
    assert axes.getpixel(cell(R_world_rot(np.radians(60), 0.0)[:, 2])) != (255, 255, 255)
    assert axes.getpixel(cell(R_world_rot(np.radians(-60), 0.0)[:, 2])) == (255, 255, 255)
    assert len(sphere(loaded, AXES[:1]).maps) == 3


def test_a_check_knows_its_bodies():
    names = ["alignment_linkage", "base_mount", "lidar_body", "lidar_cap", "ring_rotor", "servo_case", "servo_horn"]
    turning = {"alignment_linkage", "lidar_body", "lidar_cap", "ring_rotor", "servo_horn"}
    bodies = {name: PlacedBody(np.zeros((1, 3, 3)), name in turning) for name in [*names, "servo_shaft"]}
    bought = {"UTM-30LX": "lidar", "MX-64R": "servo", "UH1256": "slip ring"}
    for where, expected in {
        "base_mount": {"base_mount"},
        "servo_shaft and ring_rotor": {"servo_shaft", "ring_rotor"},
        "servo": {"servo_case", "servo_horn"},
        "MX-64R": {"servo_case", "servo_horn"},
        "UH1256": {"ring_rotor"},
        "UTM-30LX": {"lidar_body", "lidar_cap"},
        "beams at -3.00 to 4.50 deg": {"lidar_body", "lidar_cap"},
        "rotor": turning,
        "fdm-0.4": set(),
        "": set(),
    }.items():
        assert set(bodies_named(where, bodies, bought)) == expected, where


def test_the_picture_of_a_check_is_dark_where_its_body_is(folder):
    bodies = placed_bodies(load_glb(folder / "assembly.glb"))
    pictures = CheckPictures(bodies)
    yaw, pitch = np.radians(40), np.radians(22)
    right = np.array([-np.sin(yaw), np.cos(yaw), 0])
    up = np.array([-np.cos(yaw) * np.sin(pitch), -np.sin(yaw) * np.sin(pitch), np.cos(pitch)])
    for name, body in bodies.items():
        shot = np.asarray(picture(pictures.picture((name,))), float)
        named = shot[:, :, 0] - shot[:, :, 2] > 60
        rows, columns = np.nonzero(named)
        every = np.concatenate([b.triangles_m.reshape(-1, 3) for b in bodies.values()])
        own = body.triangles_m.reshape(-1, 3)
        for axis, pixels, size, sign in ((right, columns, 200, 1), (up, rows, 150, -1)):
            whole, part = every @ axis, own @ axis
            pixel = max(np.ptp(every @ right) / 200, np.ptp(every @ up) / 150) * 1.04
            centre = size / 2 + sign * ((part.min() + part.max()) - (whole.min() + whole.max())) / 2 / pixel
            assert (pixels.min() + pixels.max() + 1) / 2 == pytest.approx(centre, abs=2)
            assert np.ptp(pixels) + 1 == pytest.approx(np.ptp(part) / pixel, abs=3)


# ---- in a browser ----


def shot_of(page, selector):
    """Colours of what is shown, 0 to 1, once the page has drawn what it was asked for."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return np.asarray(Image.open(io.BytesIO(page.locator(selector).screenshot())).convert("RGB"), float) / 255


def lilac(shot):
    """Where the bodies of the fixture are: red and blue are well above green there, not so in the fan."""
    return (shot[:, :, 2] - shot[:, :, 1] > 0.25) & (shot[:, :, 0] - shot[:, :, 1] > 0.1)


def changed(one, other):
    """Whether two pictures show different things: more than a pixel of an edge here and there."""
    return (np.abs(one - other).max(axis=2) > 0.1).mean() > 2e-3


def until(page, condition):
    """Wait for a condition in JavaScript; Playwright's own way needs `eval`, which the page forbids."""
    look = f"const look = () => ({condition}) ? done(true) : requestAnimationFrame(look)"
    late = "setTimeout(() => done(false), 60000)"
    assert page.evaluate(f"() => new Promise((done) => {{ {look}; {late}; look(); }})"), condition


@pytest.fixture
def shown(browser, folder):
    """The report, wide."""
    return browser.open((folder / "report.html").as_uri())


def test_the_page_is_whole_with_the_network_off(shown):
    """And the console is silent, nothing is asked of anybody: the fixture holds that for every test with it."""
    sizes = shown.evaluate("Promise.all([...document.images].map((i) => i.decode().then(() => i.naturalWidth)))")
    assert len(sizes) >= 12 and min(sizes) > 0
    assert shown.locator("#hint, #sphere-hint").evaluate_all("all => all.every((hint) => hint.hidden)")
    assert shown.evaluate("document.documentElement.scrollWidth") <= 1400
    scanner = shot_of(shown, "#canvas")
    assert lilac(scanner).mean() > 0.01
    for key in ("ArrowLeft", "ArrowRight"):  # a second picture is no worse than the first one
        shown.locator("#canvas").press(key)
    inside = slice(5, -5), slice(5, -5)  # of the frame that has the focus now
    assert not changed(shot_of(shown, "#canvas")[inside], scanner[inside])


def test_every_control_of_the_scanner_does_what_it_says(shown):
    shown.uncheck("#fan")
    start = shot_of(shown, "#canvas")
    area = lilac(start).sum()

    def middle(shot):
        return np.argwhere(lilac(shot)).mean(axis=0)

    shown.locator("#axis").fill("90")
    turned = shot_of(shown, "#canvas")
    assert changed(turned, start) and shown.inner_text("#axis-shown") == "90.0 deg"
    shown.locator("#axis").fill("0")
    assert not changed(shot_of(shown, "#canvas"), start)
    shown.locator("#apart").fill("1")
    apart = shot_of(shown, "#canvas")
    assert changed(apart, start) and 0.1 * area < lilac(apart).sum()
    shown.locator("#apart").fill("0")
    assert not changed(shot_of(shown, "#canvas"), start)
    shown.click("#nearer")
    assert lilac(shot_of(shown, "#canvas")).sum() > 1.2 * area
    shown.click("#farther")
    assert not changed(shot_of(shown, "#canvas"), start)
    shown.check("#fan")
    fan = shot_of(shown, "#canvas")
    light, dark = (np.abs(fan - colour).max(axis=2) < 0.02 for colour in ([0.98, 0.88, 0.64], [0.15] * 3))
    assert light.mean() > 0.02 < light.sum() / dark.sum() and dark.sum() > 100  # two fifths of it over white
    for axis, count in (("89.5", 200), ("90", 100), ("359.5", 100), ("0", 200)):
        shown.locator("#axis").fill(axis)
        until(shown, f"document.getElementById('fan-shown').textContent == '{count} of 1081 beams hidden'")
    box = shown.locator("#canvas").bounding_box()
    shown.mouse.move(box["x"] + 300, box["y"] + 300)
    shown.mouse.down()
    shown.mouse.move(box["x"] + 400, box["y"] + 250)
    shown.mouse.up()
    assert changed(shot_of(shown, "#canvas"), fan)
    assert np.abs(middle(shot_of(shown, "#canvas")) - middle(fan)).max() > 1


def test_the_axis_spins_as_fast_as_in_a_scan(shown):
    shown.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    shown.evaluate(
        """() => {
            const waiting = [];
            window.requestAnimationFrame = (draw) => waiting.push(draw);
            window.framesUntil = (fromMs, toMs) => {
                for (let ms = fromMs; ms <= toMs; ms += 500) waiting.splice(0).forEach((draw) => draw(ms));
                return Number(document.getElementById("axis").dataset.exact);
            };
        }"""
    )  # time passes as this test says; few frames, since a graphics process without a card draws each one, on and on
    press = "document.getElementById('spin').click()"
    shown.evaluate(press)
    start = shown.evaluate("framesUntil(1000, 1500)")
    assert shown.evaluate("framesUntil(2000, 4500)") - start == pytest.approx(3 * 360 / 18, abs=1e-6)
    assert 0 < shown.evaluate("framesUntil(5000, 19500)") < 20  # round once
    shown.evaluate(press)
    assert shown.get_attribute("#spin", "aria-pressed") == "false"


def test_a_check_shows_where(shown):
    shown.uncheck("#fan")
    both = lilac(shot_of(shown, "#canvas")).sum()
    shown.locator("#checks tr.warning button").click()
    assert shown.inner_text("#picked-shown") == "base_mount"
    one = shot_of(shown, "#canvas")
    assert 0.1 * both < lilac(one).sum() < 0.9 * both
    shown.locator("#checks tr.error button").click()
    assert lilac(shot_of(shown, "#canvas")).sum() == pytest.approx(both, rel=0.02)
    shown.locator("#checks tr.warning button").click()
    shown.click("#everything")
    assert lilac(shot_of(shown, "#canvas")).sum() == pytest.approx(both, rel=0.02)
    assert not shown.is_visible("#picked")


def test_the_ball_is_wrapped_the_right_way_round(shown):
    """What is in its middle is what its picture has in the direction of the camera."""
    seen = []
    look_deg = json.loads(shown.locator("#sphere").text_content())["look_deg"]
    assert look_deg[0] == 25 and -45 < look_deg[1] < -25  # the region is ahead and 5 to 60 deg down
    for number in range(4):
        shown.select_option("#sphere-choice", str(number))
        title = shown.locator("#sphere-choice option").nth(number).inner_text()
        until(shown, f"document.getElementById('sphere-title').textContent == '{title}'")
        shot = shot_of(shown, "#sphere-canvas")
        yaw, pitch = np.radians(look_deg[0] + 3), np.radians(look_deg[1])
        wrapped = picture(shown.get_attribute(f"#sphere-{number}", "src"))
        towards = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
        height, width = shot.shape[:2]
        # a little beside the middle, where a line of the grid is
        right = int(width / 2 + 0.052 * height / 2 / 1.25 * np.cos(pitch))
        np.testing.assert_allclose(shot[height // 2, right], np.array(wrapped.getpixel(cell(towards))) / 255, atol=0.05)
        seen.append(shot)
    assert [changed(*pair) for pair in itertools.pairwise(seen)] == [False, True, True]
    shown.locator("#sphere-canvas").press("ArrowUp")
    assert changed(shot_of(shown, "#sphere-canvas"), seen[3])
    assert {"ahead", "left", "axis"} <= set(shown.locator(".mark:visible").all_inner_texts())


def test_a_phone_needs_no_sideways_scroll(browser, folder):
    page = browser.open((folder / "report.html").as_uri(), 390, 844, device_scale_factor=2, has_touch=True)
    page.evaluate("document.querySelectorAll('details').forEach((details) => (details.open = true))")
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert lilac(shot_of(page, "#canvas")).mean() > 0.01
    small = page.evaluate(
        "[...document.querySelectorAll('p, td, dd, dt, li, summary, label, button')]"
        ".filter((e) => parseFloat(getComputedStyle(e).fontSize) < 12).length"
    )
    assert small == 0


@pytest.mark.parametrize("size", [(1440, 900), (390, 844)])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nobody_is_kept_out_of_it(browser, folder, size, scheme):
    page = browser.open((folder / "report.html").as_uri(), *size, color_scheme=scheme)
    page.evaluate("document.querySelectorAll('details').forEach((details) => (details.open = true))")
    assert browser.barriers(page) == []


def test_on_paper_nothing_is_folded_and_no_control_is_left(shown):
    shown.evaluate(
        "window.onbeforeprint = () => (window.printed = document.querySelectorAll('details:not([open])').length)"
    )
    content = shown.pdf(format="A4")
    assert content.startswith(b"%PDF") and 3 <= content.count(b"/Type /Page\n") <= 8
    assert shown.evaluate("window.printed") == shown.locator("details.screen").count()
    assert shown.locator("details[open]").count() == 0
    shown.emulate_media(media="print")
    for selector in ("#controls", "#sphere-controls", "#sphere-canvas", "#files", "nav"):
        assert not shown.is_visible(selector)
    for selector in ("#canvas", ".room img", ".said", "#density .map img"):
        assert shown.is_visible(selector)
    drawn = "(pictures) => pictures.every((p) => p.src.startsWith('data:image/svg+xml') && p.naturalWidth > 0)"
    assert shown.locator("#density .map img, #settings figure img").evaluate_all(drawn)  # sharp on paper
    assert lilac(shot_of(shown, "#canvas")).mean() > 0.005


def test_without_webgl_the_page_says_so_and_the_rest_is_there(browser, folder):
    page = browser.open("about:blank")
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto((folder / "report.html").as_uri())
    assert page.is_visible("#hint") and page.is_visible("#sphere-hint")
    assert not page.is_visible("canvas") and not page.is_visible("#controls")
    assert page.is_visible("#settings img")
    assert page.locator("#checks button:disabled").count() == page.locator("#checks button").count() > 0


def test_the_browser_tests_would_see_a_request(browser, tmp_path):
    leaky = tmp_path / "leaky.html"
    leaky.write_text("<img src='http://192.0.2.1/x.png'><script>console.error('oh')</script>")
    browser.open(leaky.as_uri())
    assert "asked the network for http://192.0.2.1/x.png" in browser.complaints and "oh" in browser.complaints
    browser.complaints.clear()
