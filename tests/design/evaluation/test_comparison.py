"""The comparison: multibeams against ball search, its optimum against `optimise`, its files against themselves."""

import csv
import json
import re
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from quick_tests import samples
from scans import count_at

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.products import Multibeam
from scanwright.design.density.beams import beam_directions_rot, polar_and_azimuth
from scanwright.design.density.spin import ball_search
from scanwright.design.density.sweep import SweepLines
from scanwright.design.errors import BuildError
from scanwright.design.evaluation import comparison as comparison
from scanwright.design.evaluation.comparison import (
    ComparisonRow,
    compare,
    layer_lines,
    multibeam_scan,
    ready_made,
    sampled,
)
from scanwright.design.evaluation.comparison_picture import compare_picture
from scanwright.design.evaluation.comparison_table import notes, table, write_csv
from scanwright.design.frames import R_rot_laser, R_world_rot
from scanwright.design.objective.ball_search import SETS
from scanwright.design.objective.named_objectives import homogeneity, log_density
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.progress import no_progress
from scanwright.design.search.mounts.reference import reference_mounts
from scanwright.design.search.optimum import find_optimum
from scanwright.design.sphere.directions import sample_set, spiral
from scanwright.design.task.task import load_task
from scanwright.pipeline.folder import report_folder

FULL = ("VLP-16", "HDL-32E", "HDL-64E")
FIELDS = dict(ComparisonRow.__annotations__)


def multibeam(name):
    return load_catalogue().get(name, Multibeam)


@pytest.fixture(scope="module")
def optimum():
    """Of the shipped task with the fewest settings."""
    return find_optimum(load_task(Path("ceiling")), no_progress)


@pytest.fixture(scope="module")
def ceiling(optimum):
    """The task, its numbers and its search."""
    return optimum.loaded, optimum.problem, optimum.search


@pytest.fixture(scope="module")
def rows(ceiling):
    loaded, problem, result = ceiling
    return compare(loaded, problem, result.best[0], reference_mounts(problem, loaded.task))


# typed from the makers' tables: see the sources in the files
@pytest.mark.parametrize(
    ("name", "elevations_deg", "azimuth_deg", "rate_hz", "per_second", "price_usd"),
    [
        ("VLP-16", np.arange(-15, 16, 2), 360, 10, 300_000, 8_000),
        ("HDL-32E", np.linspace(-92 / 3, 32 / 3, 32), 360, 10, 700_000, 30_000),
        ("HDL-64E", [*np.arange(-24.33, -8.8, 0.5), *np.linspace(2 - 31 / 3, 2, 32)], 360, 10, 1_333_000, 75_000),
        ("ibeo LUX", [-1.2, -0.4, 0.4, 1.2], 85, 12.5, 17_000, None),
    ],
)
def test_the_tables_of_the_ready_made_scanners(name, elevations_deg, azimuth_deg, rate_hz, per_second, price_usd):
    product = multibeam(name)
    np.testing.assert_allclose(product.elevations_deg, elevations_deg, atol=0.006)
    assert np.ptp(product.azimuth_deg) == azimuth_deg
    assert product.turn_rate_hz == rate_hz
    assert product.points_per_second == per_second
    assert product.price_usd == price_usd
    made = layer_lines(product).count * len(product.elevations_deg) * rate_hz
    assert made == pytest.approx(per_second, rel=0.04), "layers, step and rate make the points that the maker states"


@pytest.mark.parametrize("name", FULL)
def test_a_multibeam_is_a_fan_that_holds_the_axis(name):
    """The closed form at single directions, and the explicit scan: exactly the same counts."""
    product = multibeam(name)
    lines, ball = layer_lines(product), np.radians(2)
    polar, azimuth = polar_and_azimuth(
        beam_directions_rot(np.radians(product.elevations_deg), *comparison.UPRIGHT_RAD[2:])
    )
    np.testing.assert_allclose(np.degrees(polar), 90 - np.array(product.elevations_deg), atol=1e-9)
    directions = spiral(400)
    counts = ball_search(multibeam_scan(product), directions, ball)
    t, p = polar_and_azimuth(directions)
    closed = [count_at(t[i], p[i] + np.pi, polar, azimuth, lines, ball) for i in range(len(t))]
    np.testing.assert_array_equal(closed, counts)
    assert counts.max() > 0


