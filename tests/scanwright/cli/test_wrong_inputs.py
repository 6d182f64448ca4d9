"""Nothing that a person can get wrong ends in a traceback, in nonsense, or in an answer that nobody waits for."""

import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.scanwright.wrong_inputs.accidents import damage, number
from benchmarks.scanwright.wrong_inputs.workshop import FORMATS, furnish
from scanwright.design.errors import TaskError
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import read_clouds, write_clouds
from scanwright.firmware_io.emulators.world import range_model

LONG = "x" * 300


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shop")
    furnish(folder)
    return folder


@pytest.fixture
def refused(command, shop, monkeypatch):
    """Run a command in the shop; its one line of complaint."""
    monkeypatch.chdir(shop)

    def run(*words, code=2):
        given, _, complaints = command(*words)
        assert given == code
        assert len(complaints) == 1
        return complaints[0]

    return run


def test_a_slice_of_the_thousand():
    """The mechanism of `python -m benchmarks.scanwright.wrong_inputs`, in a process of its own: it forks."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.scanwright.wrong_inputs", "12", "7", "convert"],
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "12 wrong inputs from seed 7" in done.stdout
    assert "failures: none" in done.stdout


def test_an_accident_is_the_same_for_the_same_seed(shop, tmp_path):
    import random

    others = sorted(path for path in shop.iterdir() if path.is_file())
    seen = []
    for name in ("one", "two"):
        path = tmp_path / f"{name}.ply"
        path.write_bytes((shop / "a.ply").read_bytes())
        said = [damage(random.Random(3), path, others), number(random.Random(3))]
        seen.append((said, path.read_bytes()))
    assert seen[0] == seen[1]
    assert seen[0][1] != (shop / "a.ply").read_bytes()


@pytest.mark.parametrize(
    "words",
    [
        ("convert", "a.ply", f"{LONG}.ply"),
        ("convert", f"{LONG}.ply", "b.ply"),
        ("repair", f"{LONG}.mcap"),
        ("repair", "r.mcap", "-o", f"{LONG}.mcap"),
        ("register", "a.ply", "b.ply", "-o", f"{LONG}.ply"),
        ("assemble", "r.mcap", "--angles", "angles.json", "-o", f"{LONG}.ply"),
        ("assemble", f"{LONG}.mcap", "--angles", "angles.json", "-o", "c.ply"),
        ("assemble", "r.mcap", "--angles", f"{LONG}.json", "-o", "c.ply"),
        ("convert", "r.mcap", LONG),
        ("evaluate", f"{LONG}.toml", "--angles", "0,90,0,-90"),
    ],
)
def test_a_name_longer_than_names_can_be(refused, words):
    assert "File name too long" in refused(*words) or "no such" in refused(*words)


def test_a_lag_of_ages(refused):
    said = refused("assemble", "r.mcap", "--angles", "angles.json", "-o", "c.ply", "--lag-s", "1e300")
    assert "lag 1e+300 s: a number from -3600 to 3600" in said


def test_turns_without_end(refused):
    assert "--turns = 1000000000000000000000000000000" in refused("scan", "set", "--dry-run", "--turns", str(10**30))


@pytest.mark.parametrize("noise", [np.inf, np.nan, -1.0])
def test_noise_without_end(noise):
    from scanwright.design.catalogue.catalogue import load_catalogue
    from scanwright.design.catalogue.lidar import Lidar

    with pytest.raises(TaskError, match=r"noise (inf|nan|-1\.0) mm: 0 to 100000"):
        range_model(load_catalogue().get("UTM-30LX", Lidar), noise)


@pytest.mark.parametrize(
    "line",
    [
        "1e999999999 0 0 0 0 0 0 1",
        "1763000000 1e300 0 0 0 0 0 1",
        "1763000000 0 0 0 0 0 0 5",
        "1763000000 0 0 0 0 0 0 1e300",
        "1e30 0 0 0 0 0 0 1",
    ],
)
def test_poses_that_nothing_can_have(refused, shop, line):
    (shop / "far.tum").write_text(f"1762999999 0 0 0 0 0 0 1\n{line}\n")
    said = refused("assemble", "r.mcap", "--angles", "angles.json", "--poses", "far.tum", "-o", "c.ply")
    assert "far.tum" in said


def test_a_task_of_brackets(refused, shop):
    (shop / "deep.toml").write_text("x = " + "[" * 100_000)
    assert "deep.toml: not a TOML file: nested too deeply" in refused("evaluate", "deep.toml", "--angles", "0,90,0,-90")


@pytest.mark.parametrize("told", [{"lidar": "a", "servo": "b", "pid": 10**30}, {"lidar": 1, "servo": 2, "pid": 1}, []])
def test_an_emulated_scanner_that_cannot_be(refused, shop, told):
    (shop / "set/emulated.json").write_text(json.dumps(told))
    assert "lidar: no port with a known USB id" in refused("scan", "set", "--dry-run", code=3)


def test_a_cloud_registered_to_itself(refused, shop):
    (cloud,), _ = read_clouds(shop / "a.npz")
    moved = Cloud(cloud.points_m, T_world_cloud=np.eye(4)[[0, 1, 2, 3]] + np.eye(4, k=3) * 0.1)
    write_clouds(shop / "again.npz", [Cloud(moved.points_m, {}, cloud.shape, moved.T_world_cloud)])
    said = refused("register", "a.npz", "again.npz", "-o", "map.ply")
    assert "again: same points as a; register needs different clouds" in said


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("T_world_cloud", lambda a: a * 5),
        ("T_world_cloud", lambda a: a * np.nan),
        ("T_world_cloud", lambda a: a[:3]),
        ("T_world_cloud", lambda a: a[[1, 0, 2, 3]]),
        ("points_m", lambda a: a.astype(str)),
        ("points_m", lambda a: a.astype(int)),
        ("points_m", lambda a: a * np.float32(1e20)),
        ("shape", lambda a: a.astype(str)),
        ("shape", lambda a: a + 1),
        ("start_ns", lambda a: a * 0.5),
        ("column.ring", lambda a: a[:-1]),
        ("column.ring", lambda a: a.astype(str)),
        ("column.intensity", lambda a: a.astype("f2")),
        ("column.intensity", lambda a: a > 0),
    ],
)
def test_an_archive_whose_arrays_are_no_cloud(refused, shop, name, change):
    with np.load(shop / "a.npz") as archive:
        held = dict(archive)
    finite = np.nan_to_num(held[name]) if name == "points_m" else held[name]
    np.savez(shop / "wrong.npz", **(held | {name: change(finite)}))
    assert "wrong.npz: " in refused("convert", "wrong.npz", "c.ply")


HEADERS = {
    "ply": [
        (b"property float y", b"property float x"),
        (b"property float x", b"property int x"),
        (b"comment pose", b"comment pose nan 0 0 0 0 0 1\ncomment was"),
        (b"comment pose", b"comment pose 0 0 0 0 0 0 5\ncomment was"),
        (b"comment time_s 0 is ", b"comment time_s 0 is 9999999999999999999"),
        (b"element vertex ", b"element vertex 999999999999"),
    ],
    "pcd": [
        (b"FIELDS x y", b"FIELDS x x"),
        (b"VIEWPOINT ", b"VIEWPOINT nan "),
        (b"POINTS ", b"POINTS 9"),
        (b"HEIGHT 90", b"HEIGHT 91"),
        (b"SIZE 4", b"SIZE -4"),
        (b"COUNT 1", b"COUNT 1000000000000"),
    ],
    "xyz": [
        (b"types <f4", b"types <u1"),
        (b"types <f4", b"types |O8"),
        (b"<u2\n", b"|u1\n# nothing\n"),
        (b"# x y z intensity", b"# x y z x"),
    ],
}


@pytest.mark.parametrize(("kind", "old", "new"), [(kind, *pair) for kind, pairs in HEADERS.items() for pair in pairs])
def test_a_header_that_promises_what_is_not_there(refused, shop, kind, old, new):
    (cloud,), _ = read_clouds(shop / "a.npz")
    (placed,), _ = read_clouds(shop / "b.ply")
    columns = dict(cloud.columns) | {"ring": (cloud.columns["ring"] + 400).astype(np.uint16)}
    write_clouds(shop / f"full.{kind}", [Cloud(cloud.points_m, columns, cloud.shape, placed.T_world_cloud, 10**18)])
    data = (shop / f"full.{kind}").read_bytes()
    assert old in data
    (shop / f"wrong.{kind}").write_bytes(data.replace(old, new, 1))
    assert f"wrong.{kind}: " in refused("convert", f"wrong.{kind}", "c.npz")


CONVERT_ALL = """
import signal, sys
from scanwright.cli.app import run
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
for source, out in zip(sys.argv[1::2], sys.argv[2::2], strict=True):
    sys.argv[1:] = ["convert", source, out]
    try:
        run()
    except SystemExit as stop:
        print("exit code", stop.code, file=sys.stderr)
