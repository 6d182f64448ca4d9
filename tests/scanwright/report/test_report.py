"""`report.html`: made of the files alone, whole, the same bytes again, nothing fetched, nothing smuggled in."""

import html
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_folder import ANGLES, EVIL, Page, scene_of

from scanwright.cad.checks.checks_json import checks_text
from scanwright.design.findings import Finding
from scanwright.design.objective.holes import percent
from scanwright.design.self_occlusion import AXIS_STEPS, load_self_occlusion
from scanwright.design.task.task import load_task
from scanwright.pipeline.manifest import is_current, read_manifest, write_manifest
from scanwright.report import page as report_page
from scanwright.report.answer import answer
from scanwright.report.assembly_steps import steps_html
from scanwright.report.page import report_html

PAGE = Path(report_page.__file__).parent
CODE = [PAGE / name for name in ("stage.js", "page.js")]
SECTIONS = ["result", "do", "checks", "compare", "parts", "assembly", "wiring", "more"]


def test_every_section_is_there_and_every_link_leads_somewhere(page):
    assert [name for name in page.text if name] == SECTIONS
    assert len(set(page.ids)) == len(page.ids)
    assert {link[1:] for link in page.links if link.startswith("#")} == set(SECTIONS)
    assert "Missing:" not in "".join(page.text.values())


def test_nothing_is_fetched(folder, page, text):
    assert all(link.startswith(("#", "data:")) or (folder / link).is_file() for link in page.links)
    style, code = (PAGE / "style.css").read_text(), "".join(path.read_text() for path in CODE)
    assert not re.search(r"@import|url\(|//", style)
    assert not re.search(r"fetch|XMLHttpRequest|WebSocket|import\b|https?://(?!www\.w3\.org/2000/svg)", code)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)  # the name of SVG is no address
    assert "default-src 'none'; img-src data:" in text  # and the browser is told to refuse
    assert len(text.encode()) < 3e6


def test_the_command_writes_what_the_build_wrote(folder, text, command, monkeypatch):
    before = {name: (folder / name).read_bytes() for name in ("report.html", "manifest.json")}
    (folder / "report.html").write_text("an older one")
    assert command("report", folder) == (0, f"wrote {folder / 'report.html'}\n", [])
    assert {name: (folder / name).read_bytes() for name in before} == before
    assert is_current(folder, load_task(folder / "task.toml"))
    monkeypatch.setattr("scanwright.report.page.report_html", lambda *_: text)
    _, out, _ = command("report", folder, "--json")
    assert json.loads(out)["files"] == ["report.html"]


def test_the_manifest_is_in_the_order_of_a_manifest_written_last(folder, tmp_path):
    entered = read_manifest(folder)
    again = tmp_path / "again"
    shutil.copytree(folder, again, ignore=shutil.ignore_patterns("manifest.json"))
    write_manifest(again, load_task(again / "task.toml"), [])
    assert list(read_manifest(again)["files"]) == list(entered["files"])
    assert read_manifest(again) == entered


def answered(folder):
    return answer(load_task(folder / "task.toml"), ANGLES, load_self_occlusion(folder / "own_body.npz")[0])


def test_the_page_states_what_the_files_state(folder, page):
    result, more = (" ".join(page.text[section].split()) for section in ("result", "more"))
    assert "alpha_rot 0, beta_rot 90 deg" in more and "alpha_laser 0, beta_laser -90 deg" in more
    seen = answered(folder).as_built
    assert f"J = {seen.own.J} +- {seen.own.J_error}, with parts" in more and seen.own.J > ANGLES.J + 0.002
    assert "5,400 to 5,500 USD" in result and "Sum of 4" in page.text["parts"]
    hidden = (100 * AXIS_STEPS + 100 * 180) / (1081 * AXIS_STEPS)
    assert f"{hidden:.1%} of all beams" in more
    # rolling against itself without parts, and 40 lines a second over 18 s
    assert next(mount.factor for mount in seen.mounts if mount.name == "rolling") < 0.998
    assert seen.mounts[0].factor == min(mount.factor for mount in seen.mounts)
    assert f"{seen.mounts[0].factor:.2f} x {seen.mounts[0].name}" in result
    assert f"{1 / seen.mounts[0].factor:.2f}" in page.text["compare"]
    assert f"and {percent(seen.own.blind_fraction)} of the sphere" in more


