"""`report.html`: made of the files alone, whole, the same bytes again, nothing fetched, nothing smuggled in."""

import html
import os
import re
import shutil
import subprocess
import sys
from base64 import b64decode
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

import scanwright
from design import build as writer
from design.angles import STANDARD_DEG, Angles, AngleSet
from design.folder import is_current, manifest_of, write_json, write_manifest
from design.left_out import LeftOut
from design.motion import Sweep
from design.report import scene as report_scene
from design.report.answer import hidden_by, sight_of
from design.report.page import report_html, write_report
from design.report.scene import scene_of
from design.report.steps import steps_html
from design.shadow import AXIS_STEPS, Shadow, own_body_bytes
from design.task import load_task

SECTIONS = ["answer", "scanner", "density", "settings", "checks", "bom", "steps", "drawings", "left-out", "again"]
PAGE = Path(report_scene.__file__).parent
VOID = {"meta", "link", "img", "input", "br"}
Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
EVIL = "</script><script>alert(1)</script>"
ROLLING = Angles(
    **dict(zip(("alpha_rot", "beta_rot", "alpha_laser", "beta_laser"), STANDARD_DEG["rolling"], strict=True))
)
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
    writer.write_left_out(folder, [LeftOut("masked directions", EVIL, 12345, "square degrees")])
    (folder / "density.png").write_bytes(b"\x89PNG, of which the report reads nothing")
    (folder / "own_body.npz").write_bytes(own_body_bytes(*own_body()))
    apart = {"base_mount": (0, 0, -0.1), "lidar_body": (0, 0, 0.2)}
    (folder / "assembly.glb").write_bytes(glb(dict.fromkeys(apart, (0, 0, -0.1))))
    (folder / "exploded.glb").write_bytes(glb(apart))
    checks = [{"severity": s, "message": f"{s} of {EVIL}"} for s in ("pass", "note", "warning", "error", "pass")]
    write_json(folder / "checks.json", {"schema": "scanwright/checks/1", "checks": checks})
    rows = ["bought,lidar,UTM-30LX,1,Hokuyo,,5000.0,5000.0,370.0,,yes,", 'total,all rows,,,,,,5438.5,,,,"sum of 4"']
    header = "kind,part,number,quantity,supplier,supplier_number,unit_usd,total_usd,mass_g,source,verified,note"
    (folder / "bom.csv").write_text("\n".join([header, *rows, ""]))
    (folder / "assembly.md").write_text(f"# Title\n\nLook at `exploded.glb`.\n\n## 1. Servo\n\n**4 x M4** {EVIL}\n")
    (folder / "drawings").mkdir()
    (folder / "drawings" / "base_mount.svg").write_text(f'<svg xmlns="http://www.w3.org/2000/svg">{EVIL}</svg>')
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


def test_nothing_is_fetched(page, text):
    assert all(link.startswith(("#", "data:")) for link in page.links)
    style, code = (PAGE / "style.css").read_text(), (PAGE / "page.js").read_text() + (PAGE / "viewer.js").read_text()
    assert not re.search(r"@import|url\(|//", style)
    assert not re.search(r"fetch|XMLHttpRequest|WebSocket|import\b|https?:|\.src\b", code)
    assert not re.search(r"https?://", text)
    assert "default-src 'none'; img-src data:" in text  # and the browser is told to refuse
    assert len(text.encode()) < 8e6


def test_the_same_files_give_the_same_bytes_in_another_process(folder, text):
    assert report_html(folder) == text
    again = "from pathlib import Path; from design.report.page import report_html; import sys; " \
        "sys.stdout.buffer.write(report_html(Path(sys.argv[1])).encode())"  # fmt: skip
    root = Path(scanwright.__file__).parent
    run = subprocess.run(
        [sys.executable, "-c", again, folder],
        cwd=root,
        env={**os.environ, "PYTHONHASHSEED": "7"},
        capture_output=True,
        check=True,
    )
    assert run.stdout.decode() == text


def test_the_command_writes_what_the_build_wrote(folder, command):
    before = {name: (folder / name).read_bytes() for name in ("report.html", "manifest.json")}
    (folder / "report.html").write_text("an older one")
    assert command("report", folder) == (0, f"wrote {folder / 'report.html'}\n", [])
    assert {name: (folder / name).read_bytes() for name in before} == before
    assert is_current(folder, load_task(folder / "task.toml"))


def test_the_manifest_is_in_the_order_of_a_manifest_written_last(folder, tmp_path):
    entered = manifest_of(folder)
    again = tmp_path / "again"
    shutil.copytree(folder, again, ignore=shutil.ignore_patterns("manifest.json"))
    write_manifest(again, load_task(again / "task.toml"), [])
    assert list(manifest_of(again)["files"]) == list(entered["files"])
    assert manifest_of(again) == entered


