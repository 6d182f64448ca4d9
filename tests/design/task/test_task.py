"""The task file: what is wrong in it is one clear line; what is right is written out and read back the same."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imsave

from scanwright.design.catalogue.catalogue import SHIPPED as PRODUCTS
from scanwright.design.errors import TaskError
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.sphere.regions import field_of
from scanwright.design.task.task import load_task, shipped_tasks
from scanwright.pipeline.records import write_task

BASE = """name = "mine"
sensor = "UTM-30LX"
servo = "MX-64R"
slip_ring = "UH1256-02-0610-06S"

[motion]
mode = "spin"
period_s = 18.0
"""
RING_TEXT = (PRODUCTS / "uh1256.toml").read_text(encoding="utf-8").replace("value = 12.7", "value = 0.0")
BARE = "".join(line for line in RING_TEXT.splitlines(keepends=True) if not line.startswith("rotor"))
FLANGE = "diameter_mm = 80.0, thickness_mm = 3.0, below_top_mm = 5.0, circle_mm = 70.0, holes = 3, hole_mm = 5.4"
CAPSULE = f"""{BARE}
flange = {{ value = {{ {FLANGE}, screw = "M5" }}, source = "a test", verified = false }}
rotor = {{ value = {{ diameter_mm = 10.0, length_mm = 8.0 }}, source = "a test", verified = false }}
"""
RING = 'slip_ring = "UH1256-02-0610-06S"'
ROLLING = np.radians([0, 90, 0, -90])


def swap(old, new):
    assert old in BASE
    return BASE.replace(old, new)


def ahead(line):
    """A key at the top level, before the first section."""
    return swap(RING, f"{RING}\n{line}")


def weight(lines, kind="weight"):
    return f"{BASE}\n[[{kind}]]\n{lines}\n"


def a_map(file):
    return weight(f'shape = "map"\nfile = "{file}"')


def save_maps(folder):
    np.save(folder / "cube.npy", np.ones((2, 3, 4)))
    np.save(folder / "nan.npy", np.array([[1.0, np.nan]]))
    np.save(folder / "negative.npy", np.array([[1.0, -0.1]]))
    np.save(folder / "nothing.npy", np.empty((0, 4)))
    np.save(folder / "complex.npy", np.array([[1j]]))
    np.save(folder / "words.npy", np.array([["a", "b"]]))
    np.save(folder / "pairs.npy", np.zeros((3, 3), dtype=[("a", float), ("b", float)]))
    np.savez(folder / "archive.npz", np.ones((2, 2)))
    (folder / "archive.npz").rename(folder / "archive.npy")
    (folder / "blank.npy").write_bytes(b"")
    (folder / "words.csv").write_text("1,2\n3,many\n", encoding="utf-8")
    (folder / "ragged.csv").write_text("1,2\n3\n", encoding="utf-8")
    (folder / "blank.csv").write_text("", encoding="utf-8")
    (folder / "fake.png").write_text("not a picture", encoding="utf-8")
    (folder / "map.jpg").write_bytes(b"\xff\xd8")
    (folder / "zero.csv").write_text("0")
    (folder / "folder.npy").mkdir()


WRONG = {
    "unknown key": (ahead("sensr = 3"), ["task.toml", "sensr", "unknown key", "did you mean 'sensor'"]),
    "unknown key in a section": (swap("period_s", "period_s = 18.0\nperiods"), ["motion.periods", "'period_s'"]),
    "wrong unit in a key": (swap("period_s", "period_ms"), ["motion.period_ms", "did you mean 'period_s'"]),
    "wrong unit in a region": (
        weight('shape = "band"\ntheta_rad = [0, 1]'),
        ["weight.0.theta_rad", "did you mean 'theta_deg'"],
    ),
    "unit in a value": (swap("18.0", '"18 s"'), ["motion.period_s", "18 s"]),
    "number in quotes": (swap("18.0", '"18.0"'), ["motion.period_s", "18.0"]),
    "true for a number": (swap("18.0", "true"), ["motion.period_s"]),
    "period zero": (swap("18.0", "0.0"), ["motion.period_s", "0.0", "greater than or equal to 0.001"]),
    "period negative": (swap("18.0", "-18.0"), ["motion.period_s", "-18.0"]),
    "period infinite": (swap("18.0", "inf"), ["motion.period_s", "inf"]),
    "period of hours": (swap("18.0", "3601.0"), ["motion.period_s", "600"]),
    "unknown mode": (swap('"spin"', '"wobble"'), ["motion.mode", "wobble", "spin"]),
    "name of a lidar": (swap("UTM-30LX", "UTM30LX"), ["task.toml", "sensor", "did you mean 'UTM-30LX'"]),
    "name of a servo": (swap("MX-64R", "MX64"), ["task.toml", "servo", "did you mean 'MX-64R'"]),
    "name of a ring": (swap("0610-06S", "0610"), ["task.toml", "slip_ring", "did you mean 'UH1256-02-0610-06S'"]),
    "name of a printer": (ahead('printer = "fdm-0.5"'), ["task.toml", "printer", "did you mean 'fdm-0.4'"]),
    "servo for a lidar": (swap('"UTM-30LX"', '"MX-64R"'), ["task.toml", "sensor", "MX-64R"]),
    "capsule without a flange": (ahead('catalogue = ["bare.toml"]'), ["bare.toml", "bore_mm = 0", "flange", "12.7"]),
    "spin without ring": (swap(RING, ""), ["task.toml", "slip_ring", "spin"]),
    "catalogue file missing": (ahead('catalogue = ["none.toml"]'), ["none.toml", "cannot read"]),
    "catalogue no list": (ahead('catalogue = "capsule.toml"'), ["task.toml", "catalogue"]),
    "weight NaN": (weight('shape = "all"\nvalue = nan'), ["weight.0.value", "nan"]),
    "weight negative": (weight('shape = "all"\nvalue = -1'), ["weight.0.value", "-1"]),
    "weight infinite": (weight('shape = "all"\nvalue = inf'), ["weight.0.value", "inf"]),
    "background negative": (BASE + "[density]\nbackground = -0.5\n", ["density.background", "-0.5"]),
    "second weight is meant": (
        weight('shape = "all"\n[[weight]]\nshape = "cone"\naxis = [1, 0, 0]'),
        ["weight.1.half_angle_deg", "required"],
    ),
    "name with a path": (swap('"mine"', '"../mine"'), ["task.toml", "name", "../mine", "path"]),
    "name with a backslash": (swap('"mine"', "'a\\b'"), ["task.toml", "name", "path"]),
    "name of dots": (swap('"mine"', '".."'), ["task.toml", "name", "path"]),
    "name empty": (swap('"mine"', '""'), ["task.toml", "name"]),
    "name with a line feed": (swap('"mine"', '"mine\\n"'), ["task.toml", "name"]),
    "name is a number": (swap('"mine"', "3"), ["task.toml", "name", "3"]),
    "band upside down": (weight('shape = "band"\ntheta_deg = [150, 95]'), ["weight.0", "theta_deg", "150", "rise"]),
    "band beyond the pole": (weight('shape = "band"\ntheta_deg = [95, 190]'), ["weight.0", "theta_deg", "180"]),
    "band phi reversed": (weight('shape = "band"\nphi_deg = [60, -60]'), ["weight.0", "phi_deg", "60", "rise"]),
    "band more than round": (weight('shape = "band"\nphi_deg = [-200, 200]'), ["weight.0", "phi_deg", "360"]),
    "band of one number": (weight('shape = "band"\ntheta_deg = 95'), ["weight.0.theta_deg", "95"]),
    "band of no height": (weight('shape = "band"\ntheta_deg = [90, 90]'), ["weight.0", "theta_deg", "0.001 deg"]),
    "band of no width": (weight('shape = "band"\nphi_deg = [30, 30]'), ["weight.0", "phi_deg", "0.001 deg"]),
    "band far around": (weight('shape = "band"\nphi_deg = [0, 1e308]'), ["weight.0", "phi_deg", "720"]),
    "mesh turned by far": (
        weight('shape = "mesh"\nfile = "m.stl"\nrpy_deg = [0, 0, 1e300]', "mask"),
        ["mask.0.rpy_deg", "360"],
    ),
    "mask that hides nothing": (
        weight('shape = "all"\nvalue = 0', "mask"),
        ["mask.0.value", "hides nothing", "leave the mask out"],
    ),
    "sweep of no width": (
        swap('mode = "spin"', 'mode = "sweep"\nlimits_deg = [10, 10]'),
        ["motion", "limits_deg", "the first must be below the second"],
    ),
    "angle out of range": (BASE + "[angles]\nbeta_rot_deg = 91\n", ["angles", "beta_rot_deg", "91", "90"]),
    "range out of bounds": (BASE + "[angles]\nalpha_rot_deg = [0, 181]\n", ["angles", "alpha_rot_deg", "180"]),
    "range reversed": (BASE + "[angles]\nalpha_laser_deg = [10, -10]\n", ["angles", "alpha_laser_deg", "rise"]),
    "range of three": (BASE + "[angles]\nalpha_rot_deg = [1, 2, 3]\n", ["angles.alpha_rot_deg", "[1, 2, 3]"]),
    "angle in words": (BASE + '[angles]\nalpha_rot_deg = "up"\n', ["angles.alpha_rot_deg", "up"]),
    "angle NaN": (BASE + "[angles]\nalpha_rot_deg = nan\n", ["angles.alpha_rot_deg", "nan"]),
    "angle that is no angle": (BASE + "[angles]\ngamma_rot_deg = 3\n", ["angles.gamma_rot_deg", "unknown key"]),
    "step 0": (BASE + "[angles]\nstep_deg = 0\n", ["angles.step_deg", "0.5"]),
    "step negative": (BASE + "[angles]\nstep_deg = -5\n", ["angles.step_deg", "-5"]),
    "ball radius 0": (BASE + "[density]\nball_radius_deg = 0\n", ["density.ball_radius_deg", "0.01"]),
    "ball beyond the equator": (BASE + "[density]\nball_radius_deg = 91\n", ["density.ball_radius_deg", "90"]),
    "unknown objective": (BASE + '[density]\nobjective = "loud"\n', ["density.objective", "loud", "log"]),
    "unknown quadrature": (BASE + '[density]\nquadrature = "solid"\n', ["density.quadrature", "solid_angle"]),
    "grid that misses the pole": (
        BASE + '[density]\nquadrature = "equal_angle"\ngrid_step_deg = 7\n',
        ["density", "grid_step_deg", "7"],
    ),
    "section missing": (BASE.split("[motion]")[0], ["task.toml", "motion", "required"]),
    "key missing": (swap('sensor = "UTM-30LX"', ""), ["task.toml", "sensor", "required"]),
    "section for a list": (BASE + '[weight]\nshape = "all"\n', ["task.toml", "weight"]),
    "unknown shape": (weight('shape = "cube"'), ["weight.0", "cube", "'band'"]),
    "shape missing": (weight("value = 1.0"), ["weight.0", "shape"]),
    "module in quotes": (BASE + '[modules]\ntripod_foot = "no"\n', ["modules.tripod_foot = 'no'", "true or false"]),
    "module by number": (BASE + "[modules]\ntripod_foot = 1\n", ["modules.tripod_foot = 1", "true or false"]),
    "unknown module": (BASE + "[modules]\ntripod = true\n", ["modules.tripod", "did you mean 'tripod_foot'"]),
    "cone without axis": (weight('shape = "cone"\nhalf_angle_deg = 3'), ["weight.0.axis", "required"]),
    "axis of length zero": (
        weight('shape = "cone"\naxis = [0, 0, 0]\nhalf_angle_deg = 3', "mask"),
        ["mask.0.axis", "length zero"],
    ),
    "axis too long for a length": (
        weight('shape = "cone"\naxis = [1e200, 0, 0]\nhalf_angle_deg = 3', "mask"),
        ["mask.0.axis", "1e+200"],
    ),
    "axis of two": (weight('shape = "cone"\naxis = [1, 0]\nhalf_angle_deg = 3'), ["weight.0.axis", "required"]),
    "cone of no angle": (weight('shape = "cone"\naxis = [1, 0, 0]\nhalf_angle_deg = 0'), ["weight.0.half_angle_deg"]),
    "not TOML": ("name: mine", ["task.toml", "not a TOML file", "line 1"]),
    "key twice": (ahead('name = "again"'), ["task.toml", "not a TOML file"]),
    "map missing": (a_map("none.npy"), ["none.npy", "cannot read: No such file"]),
    "map of another kind": (a_map("map.jpg"), ["map.jpg", ".png, .csv or .npy"]),
    "map is a folder": (a_map("folder.npy"), ["folder.npy", "cannot read: Is a directory"]),
    "map of three axes": (a_map("cube.npy"), ["cube.npy", "(2, 3, 4)"]),
    "map with NaN": (a_map("nan.npy"), ["nan.npy", "finite"]),
    "map negative": (a_map("negative.npy"), ["negative.npy", "not negative"]),
    "map without cells": (a_map("nothing.npy"), ["nothing.npy", "(0, 4)"]),
    "map of complex numbers": (a_map("complex.npy"), ["complex.npy"]),
    "map of words": (a_map("words.npy"), ["words.npy", "numbers only"]),
    "map of pairs": (a_map("pairs.npy"), ["pairs.npy"]),
    "map is an archive": (a_map("archive.npy"), ["archive.npy"]),
    "map of no bytes": (a_map("blank.npy"), ["blank.npy"]),
    "table of words": (a_map("words.csv"), ["words.csv", "cannot read the map"]),
    "table missing": (a_map("none.csv"), ["none.csv: cannot read the map: No such file or directory"]),
    "table with a short row": (a_map("ragged.csv"), ["ragged.csv", "cannot read the map"]),
    "table of no rows": (a_map("blank.csv"), ["blank.csv"]),
    "table of nothing but 0": (a_map("zero.csv"), ["zero.csv: every weight of the map is 0"]),
    "picture that is none": (a_map("fake.png"), ["fake.png", "cannot read the map"]),
    "mask map missing": (weight('shape = "map"\nfile = "none.csv"', "mask"), ["none.csv"]),
}


@pytest.mark.parametrize(("text", "words"), WRONG.values(), ids=WRONG)
def test_wrong_input_is_one_line_that_names_file_and_field(tmp_path, text, words):
    path = tmp_path / "task.toml"
    path.write_text(text, encoding="utf-8")
    (tmp_path / "capsule.toml").write_text(CAPSULE, encoding="utf-8")
    (tmp_path / "bare.toml").write_text(BARE, encoding="utf-8")
    save_maps(tmp_path)
    with pytest.raises(TaskError) as caught:
        load_task(path)
    message = str(caught.value)
    assert "\n" not in message
    for word in [str(tmp_path), *words]:
        assert word in message


@pytest.mark.parametrize(
    "lines",
    [
        'shape = "all"\nvalue = 0',
        'shape = "all"\n[[mask]]\nshape = "all"',
        'shape = "cone"\naxis = [0, 0, 1]\nhalf_angle_deg = 5\n[[mask]]\nshape = "band"\ntheta_deg = [0, 6]',
    ],
)
def test_an_empty_region_is_refused_when_it_is_scored(tmp_path, lines):
    loaded = load_text(tmp_path, weight(lines))
    with pytest.raises(TaskError, match=r"weight.*empty") as caught:
        score(problem_of(loaded), ROLLING)
    assert "\n" not in str(caught.value)


def test_no_weight_at_all_and_no_background_is_an_empty_region(tmp_path):
    with pytest.raises(TaskError, match=r"weight.*empty"):
        score(problem_of(load_text(tmp_path, BASE)), ROLLING)


def test_a_missing_file_a_folder_and_bytes_are_one_line(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "latin.toml").write_bytes(b"\xff\xfe")
    for path in (
        tmp_path / "none.toml",
        tmp_path / "none",
        tmp_path,
        tmp_path / "folder.toml",
        tmp_path / "latin.toml",
    ):
        with pytest.raises(TaskError) as caught:
            load_task(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_byte_order_mark_is_no_statement_and_utf_16_is_named(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text(BASE, encoding="utf-8-sig")  # as Notepad saves it
    assert load_task(path).task.name == "mine"
    path.write_text("nmae = 1\n" + BASE, encoding="utf-8-sig")
    with pytest.raises(TaskError, match=r"task\.toml:1: nmae: unknown key"):
        load_task(path)
    path.write_text(BASE, encoding="utf-16")
    with pytest.raises(TaskError, match=r"task\.toml: cannot read the task file: UTF-16 text: save it as UTF-8$"):
        load_task(path)


def test_a_task_that_is_not_there_gets_the_one_that_was_meant_or_those_that_are(tmp_path):
    (tmp_path / "my_task.toml").write_text(BASE)
    shipped = "ceiling, ground_ahead, indoor_urg, low_cost, pitching, rolling, uniform"
    for path, advice in (
        (Path("ground"), "no shipped task of that name; did you mean 'ground_ahead'?"),
        (Path("quite_another"), shipped),
        (Path("ground_ahead.toml"), "no such task file; did you mean 'ground_ahead'?"),
        (tmp_path / "my_tsk.toml", f"no such task file; did you mean '{tmp_path / 'my_task.toml'}'?"),
        (Path("none/there.toml"), f"no such task file; known: capsule_ring, {shipped}"),
    ):
        with pytest.raises(TaskError, match=re.escape(advice)):
            load_task(path)


def test_what_is_there_and_is_no_task_file_is_called_what_it_is(tmp_path):
    loop, built = tmp_path / "loop", tmp_path / "built"
    loop.symlink_to(loop)
    built.mkdir()
    for path, says in (
        (loop, "loop: a link to a file that does not exist"),
        (Path("/dev/null"), "/dev/null: not a regular file, so not a task file"),
        (built, "built: this is a folder without a task.toml, not a task file"),
    ):
        with pytest.raises(TaskError, match=re.escape(says)):
            load_task(path)
    (built / "task.toml").write_text(BASE)
    with pytest.raises(TaskError, match=re.escape(f"{built}: this is a folder: name {built / 'task.toml'}")):
        load_task(built)


def test_a_build_folder_of_the_same_name_does_not_hide_a_shipped_task(tmp_path, monkeypatch):
    """`scanwright build ground_ahead --out .` makes a folder ground_ahead; the next command still means the task."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ground_ahead").mkdir()
    assert load_task(Path("ground_ahead")).task.name == "ground_ahead"