@pytest.mark.parametrize("name", FULL)
@pytest.mark.parametrize("turns", samples([1, 20], [20]))
def test_the_zonal_J_agrees_with_the_sampled_one(ceiling, name, turns):
    _, problem, _ = ceiling
    row = ready_made(problem, multibeam(name), turns)
    J, J_error, blind_fraction, blind_weight = sampled(problem, multibeam(name), turns)
    assert abs(row.J - J) <= row.J_error + J_error
    assert max(row.J_error, J_error) < 5e-3
    assert row.blind_fraction == pytest.approx(blind_fraction, abs=2e-3)
    assert row.blind_weight == pytest.approx(blind_weight, abs=2e-3)


@pytest.mark.parametrize("ball_deg", samples([0.5, 2], [2]))
@pytest.mark.parametrize("starts", [[0.3, 0.3, 0.3], [0.1, 0.1 + 1 / 3, 0.1 + 2 / 3], [0.82, 0.05, 0.33]])
def test_turns_may_repeat_or_interlace_and_stay_within_the_stated_error(ceiling, ball_deg, starts):
    _, problem, _ = ceiling
    problem = replace(problem, ball_rad=np.radians(ball_deg))
    product = multibeam("VLP-16")
    row = ready_made(problem, product, len(starts))
    scans = np.concatenate([multibeam_scan(product, start) for start in starts])
    J = [
        log_density(ball_search(scans, samples.directions, problem.ball_rad)) @ samples.weights / samples.weights.sum()
        for samples in (sample_set(problem.field, problem.grid_step_deg, 10_000, k) for k in range(SETS))
    ]
    assert abs(np.mean(J) - row.J) <= row.J_error + 4 * np.std(J, ddof=1) / 2


def test_the_lux_sees_a_strip_ahead(ceiling):
    _, problem, _ = ceiling
    row = ready_made(problem, multibeam("ibeo LUX"), 1)
    # all within 2 deg of 85 x 2.4 deg: a strip 6.4 deg high, and rounded ends beyond it
    ball, high = np.radians([2, 2.4])
    seen = np.radians(85) * 2 * np.sin(high / 2 + ball) + np.pi * ball**2 + 2 * ball * high
    assert 1 - row.blind_fraction == pytest.approx(seen / (4 * np.pi), rel=0.01)
    assert row.J < 0


def test_the_optimum_is_that_of_optimise_and_the_mounts_are_what_they_are_called(ceiling, rows):
    loaded, problem, result = ceiling
    by_name = {row.name: row for row in rows}
    best = result.best[0]
    assert (by_name["optimum"].J, by_name["optimum"].J_error) == (best.score.J, best.score.J_error)
    for name, setting in (("rolling", [0, 90, 0, -90]), ("pitching", [-90, 0, 90, 0])):
        assert by_name[name].J == score(problem, np.radians(setting)).J
    bonn = np.radians([float(x) for x in by_name["Bonn, 45 deg"].setting.strip("()").split(",")])
    axis = R_world_rot(*bonn[:2])[:, 2]
    np.testing.assert_allclose(axis, [0.5**0.5, 0, -(0.5**0.5)], atol=1e-12)
    assert abs(R_rot_laser(*bonn[2:])[2, 2]) < 1e-12, "the scan plane holds the axis"
    assert 0 <= np.degrees(np.arccos(R_rot_laser(*bonn[2:])[2, 0])) <= 45, "the heading is near the axis"
    tilt = [float(x) for x in by_name["upright, one tilt"].setting.strip("()").split(",")]
    assert tilt[:3] == [180, 0, 0], "as the task has its axis: down"
    at = score(problem, np.radians(tilt)).J
    assert all(at - 1e-3 <= score(problem, np.radians([0, 0, 0, beta])).J for beta in np.arange(-90, 91, 10))
    assert all(at - 1e-3 <= score(problem, np.radians([0, 0, alpha, 0])).J for alpha in np.arange(-90, 91, 10))
    assert loaded.task.motion.period_s == by_name["rolling"].time_s
    assert by_name["rolling"].cost_usd == 5000 + 300 + 130
    assert by_name["rolling"].layers == 1081


