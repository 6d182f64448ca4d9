"""Trials of numerical choices: closed forms, and the commands that print them; the stiff and extreme cases."""

import csv
from dataclasses import replace
from math import cos, pi
from pathlib import Path

import cadquery as cq
import pytest

from benchmarks.trials import axis, choices, meshes, search_effort, stress
from benchmarks.trials import solver as solvers
from scanwright.design.accuracy.trials import Trial, best_trials
from scanwright.design.progress import no_progress
from scanwright.design.search import families
from scanwright.design.task.task import load_task
from scanwright.firmware_io.emulators.servo_plant import plant_of


def rows_of(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def trial(error, *seconds, choice="c"):
    return Trial(choice, "m", "s", error, "mm", seconds)


def test_the_front_is_what_nothing_beats_within_one_choice():
    fast, near, slow, other = trial(1.0, 0.1), trial(0.1, 1.0), trial(1.0, 0.2), trial(0.01, 0.01, choice="d")
    everything = [fast, near, slow, other]
    assert best_trials(everything) == [True, True, False, True]


@pytest.mark.parametrize("radius", [3.0, 40.0])
def test_the_error_of_a_mesh_is_the_sagitta_of_its_chords(radius, monkeypatch):
    monkeypatch.setattr(meshes, "CHORDS", (0.1,))
    rod = cq.Workplane().circle(radius).extrude(5).val()
    for found in meshes.mesh_trials({"rod": rod}, no_progress):
        sides = (int(found.size.split()[0].replace(",", "")) + 4) // 4  # two triangles a side, and two fans of n - 2
        assert found.error == pytest.approx(radius * (1 - cos(pi / sides)), rel=1e-3)


def test_a_tighter_tolerance_of_the_integrator_is_nearer(monkeypatch):
    monkeypatch.setattr(solvers, "TOLERANCES", (1e-3, 1e-6, 1e-8))
    monkeypatch.setattr(solvers, "METHODS", ("LSODA", "Radau"))
    found = list(solvers.solver_trials(plant_of("MX-64R"), no_progress))
    for method in ("LSODA", "Radau"):
        errors = [t.error for t in found if t.method == method]
        assert errors == sorted(errors, reverse=True) and errors[-1] < 1e-5
    assert [t.setting for t in found if t.chosen] == ["1e-06"]


def test_the_orders_between_samples_are_ordered(monkeypatch):
    monkeypatch.setattr(axis, "BEAMS", 20_000)
    held, line, cubic, smoothed = (trial.error for trial in axis.axis_trials(no_progress))
    assert smoothed < line / 3 and line < held / 3
    assert cubic > line  # through the samples means through their steps


def test_the_command_reports_every_choice_and_the_chosen_one(monkeypatch, tmp_path, capsys, cheapest_task):
    monkeypatch.setattr(meshes, "ANGLES", (0.5, meshes.CHORD_ANGLE))
    monkeypatch.setattr(meshes, "CHORDS", (meshes.CHORD_ERROR,))
    monkeypatch.setattr(solvers, "TOLERANCES", (1e-6,))
    monkeypatch.setattr(solvers, "METHODS", ("LSODA", "Radau"))
    monkeypatch.setattr(axis, "BEAMS", 20_000)
    (tmp_path / "ahead.toml").write_text(cheapest_task)
    choices.main([str(tmp_path / "ahead.toml"), "--out", str(tmp_path)])
    out, rows = capsys.readouterr().out, rows_of(tmp_path / "ahead/choices.csv")
    assert len({row["choice"] for row in rows}) == 3 == sum(row["chosen"] == "true" for row in rows)
    assert all(float(row["error"]) > 0 and float(row["seconds_median"]) > 0 for row in rows)
    assert "chosen" in out and (tmp_path / "ahead" / "choices.png").stat().st_size > 10_000


def test_what_is_spent_on_a_search_and_what_it_gains(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(families, "FAMILIES", 1)  # nobody looks at the ones behind
    monkeypatch.setattr(search_effort, "TASKS", 1)
    monkeypatch.setattr(search_effort, "STEPS_DEG", (45.0, 30.0))
    values = {"fineness": (1.0,), "margin": (0.0,), "rounds": (0, 2)}
    efforts = [(choice, field, label, values[field]) for choice, field, label, _ in search_effort.EFFORTS]
    monkeypatch.setattr(search_effort, "EFFORTS", efforts)
    loaded = load_task(Path("ground_ahead"))
    coarse = loaded.task.angles.model_copy(update={"step_deg": 30.0, "alpha_rot_deg": 0.0})
    one = replace(loaded, task=loaded.task.model_copy(update={"angles": coarse}))
    monkeypatch.setattr(search_effort, "load_task", lambda _: one)
    search_effort.main(["--out", str(tmp_path)])
    told = capsys.readouterr().out.splitlines()
    rows = rows_of(tmp_path / "ground_ahead/search.csv")
    assert {row["setting"] for row in rows if row["chosen"] == "true"} == {"30 deg", "1 times", "2 rounds"}
    lost = {row["setting"]: float(row["error"]) for row in rows}
    assert min(lost.values()) >= search_effort.LEAST_REGRET
    assert lost["0 rounds"] > 10 * lost["2 rounds"], "an answer of the grid is not refined"
    assert (tmp_path / "ground_ahead/search.png").exists() and len(told) == len(rows) + 2


def test_every_stress_case_passes(tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        stress.main(["--out", str(tmp_path)])
    rows = rows_of(tmp_path / "uniform/stress.csv")
    assert len(rows) > 40
    assert [row for row in rows if row["passed"] != "True"] == []
    assert not stop.value.code
    assert f"{len(rows)} of {len(rows)}" in capsys.readouterr().out