@pytest.fixture
def load_shipped():
    return {name: load_task(Path(name)) for name in shipped_tasks()}


def load_text(tmp_path, text):
    path = tmp_path / "task.toml"
    path.write_text(text, encoding="utf-8")
    return load_task(path)


def test_all_shipped_tasks_load_under_their_own_name(load_shipped):
    assert set(load_shipped) == {
        "capsule_ring",
        "ceiling",
        "ground_ahead",
        "indoor_urg",
        "low_cost",
        "pitching",
        "rolling",
        "uniform",
    }
    assert all(loaded.task.name == name for name, loaded in load_shipped.items())
    assert len({loaded.sha256() for loaded in load_shipped.values()}) == len(load_shipped)
    ahead = load_shipped["ground_ahead"].task
    assert ahead.weight[0].theta_deg == (95, 150)
    assert ahead.mask[0].axis == (-1, 0, -0.5)
    for name, angles in (("rolling", (0, 90, 0, -90)), ("pitching", (-90, 0, 90, 0))):
        a = load_shipped[name].task.angles
        assert (a.alpha_rot_deg, a.beta_rot_deg, a.alpha_laser_deg, a.beta_laser_deg) == angles


def test_defaults_are_those_of_the_issue(tmp_path):
    task = load_text(tmp_path, BASE).task
    assert (task.printer, task.catalogue, task.weight, task.mask) == ("fdm-0.4", (), (), ())
    expected = {
        "ball_radius_deg": 2.0,
        "objective": "log",
        "background": 0.0,
        "quadrature": "solid_angle",
        "grid_step_deg": 1.0,
    }
    assert expected.items() <= task.density.model_dump().items()
    limits = [task.angles.limits(name) for name in ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")]
    assert limits == [(-180, 180), (-90, 90), (-90, 90), (-90, 90)]
    assert task.angles.step_deg == 5


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("alpha_rot_deg = 7.5", [7.5]),
        ("alpha_rot_deg = [3, 3]", [3]),
        ("alpha_rot_deg = [-10, 10]", [-10, -5, 0, 5, 10]),
        ("alpha_rot_deg = [0, 12]", [0, 5, 10, 12]),
        ("alpha_rot_deg = [0.1, 0.7]\nstep_deg = 0.6", [0.1, 0.7]),
        ("alpha_rot_deg = [0, 2]\nstep_deg = 45", [0, 2]),
    ],
)
def test_the_grid_of_an_angle_holds_both_limits(tmp_path, lines, expected):
    ranges = load_text(tmp_path, f"{BASE}[angles]\n{lines}\n").task.angles
    np.testing.assert_allclose(ranges.grid_deg("alpha_rot"), expected, atol=1e-12)


