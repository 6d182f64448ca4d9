"""Console, report, `evaluate` and `compare` state the same numbers of one build, and say whether parts are in them."""

import csv
import html
import json
import re

import pytest
from quick_tests import samples

import scanwright.api as sw
from scanwright.design.task.task import shipped_tasks
from scanwright.pipeline.built_scanner import is_build_folder, open_built


@pytest.fixture
def built(request, made, tmp_path):
    """A build folder and what its command printed: the tilted scanner of the tests, or a shipped task."""
    if request.param == "tilted":
        return made.folder, made.lines
    found = sw.build(request.param, tmp_path)
    return found.folder, found.lines()


def words_of(page):
    """The text of a page, without tags."""
    shown = re.sub(r"<(script|style).*?</\1>", " ", page[page.index("<body") :], flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", shown)).split())


@pytest.mark.parametrize("built", samples(["tilted", *shipped_tasks()], ["tilted"]), indirect=True)
def test_every_place_states_the_same_numbers_of_a_build(built, command):
    folder, lines = built
    stated = [line for line in lines if line.startswith("with parts")]
    code, out, _ = command("evaluate", folder)
    assert code == 0
    told, without = out.split("\nwithout parts:\n")
    assert [line for line in told.splitlines() if line.startswith("with parts")] == stated
    (expected,) = (line for line in lines if line.startswith("expect "))
    assert expected in told.splitlines() and "bending unknown" not in expected
    assert "with parts" not in without

    facts = json.loads(command("evaluate", folder, "--json")[1])
    seen = facts["as_built"]
    assert seen["with_parts"] and not facts["with_parts"]
    report = words_of((folder / "report.html").read_text(encoding="utf-8"))
    own = seen["own"]
    assert f"J = {own['J']:g} +- {own['J_error']:g}" in told
    blocked = re.search(r"which block (\S+) of the beams", told)[1]
    assert (f"Parts block {blocked}." in report) == (seen["blocked"] > 0)
    weight, sphere = re.search(r"never seen: (\S+) of the weight, (\S+) of the unmasked", told).groups()
    assert f"{weight} of the region of interest, and {sphere} of the sphere, with parts" in report
    assert f"{own['J']} +- {own['J_error']}, with parts" in report
    for words in own["blind"]:
        assert words.partition(":")[0].removeprefix("blind ") in report and f"with parts: {words}" in told
    for mount in seen["mounts"]:
        if mount["factor"] is not None:
            assert f"{mount['factor']:.2f} x {mount['name']}" in report
            assert f"{mount['factor']:.2f} x {mount['name']} (" in told and f": J = {mount['J']:.4f}" in told
    factors = [mount["factor"] for mount in seen["mounts"]]
    assert factors == sorted(factors) and len(factors) == 4


@pytest.fixture(scope="module")
def evaluated(made):
    """What the tilted scanner sees, as built."""
    return sw.evaluate(made.folder)


def test_compare_puts_a_build_before_what_has_no_parts(made, evaluated, command, tmp_path):
    code, out, _ = command("compare", made.folder, "--out", tmp_path, "-v")
    assert code == 0
    with (tmp_path / "tilted/compare.csv").open(newline="") as file:
        first, optimum, *_ = csv.DictReader(file)
    seen = evaluated.as_built.own
    assert (first["name"], optimum["name"]) == ("as built, with parts", "optimum")
    assert float(first["blind_weight"]) == seen.blind_weight and float(first["blind_fraction"]) == seen.blind_fraction
    assert float(first["J"]) == pytest.approx(seen.J, abs=seen.J_error)
    assert "parts: all rows but 'as built, with parts' are without parts" in out


def test_another_setting_of_a_build_folder_is_judged_without_its_parts(made, evaluated):
    assert evaluated.as_built is not None
    assert sw.evaluate(made.folder, (0, 35, -20, -70)).as_built is not None
    assert sw.evaluate(made.folder, (0, 30, -20, -70)).as_built is None
    assert sw.evaluate(open_built(made.folder).loaded, (0, 35, -20, -70)).as_built is None


def test_angles_may_be_left_out_for_a_build_folder_only(command):
    code, _, (complaint,) = command("evaluate", "uniform")
    assert code == 2 and "--angles" in complaint and "required unless TASK is a build folder" in complaint


def test_the_name_of_a_shipped_task_means_the_task(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("ceiling", "mine"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "angles.json").write_text("{}")
    assert [is_build_folder(tmp_path / name) for name in ("ceiling", "mine")] == [True, True]
    from pathlib import Path

    assert [is_build_folder(Path(name)) for name in ("ceiling", "mine", "nowhere")] == [False, True, False]