def test_ready_made_scanners_have_a_row_for_one_turn_and_one_for_the_period(rows):
    for name, turns in {"VLP-16": 180, "HDL-32E": 180, "HDL-64E": 180, "ibeo LUX": 225}.items():
        one, whole = (row for row in rows if row.name == name)
        assert (one.turns, whole.turns) == (1, turns)
        assert whole.time_s == pytest.approx(18)
        assert whole.J < one.J
        assert whole.blind_weight == one.blind_weight
        assert whole.gap_deg == max(np.diff(multibeam(name).elevations_deg))


def test_a_period_shorter_than_one_turn_still_has_one_turn(ceiling):
    loaded, problem, result = ceiling
    motion = loaded.task.motion.model_copy(update={"period_s": 0.09})
    short = replace(loaded, task=loaded.task.model_copy(update={"motion": motion}))
    rows = compare(short, problem, result.best[0], ())
    assert [row.turns for row in rows if row.name in FULL] == [1, 1, 1]


def test_the_csv_holds_the_rows(rows, tmp_path):
    write_csv(tmp_path / "c.csv", rows)
    with (tmp_path / "c.csv").open(encoding="utf-8", newline="") as file:
        read = list(csv.DictReader(file))
    kinds = {"str": str, "int": int, "float": float, "float | None": lambda text: float(text) if text else None}
    assert [ComparisonRow(**{key: kinds[FIELDS[key]](text) for key, text in line.items()}) for line in read] == rows


def test_what_sees_nothing_is_blind_to_all_of_the_weight_and_no_more(ceiling, rows):
    loaded, _, _ = ceiling
    up = load_task(
        loaded.task.model_dump(mode="json", exclude_none=True)
        | {"weight": [{"shape": "cone", "axis": [0, 0, 1], "half_angle_deg": 40}]}
    )
    row = ready_made(problem_of(up), multibeam("ibeo LUX"), 1)
    assert (row.J, row.blind_weight) == (0.0, 1.0)
    told = [line for line in notes(up, [row]) if line.startswith("ibeo LUX")]
    assert told == ["ibeo LUX sees nothing of the weight: its J is that of no beam, and has no error"]
    assert not [line for line in notes(loaded, rows) if "sees nothing" in line]


def test_what_j_alone_would_take_is_told_without_a_table(optimum_ahead):
    (_, first, _), (_, alone, _) = optimum_ahead.hole_lines(), optimum_ahead.hole_lines(tabled=False)
    assert first.startswith("if blind spots were allowed, the last row would be best; it is blind ahead and ")
    assert re.search(r"allowed, \(-?[\d.]+, -5\d.*\) with J = -6\.12\d\d would be best", alone)


def test_a_price_that_nobody_knows_is_a_question_mark(rows):
    lines = table(rows)
    assert len({len(line) for line in lines}) == 1, "columns stand below each other"
    assert [line.split()[-1] for line, row in zip(lines[1:], rows, strict=True) if row.cost_usd is None] == ["?", "?"]