MANY_REGIONS = (
    ahead('catalogue = ["capsule.toml", "my ring.toml"]').replace("UH1256-02-0610-06S", "MINE").replace("18.0", "2.7")
    + """
[angles]
alpha_rot_deg = [-30, 33.3]
beta_rot_deg = 12
step_deg = 7.5
[density]
ball_radius_deg = 0.7
background = 0.1
quadrature = "equal_angle"
grid_step_deg = 2.0
[[weight]]
shape = "all"
value = 0.3
[[weight]]
shape = "map"
file = "maps/a.npy"
value = 2
[[weight]]
shape = "cone"
axis = [1, 2, 3]
half_angle_deg = 33
[[mask]]
shape = "map"
file = "maps/a.npy"
[[mask]]
shape = "band"
theta_deg = [0, 12.5]
phi_deg = [170, 190]
"""
)


@pytest.mark.parametrize("name", ["ceiling", "ground_ahead", "pitching", "rolling", "uniform", "all kinds of regions"])
def test_the_resolved_task_file_reads_back_as_the_same_task_with_the_same_digest(tmp_path, load_shipped, name):
    home, out = tmp_path / "home", tmp_path / "out"
    (home / "maps").mkdir(parents=True)
    out.mkdir()
    if name in load_shipped:
        loaded = load_shipped[name]
    else:
        np.save(home / "maps/a.npy", np.random.default_rng(0).random((6, 9)))
        (home / "capsule.toml").write_text(CAPSULE, encoding="utf-8")
        (home / "my ring.toml").write_text(
            CAPSULE.replace("value = 0.0", "value = 14.0").replace("UH1256-02-0610-06S", "MINE"), encoding="utf-8"
        )
        loaded = load_text(home, MANY_REGIONS)
    write_task(out, loaded)
    again = load_task(out / "task.toml")
    keep = {"catalogue": True, "weight": {"__all__": {"file"}}, "mask": {"__all__": {"file"}}}
    assert again.task.model_dump(exclude=keep) == loaded.task.model_dump(exclude=keep)
    for one, other in zip(again.maps, loaded.maps, strict=True):
        np.testing.assert_array_equal(one, other)
    assert again.products.products == loaded.products.products
    assert again.sha256() == loaded.sha256()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("period_s = 2.7", "period_s = 2.8"),
        ("value = 0.3", "value = 0.4"),
        ("ball_radius_deg = 0.7", "ball_radius_deg = 0.8"),
        ("step_deg = 7.5", "step_deg = 8"),
        ("axis = [1, 2, 3]", "axis = [1, 2, 4]"),
        ("a map cell", "changes"),
        ("the ring", "changes"),
    ],
)
def test_the_digest_sees_all_that_decides_the_result(tmp_path, old, new):
    (tmp_path / "maps").mkdir()
    table = np.random.default_rng(0).random((6, 9))
    ring = CAPSULE.replace("value = 0.0", "value = 14.0").replace("UH1256-02-0610-06S", "MINE")
    np.save(tmp_path / "maps/a.npy", table)
    (tmp_path / "capsule.toml").write_text(CAPSULE, encoding="utf-8")
    (tmp_path / "my ring.toml").write_text(ring, encoding="utf-8")
    before = load_text(tmp_path, MANY_REGIONS).sha256()
    assert load_text(tmp_path, "# a comment decides nothing\n" + MANY_REGIONS).sha256() == before
    if old == "a map cell":
        table[3, 4] += 1e-9
        np.save(tmp_path / "maps/a.npy", table)
    elif old == "the ring":
        (tmp_path / "my ring.toml").write_text(ring.replace("14.0", "14.5"), encoding="utf-8")
    else:
        assert old in MANY_REGIONS
    assert load_text(tmp_path, MANY_REGIONS.replace(old, new)).sha256() != before