"""


def test_a_full_disk(shop, tmp_path):
    """A limit on the size of files cuts a write in the middle, as a full disk does; of every format."""
    pairs = [(shop / "r.mcap", tmp_path / name) for name in ("out.bag", "out")]
    pairs += [(shop / "a.npz", tmp_path / f"out.{kind}") for kind in FORMATS]

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    words = [sys.executable, "-c", CONVERT_ALL, *(path for pair in pairs for path in pair)]
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(words, capture_output=True, text=True, preexec_fn=limit, env=environment)
    told = done.stderr.splitlines()
    assert done.returncode == 0 and len(told) == 2 * len(pairs), done.stderr
    for (_, out), complaint, code in zip(pairs, told[::2], told[1::2], strict=True):
        assert "cannot write" in complaint, out
        assert code == "exit code 2"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "remedy"),
    [
        ("calibrate none.mcap --angles ANGLES -o a.json", "`scanwright import` converts ROS bags"),
        ("assemble none.mcap --angles ANGLES -o a.ply", "`scanwright scan` makes recordings"),
        ("assemble none.mcap --angles none.json -o a.ply", "`scanwright build TASK` writes angles.json"),
        ("assemble none.mcap --angles none.toml -o a.ply", "use the angles.json of its build folder"),
        ("scan none", "`scanwright build TASK` writes angles.json"),
        ("report none", "`scanwright build TASK` writes out/TASK"),
        ("emulate --replay none", "`scanwright doctor --capture FILE` writes captures"),
        ("register none.ply none_2.ply -o a.ply", "`scanwright assemble` makes clouds"),
        ("build none.toml", "`scanwright new` writes one"),
        ("optimise none", "`scanwright new` writes one"),
    ],
)
def test_a_missing_file_is_one_line_with_the_command_that_makes_it(command, tmp_path, monkeypatch, words, remedy):
    monkeypatch.chdir(tmp_path)
    angles = Path(__file__).parents[3] / "design/angle_sets/tilting_urg.json"
    code, _, complaints = command(*words.replace("ANGLES", str(angles)).split())
    assert (code, len(complaints)) == (2, 1)
    assert "none" in complaints[0] and remedy in complaints[0]


@pytest.mark.parametrize("words", ["scan none --stamp-at foo", "scan none --echo foo", "import a --stamp foo -o b"])
def test_a_choice_that_does_not_exist_is_named_with_those_that_do(command, words):
    code, _, complaints = command(*words.split())
    assert (code, len(complaints)) == (2, 1)
    assert re.match(r"error: Invalid value for '--[a-z-]+': 'foo' is not one of '\w+', .*'\w+' \(see ", complaints[0])
