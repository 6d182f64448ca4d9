"""The front door: help, errors in one line with exit 2, and what the commands print."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import scanwright
from scanwright.cli import app
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.task.task import SHIPPED

GROUND = (SHIPPED / "ground_ahead.toml").read_text()
RING = """kind = "slip_ring"
name = "CAPSULE"
maker = "any"
bore_mm = { value = 0.0, source = "a capsule", verified = true }
outer_diameter_mm = { value = 22.0, source = "a capsule", verified = true }
length_mm = { value = 30.0, source = "a capsule", verified = true }
mass_g = { value = 50.0, source = "a capsule", verified = true }
circuits = { value = "USB", source = "a capsule", verified = true }
"""


def test_help_names_every_command_and_loads_no_heavy_library():
    shown = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "scanwright", "--help"], capture_output=True, text=True, check=True
    )
    for name in ("build", "optimise", "evaluate", "import", "assemble", "catalogue", "schema"):
        assert f"\n  {name} " in shown.stdout
    loaded = {line.split("|")[-1].strip() for line in shown.stderr.splitlines()}
    assert not loaded & {"numpy", "scipy", "numba", "pydantic", "cadquery", "matplotlib", "trimesh", "rich"}


def test_the_front_door_imports_no_kernel_and_no_wire():
    tree = ast.parse(Path(app.__file__).read_text())
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    modules |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    assert not {str(module).split(".")[0] for module in modules} & {"cadquery", "OCP", "serial", "dynamixel_sdk"}


def bad_task(change):
    old, new = change
    assert old in GROUND
    return GROUND.replace(old, new)


WRONG_TASKS = [
    (("sensor =", "sensr ="), ["sensr", "did you mean 'sensor'"]),
    (("period_s", "period_ms"), ["motion.period_ms", "did you mean 'period_s'"]),
    (("theta_deg", "theta_rad"), ["weight.0.theta_rad", "did you mean 'theta_deg'"]),
    (('"UTM-30LX"', '"UTM-30X"'), ["UTM-30X", "did you mean 'UTM-30LX'"]),
    (('"MX-64R"', '"MX64"'), ["MX64", "did you mean 'MX-64R'"]),
    (('"SNU11-P0210"', '"SNU11"'), ["SNU11", "slip ring"]),
    (('"fdm-0.4"', '"fdm"'), ["fdm", "printer"]),
    (("value = 1.0", "value = nan"), ["weight.0.value", "nan"]),
    (("value = 1.0", "value = -1.0"), ["weight.0.value", "-1.0"]),
    (("value = 1.0", "value = 0.0"), ["task.toml", "region is empty"]),
    (("ball_radius_deg = 2.0", "ball_radius_deg = 2.0\ntolerance = 1e-12"), ["task.toml", "density.tolerance = 1e-12"]),
    (('name = "ground_ahead"', 'name = "../ground"'), ["name", "../ground", "path"]),
    (('name = "ground_ahead"', 'name = "a/b"'), ["name", "a/b"]),
    (("[95, 150]", "[150, 95]"), ["weight.0", "theta_deg"]),
    (("[95, 150]", "[95, 190]"), ["weight.0", "theta_deg"]),
    (('shape = "band"', 'shape = "bond"'), ["bond", "'band'"]),
    (('shape = "band"', ""), ["weight.0.shape", "required", "'band'"]),
    (('name = "ground_ahead"', 'name = "a b"'), ["name = 'a b'", "letters, digits"]),
    (("period_s = 18.0", "period_s = 0"), ["motion.period_s = 0"]),
    (("period_s = 18.0", 'period_s = "18 s"'), ["motion.period_s", "18 s"]),
    (('mode = "spin"', 'mode = "wobble"'), ["motion.mode", "wobble"]),
    (("[-180, 180]", "[-270, 180]"), ["angles", "alpha_rot_deg"]),
    (("step_deg = 5.0", "step_deg = 0"), ["angles.step_deg = 0"]),
    (("axis = [-1.0, 0.0, -0.5]", "axis = [0, 0, 0]"), ["mask.0", "axis"]),
    (("half_angle_deg = 25", "half_angle_deg = 0"), ["mask.0", "half_angle_deg"]),
    (('slip_ring = "SNU11-P0210"', ""), ["slip_ring", "needs a slip ring"]),
    (('slip_ring = "SNU11-P0210"', 'slip_ring = "CAPSULE"\ncatalogue = ["ring.toml"]'), ["bore_mm = 0"]),
    (("[motion]", "[motion"), ["not a TOML file"]),
    (("ball_radius_deg = 2.0", "ball_radius_deg = 120"), ["density.ball_radius_deg", "90"]),
]


@pytest.mark.parametrize(("change", "words"), WRONG_TASKS, ids=[str(change[1]) for change, _ in WRONG_TASKS])
def test_a_wrong_task_is_one_line_exit_2_and_no_file(command, tmp_path, change, words):
    task = tmp_path / "task.toml"
    task.write_text(bad_task(change))
    (tmp_path / "ring.toml").write_text(RING)
    code, _, complaint = command("build", task, "--out", tmp_path / "out")
    assert code == 2
    assert len(complaint) == 1
    for word in words:
        assert word in complaint[0]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["optimise", "no_such_task"], "ground_ahead"),
        (["optimise", "missing.toml"], "missing.toml"),
        (
            ["evaluate", "uniform", "--angles=0,90,0"],
            "--angles = '0,90,0': must be A_ROT,B_ROT,A_LASER",
        ),
        (["evaluate", "uniform", "--angles=0,90,0,x"], "must be A_ROT,B_ROT"),
        (["evaluate", "uniform", "--angles=0,90,0,nan"], "beta_laser = nan deg: from -360 to 360"),
        (["evaluate", "uniform", "--angles=720,0,0,95"], "alpha_rot = 720 deg: from -360 to 360"),
        (
            ["evaluate", "uniform", "0", "-55", "-80", "75"],
            "a value that begins with - goes behind =: --angles=0,90,0,-90",
        ),
        (["catalogue", "UTM30LX"], "did you mean 'UTM-30LX'"),
        (["assemble", "no.mcap", "--angles", "no.json", "-o", "c.ply"], "no.json"),
        (["import", "no.bag", "--scan", "/s", "--angle", "/a", "--angle-unit", "deg", "-o", "r.mcap"], "no.bag"),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, list) else None,
)
def test_wrong_words_are_one_line_and_exit_2(command, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    code, _, complaint = command(*words)
    assert (code, len(complaint)) == (2, 1)
    assert told in complaint[0]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "told"),
    [("nothing.toml", "nothing.toml: no such task file"), ("s_cne.toml", "did you mean 's_cone.toml'?")],
)
def test_a_task_file_is_suggested_by_its_name_without_the_ending(command, tmp_path, monkeypatch, name, told):
    monkeypatch.chdir(tmp_path)
    Path("s_cone.toml").write_text(GROUND, encoding="utf-8")
    code, _, (complaint,) = command("optimise", name)
    assert code == 2 and told in complaint and ("did you mean" in complaint) == ("did you mean" in told)


def test_evaluate_prints_every_figure(command, tmp_path):
    cloud = tmp_path / "sim.ply"
    code, out, _ = command("evaluate", "rolling", "--angles=0,90,0,-90", "--cloud", cloud, "--json")
    facts = json.loads(out)
    assert code == 0
    assert abs(facts["J"] - facts["J_ball"]) <= facts["J_error"] + facts["J_ball_error"]
    assert facts["J_lower"] <= facts["J"]
    # the rolling fan leaves a cone of 45 deg behind, less the ball: (1 - cos 43) / 2
    assert facts["blind_fraction"] == pytest.approx((1 - np.cos(np.radians(43))) / 2, abs=1e-4)
    assert (facts["masked_fraction"], facts["min_density"]) == (0, 0)
    points = trimesh.load(cloud).vertices
    assert points.shape == (720 * 1081, 3)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, atol=1e-6)


def test_optimise_as_json(command):
    code, out, _ = command("optimise", "ceiling", "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["covered"] == 37 * 37
    assert answer["best"] == sorted(answer["best"], key=lambda family: family["J"])
    for family in answer["best"]:
        assert (family["alpha_rot_deg"], family["beta_rot_deg"]) == (180, 0)
    best, factors = answer["best"][0], [gain["factor"] for gain in answer["gains"]]
    assert best["J"] - best["J_error"] < min(other["J"] for other in answer["standard"].values())
    assert len(factors) == 4 and factors == sorted(factors) and factors[0] > 0.999
    assert {entry["unit"] for entry in answer["left_out"]} >= {"settings", "square degrees"}


def test_what_lies_out_of_range_is_told_by_new_and_optimise(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    parts = ("--lidar", "UST-10LX", "--servo", "XM430-W350", "--height-m", "0.45")
    _, _, complaints = command("new", "far", *parts, "--see", "wall:500:10")
    told = "warning: weight.0: wall 500 m away, 0 to 2.5 m high ahead: all of it lies beyond the 4 m that UST-10LX sees"
    assert complaints[0].startswith(told)
    text = (
        Path("far.toml")
        .read_text(encoding="utf-8")
        .replace("s_deg = [-90, 90]", "s_deg = [-90.0, 90]")
        .replace("[-180, 180]", "0")
        .replace("[-90, 90]", "45")
    )
    Path("far.toml").write_text(text, encoding="utf-8")
    _, out, complaints = command("optimise", "far.toml")
    assert (
        any(line.startswith(told) for line in complaints)
        and "ahead: 0 points, as all of it lies beyond the lidar's range of 4 m" in out
    )
    _, out, _ = command("optimise", "far.toml", "--json")
    assert [warning.partition(";")[0] for warning in json.loads(out)["warnings"]] == [
        f"{told.removeprefix('warning: ')}, and J counts beams that measure nothing there"
    ]


def test_a_lever_is_named_beside_the_figures_that_hold_for_it(command):
    asked = ("evaluate", "ceiling", "--angles=0,0,0,-90")
    _, plain, _ = command(*asked)
    code, out, _ = command(*asked, "--lever=5,-3,1.0")
    assert (code, "lever" in plain) == (0, False)
    assert "lever          optical centre (5, -3) mm off the axis: all figures hold at 1 m" in out.splitlines()
    _, out, _ = command(*asked, "--lever=5,-3,1.0", "--json")
    assert json.loads(out)["lever"] == {"x_mm": 5.0, "y_mm": -3.0, "range_m": 1.0}


def test_schema_and_catalogue(command):
    code, out, _ = command("schema")
    assert code == 0
    assert set(json.loads(out)["properties"]) >= {"name", "sensor", "motion", "angles", "density", "weight", "mask"}
    _, out, _ = command("catalogue")
    for name in ("UTM-30LX", "URG-04LX", "UST-10LX", "MX-64R", "AX-12A", "UH1256-02-0610-06S", "SNU11-P0210", "sla"):
        assert name in out
    _, out, _ = command("catalogue", "SNU11-P0210")
    assert "? length_mm = 38.0" in out
    _, out, _ = command("catalogue", "--kind", "lidar", "--min-range-m", "8", "--max-mass-g", "200", "--json")
    listed = {product["name"]: product for product in json.loads(out)["products"]}
    assert {"UST-20LX", "RPLIDAR S2"} <= set(listed) and "UTM-30LX" not in listed
    assert listed["UST-20LX"]["provenance"]["range_max_mm"]["verified"] is True


def test_a_sketch_of_a_product(command, tmp_path):
    code, _, err = command("catalogue", "STL27L", "--sketch", tmp_path / "lidar.svg")
    assert (code, f"wrote {tmp_path / 'lidar.svg'}" in err) == (0, True)
    assert "3x M2" in (tmp_path / "lidar.svg").read_text()
    code, _, err = command("catalogue", "--sketch", tmp_path / "all.svg")
    assert (code, "with its NAME" in err[0]) == (2, True)


def test_measure_proposes_a_product_file(command, tmp_path, monkeypatch):
    block, hole = trimesh.creation.box((40, 30, 10)), trimesh.creation.cylinder(1.25, 20, sections=32)
    trimesh.boolean.difference([block, hole]).export(tmp_path / "plate.stl")
    monkeypatch.chdir(tmp_path)
    code, out, _ = command("measure", "plate.stl", "--json")
    assert code == 0
    assert json.loads(out)["values"]["holes"][0]["at_mm"] == [0, 0, 0]
    assert "verified = false" in (tmp_path / "plate.toml").read_text()
    assert (tmp_path / "plate.svg").exists()
    code, _, err = command("measure", "plate.stl", "--kind", "servo")
    assert (code, "no horn was detected" in err[0]) == (2, True)


def test_import_and_assemble_a_real_recording(command, data, tmp_path):
    recording, cloud = tmp_path / "room.mcap", tmp_path / "room.ply"
    source = ["--scan", "/slice:laserScan", "--angle", "/slice:stepAngle", "--angle-unit", "deg", "--hold"]
    code, out, _ = command("import", data / "tilting/room_240.bag", *source, "-o", recording)
    assert (code, "wrote 865 scans" in out) == (0, True)
    angles = Path(scanwright.__file__).parents[1] / "design/angle_sets/tilting_urg.json"
    code, out, _ = command("assemble", recording, "--angles", angles, "-o", cloud)
    assert code == 0
    assert "467,596 points of 589,065 beams" in out
    assert "left out 121,469 beams: no return" in out
    assert len(trimesh.load(cloud).vertices) == 467_596


@pytest.mark.parametrize(("words", "unbuffered"), [(["--version"], ""), (["catalogue"], "1")])
def test_results_that_cannot_be_written_are_told_of_standard_output(words, unbuffered):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "scanwright", *words],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
        )
    assert (done.returncode, done.stderr) == (2, "error: standard output: No space left on device\n")


def test_a_bug_shows_its_traceback(command, monkeypatch):
    monkeypatch.setattr("scanwright.design.catalogue.catalogue.load_catalogue", lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        command("catalogue")


@pytest.mark.parametrize("place", [".", "/"])
@pytest.mark.parametrize(
    "words",
    [
        ("calibrate", "r.mcap", "--angles", "angles.json", "-o"),
        ("assemble", "r.mcap", "--angles", "angles.json", "-o"),
        ("import", "r.bag", "--scan", "/scan", "--angle", "/joint_states:j", "-o"),
        ("repair", "r.mcap", "-o"),
        ("repair",),
        ("map", "a.ply", "--angles", "angles.json", "-o"),
        ("register", "a.ply", "b.ply", "-o"),
    ],
    ids=lambda words: " ".join(words[:1] + words[-1:]),
)
def test_a_folder_for_a_file_is_refused_in_a_line(command, tmp_path, monkeypatch, words, place):
    """`.` and `/` are folders without a name, of which no other name can be made."""
    monkeypatch.chdir(tmp_path)
    angles = AngleSet(
        task="t",
        angles_deg=Angles(alpha_rot=0.0, beta_rot=0.0, alpha_laser=60.0, beta_laser=0.0),
        sensor="any",
        servo="MX-64R",
    )
    Path("angles.json").write_text(angles.to_json())
    for name in ("r.mcap", "r.bag", "a.ply", "b.ply"):
        Path(name).touch()
    code, _, complaints = command(*words, place)
    assert code == 2
    assert len(complaints) == 1
    assert "folder" in complaints[0] or "known: " in complaints[0]


def test_optimise_prefers_a_simple_mount_and_says_what_that_costs(command, tmp_path):
    task = tmp_path / "simple.toml"
    shipped = (SHIPPED / "ceiling.toml").read_text(encoding="utf-8")
    assert shipped.count("[angles]\n") == 1
    told = 'step_deg = 15.0\nprefer = "simple"\nprefer_loss = 0.02\n'
    task.write_text(shipped.replace("[angles]\n", f"[angles]\n{told}"), encoding="utf-8")
    code, out, _ = command("optimise", task)
    assert code == 0
    assert "preferred as the simplest mount that costs at most 2% of the beams per ball: (180, 0, 0, -90)" in out
    assert "it costs 0.17% of the beams per ball against the lowest J, (180, 0, " in out
    task.write_text(task.read_text(encoding="utf-8").replace('prefer = "simple"\n', ""), encoding="utf-8")
    code, out, err = command("optimise", task)
    assert (code, out, len(err)) == (2, "", 1) and "prefer_loss = 0.02 is for prefer = 'simple'" in err[0]


@pytest.mark.parametrize(
    "words", [("catalogue", "UTM-30LX", "--sketch", "none/x.svg"), ("measure", "a.step", "--out", "none/x.toml")]
)
def test_a_file_that_cannot_be_written_is_one_line(command, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    code, _, complaints = command(*words)
    assert (code, len([line for line in complaints if "none" in line])) == (2, 1)