def test_a_file_of_ones_own_replaces_a_shipped_product_in_a_task(tmp_path):
    (tmp_path / "fast.toml").write_text(
        (PRODUCTS / "utm-30lx.toml").read_text(encoding="utf-8").replace("value = 40.0", "value = 80.0"),
        encoding="utf-8",
    )
    loaded = load_text(tmp_path, ahead('catalogue = ["fast.toml"]'))
    assert loaded.lidar.scan_rate_hz == 80
    weighed = load_text(tmp_path, ahead('catalogue = ["fast.toml"]') + '\n[[weight]]\nshape = "all"\n')
    assert problem_of(weighed).lines.count == 1440
    assert loaded.sha256() != load_text(tmp_path, BASE).sha256()


def direction(theta_deg, phi_deg):
    t, p = np.radians([theta_deg, phi_deg])
    return np.array([[np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)]])


@pytest.mark.parametrize("suffix", ["npy", "csv", "png"])
def test_a_map_has_theta_down_and_phi_to_the_right_and_its_values_in_the_cells(tmp_path, suffix):
    levels = np.array([[0, 51, 102], [153, 204, 255]], dtype=np.uint8)
    file = tmp_path / f"map.{suffix}"
    if suffix == "npy":
        np.save(file, levels)
    elif suffix == "csv":
        np.savetxt(file, levels, delimiter=",")
    else:
        imsave(file, np.repeat(levels[:, :, None], 3, axis=2))
    scale = 255 if suffix == "png" else 1
    field = field_of(load_text(tmp_path, a_map(file.name) + "value = 10\n"))
    for row, theta in enumerate((45, 135)):
        for column, phi in enumerate((60, 180, 300)):
            for t in (theta - 40, theta, theta + 40):
                for p in (phi - 59, phi, phi + 59, phi - 360):
                    expected = 10 * float(levels[row, column]) / scale
                    assert field.weight_at(direction(t, p)) == pytest.approx(expected, rel=1e-6), (t, p)


