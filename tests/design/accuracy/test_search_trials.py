"""What a search spends and gains: the report of it, and that of a sweep."""

import csv
from dataclasses import replace
from pathlib import Path

from scanwright.design.accuracy import methods, search_trials
from scanwright.design.accuracy.report import report_precision, report_search
from scanwright.design.progress import no_progress
from scanwright.design.search import families
from scanwright.design.task.task import load_task


def rows_of(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def test_what_is_spent_on_a_search_and_what_it_gains(tmp_path, monkeypatch):
    monkeypatch.setattr(families, "FAMILIES", 1)  # nobody looks at the ones behind
    monkeypatch.setattr(search_trials, "TASKS", 1)
    monkeypatch.setattr(search_trials, "STEPS_DEG", (45.0, 30.0))
    values = {"fineness": (1.0,), "margin": (0.0,), "rounds": (0, 2)}
    efforts = [(choice, field, label, values[field]) for choice, field, label, _ in search_trials.EFFORTS]
    monkeypatch.setattr(search_trials, "EFFORTS", efforts)
    loaded = load_task(Path("ground_ahead"))
    coarse = loaded.task.angles.model_copy(update={"step_deg": 30.0, "alpha_rot_deg": 0.0})
    told = report_search(replace(loaded, task=loaded.task.model_copy(update={"angles": coarse})), tmp_path, no_progress)
    rows = rows_of(tmp_path / "search.csv")
    assert {row["setting"] for row in rows if row["chosen"] == "true"} == {"30 deg", "1 times", "2 rounds"}
    lost = {row["setting"]: float(row["error"]) for row in rows}
    assert min(lost.values()) >= search_trials.LEAST_REGRET
    assert lost["0 rounds"] > 10 * lost["2 rounds"], "an answer of the grid is not refined"
    assert (tmp_path / "search.png").exists() and len(told) == len(rows) + 2


def test_ways_to_compute_J_of_a_sweep(tmp_path, monkeypatch):
    few = {name: (*methods.SWEPT[name][:2], methods.SWEPT[name][2][-1:]) for name in ("directions", "ball count")}
    monkeypatch.setattr(methods, "SWEPT", few)
    monkeypatch.setattr("scanwright.design.accuracy.reference.DRAWN", 2**12)
    loaded = load_task(Path("indoor_urg"))
    fixed = {"alpha_rot_deg": 0.0, "beta_rot_deg": -90.0, "alpha_laser_deg": -90.0, "beta_laser_deg": 90.0}
    angles = loaded.task.angles.model_copy(update=fixed)
    one = replace(loaded, task=loaded.task.model_copy(update={"angles": angles}))
    report_precision(one, tmp_path, no_progress)
    directions, ball = (float(row["error"]) for row in rows_of(tmp_path / "work_precision.csv"))
    assert directions < 2e-3 < ball < 3e-2