def test_the_answer_says_what_the_files_say(page):
    answer = " ".join(page.text["answer"].split())
    assert "0, 90 deg" in answer and "0, -90 deg" in answer
    assert "-5.7636 +- 0.0005" in answer
    assert "5,438.50 USD" in answer and "sum of 4" in answer
    assert "18 s: one turn" in answer
    hidden = (100 * AXIS_STEPS + 100 * 180) / (1081 * AXIS_STEPS)
    assert f"{100 * hidden:.2f} % of all beams" in answer and "of 1081 beams 100 always, 100 at times" in answer
    assert "1 error, 1 warning, 1 note, 2 passed" in answer
    # rolling against itself, and 40 lines a second over 18 s
    assert "1.00 times the beams" in answer
    assert f"{720 * 1081:,} beams: 720 lines of 1081" in answer
    # the field of view of 270 deg leaves 90 deg open, straight behind the axis that points ahead
    assert "A cone of 45.0 deg half angle about theta 90.0, phi 180.0." in answer


def test_what_a_setting_sees_agrees_with_other_ways_to_know_it():
    sight = sight_of(load_task(Path("ground_ahead")), ANGLES)
    rolling, pitching = sight.standard
    assert rolling.factor == pytest.approx(1, abs=1e-3)
    assert pitching.factor == pytest.approx(np.exp(pitching.J - ANGLES.J), abs=1e-3)
    # a blind cone of 45 deg, smaller by the ball of 2 deg; the mask covers part of it
    everywhere = (1 - np.cos(np.radians(43))) / 2
    assert 0 < sight.blind_fraction < everywhere
    assert sight.masked_fraction == pytest.approx((1 - np.cos(np.radians(25))) / 2, abs=1e-6)
    assert sight.line_gap_deg == pytest.approx(0.5)


def test_other_motions_and_objectives_make_no_claim_of_factors():
    loaded = load_task(Path("indoor_urg"))
    angles = ANGLES.model_copy(update={"sensor": "URG-04LX", "motion": loaded.task.motion, "J": None})
    assert all(standard.factor is None for standard in sight_of(loaded, angles).standard)


def test_what_is_in_the_files_stays_text(page, text):
    assert EVIL not in text
    assert page.scripts == 2  # the data of the scene, and the code
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
    assert str(tmp_path / name) in complaint[0] and "build the folder again" in complaint[0]


def test_no_angles_is_one_line(tmp_path, command):
    code, _, complaint = command("report", tmp_path)
    assert code == 2 and len(complaint) == 1 and "angles.json" in complaint[0]


def world_points(body, key):
    T = np.reshape(body[key], (4, 4)).T
    points = np.frombuffer(b64decode(body["vertices"]), "<f4").reshape(-1, 3)
    return points @ T[:3, :3].T + T[:3, 3]


def test_the_scene_stands_in_the_world_and_turns_about_the_axis(folder):
    shown = scene_of(folder, ANGLES, own_body())
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
    fan = scene_of(folder, ANGLES, (shadow, bearings))["fan"]
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
    shown = scene_of(folder, sweep, None)
    assert (shown["limits_deg"], shown["to_and_fro"], shown["period_s"]) == ([-90, 80], True, 12.0)
    assert shown["fan"] is None


def test_a_scanner_too_large_for_a_page_is_left_out(folder, monkeypatch):
    monkeypatch.setattr("design.report.page.LARGEST_BYTES", 100)
    page = Page(report_html(folder))
    assert "too much for one page" in page.text["scanner"] and "canvas" not in page.ids


def test_the_code_of_the_page_asks_for_what_is_there(folder, page):
    code = (PAGE / "viewer.js").read_text()
    assert set(re.findall(r'element\("([\w-]+)"\)', code)) <= set(page.ids)
    shown = scene_of(folder, ANGLES, own_body())
    assert set(re.findall(r"scene\.(\w+)", code)) <= shown.keys()
    assert set(re.findall(r"scene\.fan\.(\w+)", code)) <= shown["fan"].keys()
    assert set(re.findall(r"\bbody\.(\w+)", code)) <= {*shown["bodies"][0], "array", "count", "type"}


def test_the_table_of_settings_names_the_lowest(page):
    settings = " ".join(page.text["settings"].split())
    assert "The lowest J in the table is -5.0, and 1 setting has it" in settings
    assert "For 25 ways to mount the laser" in settings


def test_the_manifest_in_the_page_is_that_of_the_folder(folder, page, text):
    manifest = manifest_of(folder)
    rows = re.findall(r"<td>([^<]+)</td><td [^>]+>([\d,]+)</td><td><code>([0-9a-f]{64})</code>", text)
    files = {name: {"sha256": digest, "bytes": int(size.replace(",", ""))} for name, size, digest in rows}
    assert files == {name: facts for name, facts in manifest["files"].items() if name != "report.html"}
    for name, version in manifest["versions"].items():
        assert re.search(rf"{re.escape(name)}\s*{re.escape(version)}", page.text["again"])


def test_steps_are_headings_paragraphs_and_lists():
    assert steps_html("# T\n\n## A\n\none\ntwo **b** `c*`\n\n- x\n- y") == (
        "<h3>A</h3>\n<p>one two <b>b</b> <code>c*</code></p>\n<ul><li>x</li><li>y</li></ul>"
    )


@given(st.text(st.characters(exclude_characters="#*`-\r\n", exclude_categories=["C", "Z"]), min_size=1))
def test_a_step_in_plain_words_comes_through_unchanged(words):
    assert html.unescape(steps_html(words)) == f"<p>{words}</p>"