def test_a_spinning_servo_that_cannot_read_all_around_is_told(tmp_path):
    assert load_text(tmp_path, BASE).warnings() == []
    (warning,) = load_text(tmp_path, BASE.replace('"MX-64R"', '"AX-12A"')).warnings()
    assert "60 deg of every turn" in warning


def test_a_plane_that_the_lidar_does_not_reach_is_told(tmp_path):
    wall = '[[weight]]\nshape = "wall"\nwidth_m = 10.0\nheight_m = 0.5\ndistance_m = '
    assert load_text(tmp_path, f"{BASE}{wall}12.0").warnings() == []
    (partly,) = load_text(tmp_path, f"{BASE}{wall}14.5").warnings()
    (wholly,) = load_text(tmp_path, f"{BASE}{wall}20.0").warnings()
    assert partly.startswith("weight.0: wall 14.5 m away, 0 to 2.5 m high ahead: 2") and "% of it lies beyond" in partly
    assert "all of it lies beyond the 15 m that UTM-30LX sees" in wholly, "of the 30 m that its maker states"
    assert load_text(tmp_path, f"{BASE}{wall}20.0\nvalue = 0").warnings() == []


@pytest.mark.parametrize(
    "motion, period_s",
    [({"mode": "spin"}, 0.5), ({"mode": "sweep", "limits_deg": [-170, 170], "accel_deg_s2": 2000.0}, 2.0)],
)
def test_a_servo_that_cannot_turn_that_fast_is_refused_and_the_period_named_is_one_that_it_can(motion, period_s):
    table = {"name": "fast", "sensor": "UTM-30LX", "servo": "MX-64R", "slip_ring": "UH1256-02-0610-06S"}
    with pytest.raises(TaskError, match=r"rpm, and servo = 'MX-64R' turns at 63 rpm at most") as refused:
        load_task(table | {"motion": motion | {"period_s": period_s}})
    least_s = float(re.search(r"use ([\d.]+) or more", str(refused.value))[1])
    load_task(table | {"motion": motion | {"period_s": least_s}})
    with pytest.raises(TaskError, match="use"):
        load_task(table | {"motion": motion | {"period_s": least_s - 0.002}})