def test_what_a_setting_sees_agrees_with_other_ways_to_know_it():
    said = answer(load_task(Path("ground_ahead")), ANGLES)
    bonn, upright, rolling, pitching = said.as_built.mounts
    assert [mount.name for mount in (bonn, upright)] == ["Bonn, 45 deg", "upright, one tilt"]
    own = said.as_built.own
    assert rolling.factor == pytest.approx(1, abs=1e-3)
    assert pitching.factor == pytest.approx(np.exp(pitching.seen.J - own.J), abs=1e-3)
    # a blind cone of 45 deg, smaller by the ball of 2 deg; the mask covers part of it
    everywhere = (1 - np.cos(np.radians(43))) / 2
    assert 0 < own.blind_fraction < everywhere
    assert said.masked_fraction == pytest.approx((1 - np.cos(np.radians(25))) / 2, abs=1e-6)
    assert own.line_gap_deg == rolling.seen.line_gap_deg == pytest.approx(0.5)
    assert own == rolling.seen != pitching.seen


def test_another_objective_than_a_logarithm_makes_no_claim_of_factors():
    loaded = load_task(Path("indoor_urg"))
    coarse = {"ball_radius_deg": 4.0, "tolerance": 0.02}
    density = loaded.task.density.model_copy(update={"objective": "homogeneity", **coarse})
    loaded = replace(loaded, task=loaded.task.model_copy(update={"density": density}))
    angles = ANGLES.model_copy(update={"sensor": "URG-04LX", "motion": loaded.task.motion, "J": None})
    found = answer(loaded, angles)
    assert all(mount.factor is None for mount in found.as_built.mounts)
    first = found.as_built.mounts[0].gain
    assert first.J_less == min(mount.gain.J_less for mount in found.as_built.mounts)
    assert f"{first.J_less:+.4f} in J" in first.words() and first.mount.name in first.words()


def test_what_is_in_the_files_stays_text(page, text):
    assert EVIL not in text
    assert page.scripts == 2  # the data of the stage, and the code
    for section in ("checks", "assembly", "more"):
        assert EVIL in page.text[section]


def test_errors_come_first_and_an_unknown_severity_is_one(page, tmp_path):
    assert re.findall(r"(error|warning|note|ok) of", page.text["checks"]) == ["error", "warning", "note", "ok", "ok"]
    assert "Checks: 1 error, 1 warning, 1 note, 2 passed" in " ".join(page.text["checks"].split())
    result = " ".join(page.text["result"].split())
    assert "Do not make this scanner: 1 check failed." in result and "Next: fix 1 failed check" in result
    assert result.index(f"error of {EVIL}") < result.index("What it sees")
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    text = checks_text([Finding("wall", "error", "part", "a new word", 0.99, 1.2, "mm")])
    (tmp_path / "checks.json").write_text(text.replace('"error"', '"fatal"'))
    unknown = Page(report_html(tmp_path)).text["result"]
    assert "1 check failed" in unknown and "part: wall 0.99, limit 1.2 mm" in unknown
    (tmp_path / "checks.json").write_text(text.replace('"error"', '"warning"'))
    warned = " ".join(Page(report_html(tmp_path)).text["result"].split())
    assert "Do not make" not in warned and "No errors. 1 warning to read." in warned


def test_findings_of_one_kind_about_one_subject_are_one_card(tmp_path):
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    findings = [Finding("leads", "warning", "XM540", f"XM540: {n} is wrong") for n in "ab"]
    (tmp_path / "checks.json").write_text(checks_text([*findings, Finding("wall", "warning", "XM540", "thin")]))
    text = report_html(tmp_path)
    assert text.count("<article") == 2 and "<li>a is wrong</li>" in text
    assert "12 wrong" not in text