def test_the_cheap_scanner_stands_beside_with_what_a_dollar_sees(ceiling, rows):
    """Its own products, motion and angles, judged for this task: J by ball search over its own beams."""
    _, problem, _ = ceiling
    row = next(row for row in rows if row.name == "low_cost")
    assert not [row for row in rows if row.name == "ground_ahead"], "the task has the products of that one"
    cheap = load_task(Path("low_cost"))
    assert row.time_s == cheap.task.motion.duration_s
    assert row.cost_usd == cheap.lidar.price_usd + cheap.servo.price_usd
    assert (row.range_stated_m, row.range_practical_m, row.range_sigma_mm) == (25, 10, 15)
    assert (rows[0].range_stated_m, rows[0].range_practical_m) == (30, 15), "what its maker states, what users get"
    assert row.beams_per_ball == pytest.approx(np.exp(-row.J) - 1)
    assert row.beams_per_ball_per_usd == pytest.approx(row.beams_per_ball / row.cost_usd)
    fan = beam_directions_rot(cheap.lidar.bearings_rad(), 0.0, np.radians(50.0))
    lines = SweepLines(cheap.task.motion, cheap.lidar.scan_rate_hz)
    J = []
    for k in range(SETS):
        joint_rad = lines.angles_rad((k + 0.5) / SETS)  # the start phases of the mean
        seen = np.concatenate([fan @ R_world_rot(0, 0, angle).T for angle in joint_rad])
        samples = sample_set(problem.field, problem.grid_step_deg, 10_000, k)
        counts = ball_search(seen, samples.directions, problem.ball_rad)
        J.append(log_density(counts) @ samples.weights / samples.weights.sum())
    assert abs(np.mean(J) - row.J) <= row.J_error + 4 * np.std(J, ddof=1) / SETS**0.5


def test_another_objective_has_no_beams_per_dollar(ceiling):
    _, problem, _ = ceiling
    row = ready_made(problem.with_objective(homogeneity(problem.field)), multibeam("VLP-16"), 1)
    assert (row.beams_per_ball, row.beams_per_ball_per_usd) == (None, None)


def test_the_picture_names_every_candidate(rows, tmp_path):
    compare_picture(tmp_path / "c.png", rows, "ceiling")
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")


def test_the_command_end_to_end(command, tmp_path, rows):
    code, out, err = command("compare", "ceiling", "--out", tmp_path, "-v")
    assert (code, err) == (0, [])
    assert out.splitlines()[: len(rows) + 1] == table(rows)
    assert "optimum:   1.00 x upright" in out
    assert "not verified of HDL-64E: elevations_deg" in out
    assert "not verified of XL430-W250: price_usd" in out
    assert "not verified of UTM-30LX" not in out and "not verified of MX-64R" not in out
    assert sorted(path.name for path in (tmp_path / "ceiling").iterdir()) == [
        "compare.csv",
        "compare.png",
        "compare.svg",
    ]


def test_the_command_as_json(command, tmp_path, rows, optimum, monkeypatch):
    monkeypatch.setattr("scanwright.pipeline.comparison.find_optimum", lambda *_: optimum)
    monkeypatch.setattr("scanwright.pipeline.comparison.compare", lambda *_: rows)
    monkeypatch.setattr("scanwright.pipeline.comparison.compare_picture", lambda *_: None)
    code, out, _ = command("compare", "ceiling", "--json", "--out", tmp_path)
    assert code == 0
    facts = json.loads(out)
    factors = [gain["factor"] for gain in facts.pop("gains")]
    assert factors == sorted(factors) and len(factors) == 4
    assert facts == {"task": "ceiling", "rows": [asdict(row) for row in rows]}


def test_a_build_folder_is_left_alone(command, tmp_path):
    (tmp_path / "ceiling").mkdir()
    (tmp_path / "ceiling/manifest.json").write_text('{"files": {}}')
    code, _, err = command("compare", "ceiling", "--out", tmp_path)
    assert code == 2
    assert len(err) == 1
    assert "build folder" in err[0]
    assert [path.name for path in (tmp_path / "ceiling").iterdir()] == ["manifest.json"]


def test_wrong_input_is_one_line_and_leaves_no_folder(command, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, err = command("compare", "ceiling", "--out", tmp_path / "file")
    assert (code, len(err)) == (2, 1)
    assert "cannot write" in err[0]
    code, _, err = command("compare", "ceilling", "--out", tmp_path)
    assert (code, len(err)) == (2, 1)
    assert "ceiling" in err[0]
    with pytest.raises(BuildError), report_folder(tmp_path / "new"):
        raise OSError(28, "No space left on device")
    assert not (tmp_path / "new").exists()
