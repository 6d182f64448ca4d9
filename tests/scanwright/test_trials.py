"""Error against run time of the choices beside J: closed forms, and the command that reports them."""

import csv
from math import cos, pi

import cadquery as cq
import pytest

from scanwright.cad.geometry import mesh_trials as meshes
from scanwright.design.accuracy.trials import Trial, best_trials
from scanwright.design.progress import no_progress
from scanwright.firmware_io.emulators.servo_plant import plant_of
from scanwright.trials import axis
from scanwright.trials import solver as solvers


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


def test_the_command_reports_every_choice_and_the_chosen_one(command, monkeypatch, tmp_path, cheapest_task):
    monkeypatch.setattr(meshes, "ANGLES", (0.5, meshes.CHORD_ANGLE))
    monkeypatch.setattr(meshes, "CHORDS", (meshes.CHORD_ERROR,))
    monkeypatch.setattr(solvers, "TOLERANCES", (1e-6,))
    monkeypatch.setattr(axis, "BEAMS", 20_000)
    (tmp_path / "ahead.toml").write_text(cheapest_task)
    code, out, _ = command("accuracy", tmp_path / "ahead.toml", "--choices", "--out", tmp_path, "--json")
    assert code == 0
    with (tmp_path / "ahead" / "choices.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len({row["choice"] for row in rows}) == 3 == sum(row["chosen"] == "true" for row in rows)
    assert all(float(row["error"]) > 0 and float(row["seconds_median"]) > 0 for row in rows)
    assert "chosen" in out and (tmp_path / "ahead" / "choices.png").stat().st_size > 10_000