def test_a_folder_with_nothing_but_angles_has_every_section(tmp_path):
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    bare = Page(report_html(tmp_path))
    assert [name for name in bare.text if name] == SECTIONS
    assert "beta_rot 90" in bare.text["more"]
    for section in set(SECTIONS) - {"do"}:
        assert "Missing:" in bare.text[section]
    assert "canvas" not in bare.ids and bare.scripts == 1


def test_bare_angles_without_motion_ring_or_J(tmp_path):
    bare = {"slip_ring": None, "motion": None, "J": None, "J_error": None, "source": "calibration"}
    (tmp_path / "angles.json").write_text(ANGLES.model_copy(update=bare).to_json())
    page = Page(report_html(tmp_path))
    assert "motion is not known" in page.text["more"] and "angles of a calibration" in page.text["result"]


@pytest.mark.parametrize("content", [b"", b"{", b"PK\3\4", b'{"a": 1}'])
@pytest.mark.parametrize("name", ["checks.json", "left_out.json", "manifest.json", "own_body.npz", "assembly.glb"])
def test_a_file_that_no_build_wrote_is_one_line(name, content, tmp_path, command):
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    (tmp_path / name).write_bytes(content)
    code, out, complaint = command("report", tmp_path)
    assert (code, out, len(complaint)) == (2, "", 1)
    assert complaint[0].startswith(f"error: {tmp_path}") and name in complaint[0]
    assert "build the folder again" in complaint[0]


def test_no_angles_is_one_line(tmp_path, command):
    code, _, complaint = command("report", tmp_path)
    assert code == 2 and len(complaint) == 1 and "angles.json" in complaint[0]


def test_the_code_of_the_page_asks_for_what_is_there(folder, page):
    for path in CODE:
        assert set(re.findall(r'element\("([\w-]+)"\)', path.read_text())) <= set(page.ids)
    code = (PAGE / "stage.js").read_text()
    scene = scene_of((folder / "report.html").read_text())
    assert set(re.findall(r"scene\.(\w+)", code)) <= scene.keys()
    assert set(re.findall(r"scene\.fan\.(\w+)", code)) <= scene["fan"].keys()
    assert set(re.findall(r"scene\.cloud\.(\w+)", code)) <= scene["cloud"].keys()
    assert set(re.findall(r"\bbody\.(\w+)", code)) <= {*scene["bodies"][0], "array", "count", "type"}


def test_one_of_a_thing_is_not_told_as_many(tmp_path):
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    entries = [{"what": "a", "why": "b", "saved": saved, "unit": "parts"} for saved in (1, 2)]
    (tmp_path / "left_out.json").write_text(json.dumps({"schema": "scanwright/left_out/1", "left_out": entries}))
    left_out = Page(report_html(tmp_path)).text["more"]
    assert "1 part" in left_out and "1 parts" not in left_out and "2 parts" in left_out


def test_the_page_has_the_versions_of_the_manifest(folder, page):
    for name, version in read_manifest(folder)["versions"].items():
        assert re.search(rf"{re.escape(name)}\s*{re.escape(version)}", page.text["more"])


def test_steps_are_headings_paragraphs_and_lists():
    assert steps_html("# T\n\n## A\n\none\ntwo **b** `c*`\n\n- x\n- y") == (
        "<h3>A</h3>\n<p>one two <b>b</b> <code>c*</code></p>\n<ul><li>x</li><li>y</li></ul>"
    )


def test_a_picture_of_the_steps_stands_in_the_page_itself():
    shown = steps_html("## A\n\n![A <b>](a.png)\n\n![B](b.png)", {"a.png": "data:image/png;base64,AA=="}.get)
    image = '<img src="data:image/png;base64,AA==" alt="A &lt;b&gt;">'
    assert shown == f'<h3>A</h3>\n<div class="picture">{image}</div>\n<p>![B](b.png)</p>'


@given(st.text(st.characters(exclude_characters="#*`-\r\n", exclude_categories=["C", "Z"]), min_size=1))
def test_a_step_in_plain_words_comes_through_unchanged(words):
    assert html.unescape(steps_html(words)) == f"<p>{words}</p>"
