"""A study from its command to its table: one candidate with its solids, and one that its bound rules out."""

import csv
from pathlib import Path

import pytest

TABLES = ("study.csv", "study.parquet")
STUDY = 'name = "two"\ntasks = ["ahead.toml"]\nservos = ["AX-12A", "MX-64R"]\nfront = ["cost_usd", "J"]\nwinners = 0\n'


def test_two_candidates_from_the_command_to_the_table(tmp_path, cheapest_task, command):
    (tmp_path / "ahead.toml").write_text(cheapest_task)
    (tmp_path / "two.toml").write_text(STUDY)
    out = tmp_path / "out"
    code, printed, complaint = command("study", tmp_path / "two.toml", "--out", out, "--processes", 1)
    assert (code, complaint) == (0, [])
    assert "2 candidates: 1 front (on the front of their task), 1 dominated" in printed
    # both servos look the same way, and the dearer one cannot make up for its price
    assert "this run: 1 searches, 1 candidates made, 0 looked up, 1 beaten before they were made" in printed
    cheap, dear = csv.DictReader((out / "study.csv").read_text().splitlines())
    assert (cheap["name"], cheap["status"]) == ("ahead-AX-12A", "front")
    assert (dear["status"], dear["reason"]) == ("dominated", "not made: ahead-AX-12A beats its bound")
    assert (out / "front.png").stat().st_size > 10_000
    agrees_with_the_parts(cheap, tmp_path / "ahead.toml")
    again = tmp_path / "again"
    code, printed, _ = command("study", tmp_path / "two.toml", "--out", again, "--results", out / "results")
    assert code == 0
    assert "this run: 0 searches, 0 candidates made, 1 looked up" in printed
    assert [(again / name).read_bytes() for name in TABLES] == [(out / name).read_bytes() for name in TABLES]


def agrees_with_the_parts(row, task):
    """The numbers of a row by other ways: weighed solid by solid, J of the beams that get past the parts."""
    import numpy as np

    from scanwright.cad.assembly.shadow import PartsWorkshop
    from scanwright.design.angles import Angles, AngleSet
    from scanwright.design.objective.problem import problem_of
    from scanwright.design.objective.score import score
    from scanwright.design.scanner import scanner_of
    from scanwright.design.task.task import load_task

    loaded = load_task(Path(task))
    angles = Angles(alpha_rot=0, beta_rot=0, alpha_laser=0, beta_laser=-60)
    motion = loaded.task.motion
    record = AngleSet(task="ahead", angles_deg=angles, sensor="URG-04LX", servo="AX-12A", slip_ring=None, motion=motion)
    scanner = scanner_of(record, loaded.task.printer, loaded.products)
    workshop = PartsWorkshop(scanner)
    assembly = workshop.assembly(scanner)
    density = {"servo_shaft": 2.7, "journal_sleeve": 2.7}  # turned from aluminium
    made = sum(s.Volume() / 1000 * density.get(n, scanner.printer.density_g_cm3) for n, s in assembly.made.items())
    devices = loaded.lidar.mass_g + loaded.servo.mass_g
    cables = sum(lead.mass_g for lead in assembly.layout.cables)
    assert float(row["mass_g"]) == pytest.approx(made + devices + cables, rel=1e-4)
    assert float(row["cost_usd"]) == loaded.lidar.price_usd + loaded.servo.price_usd
    setting = np.radians([0.0, 0.0, 0.0, -60.0])
    shadow = workshop.shadow(setting)
    assert float(row["hidden_fraction"]) == pytest.approx(shadow.hidden().mean(), rel=1e-5)
    problem = problem_of(loaded)
    bare = score(problem, setting).J
    assert bare - 1e-3 <= float(row["J"]) <= bare + 0.2
