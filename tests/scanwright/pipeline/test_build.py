"""`scanwright build` from end to end, and the build folder."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from imports import ROOT
from patience import BOUND_S

import scanwright.api as sw
from scanwright.cli.app import run as scanwright_command
from scanwright.design.angles import load_angles
from scanwright.design.errors import BuildError
from scanwright.design.findings import Finding
from scanwright.design.progress import no_progress
from scanwright.design.search.optimum import find_optimum
from scanwright.design.task.task import load_task
from scanwright.pipeline import build as pipeline
from scanwright.pipeline.build import Build, Made
from scanwright.pipeline.folder import fresh_folder
from scanwright.pipeline.manifest import enter, first_difference, is_current, require_as_built

ROOMS = ("design", "cad", "scanwright")
METAL = ("servo_shaft", "journal_sleeve")
PARTS = ("alignment_linkage", "slip_ring_adapter", "bearing_cage", "base_mount", *METAL)
FILES = {
    "task.toml",
    "angles.json",
    "search.csv",
    "axes.csv",
    "density.png",
    "density.svg",
    "assembly.step",
    "assembly.glb",
    "exploded.glb",
    "assembly.md",
    "bom.csv",
    "template.pdf",
    "wiring.md",
    "wiring.svg",
    "scanner.urdf",
    "left_out.json",
    "checks.json",
    "own_body.npz",
    "report.html",
    "manifest.json",
    *(f"ros2/{name}" for name in ("package.xml", "setup.py", "setup.cfg", "resource/tilted_scanner")),
    *(f"ros2/tilted_scanner/{name}.py" for name in ("__init__", "node")),
    *(f"ros2/{name}" for name in ("scanner.urdf", "angles.json", "own_body.npz")),
    *(f"ros2/launch/{name}_launch.py" for name in ("scanner", "description")),
    *(f"ros2/layouts/{name}" for name in ("scanner.rviz", "foxglove.json")),
    *(f"ros2/meshes/{part}.stl" for part in PARTS),
    *(f"parts/{part}.{kind}" for kind in ("step", "stl") for part in PARTS),
    *(f"drawings/{part}.{kind}" for kind in ("pdf", "dxf", "svg") for part in PARTS),
    *(f"print/{part}.3mf" for part in (*PARTS, "fit_coupon", "test_plate") if part not in METAL),
    *(f"print/plate_1.{kind}" for kind in ("3mf", "png")),
    *(f"assembly/step_{number:02d}.png" for number in range(1, 10)),
}


def build(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["scanwright", "build", *map(str, words)])
    with pytest.raises(SystemExit) as stop:
        scanwright_command()
    assert not stop.value.code


@pytest.fixture(scope="module")
def tilted(made, tmp_path_factory):
    """The build of the tilted scanner, a copy that tests may change as long as they mend it."""
    return shutil.copytree(made.folder, tmp_path_factory.mktemp("builds") / "tilted")


def test_a_build_reports_the_measured_share_of_each_step_and_a_part_of_the_way_to_the_next():
    sources = "".join(path.read_text() for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    assert all(f'progress("{words}' in sources or f'progress(f"{words}' in sources for words in pipeline.BEGINS)
    assert list(pipeline.BEGINS.values()) == sorted(pipeline.BEGINS.values())
    shown = []
    for step in (
        ("refining the minima", 0.5),
        ("meshing and writing a", 0.0),
        ("meshing and writing b", 0.5),
        ("more",),
    ):
        pipeline.measured(lambda _, fraction=None: shown.append(fraction), *step)
    begins, ends = pipeline.BEGINS["meshing and"], pipeline.BEGINS["writing assembly.step"]
    assert shown == [0, begins, (begins + ends) / 2, None]


def test_a_build_is_complete_and_its_manifest_true(tilted):
    made = {path.relative_to(tilted).as_posix() for path in tilted.rglob("*") if path.is_file()}
    assert made == FILES
    manifest = json.loads((tilted / "manifest.json").read_text())
    assert set(manifest["files"]) == FILES - {"manifest.json"}
    for name, facts in manifest["files"].items():
        content = (tilted / name).read_bytes()
        assert (hashlib.sha256(content).hexdigest(), len(content)) == (facts["sha256"], facts["bytes"])


def test_a_build_leaves_nothing_beside_its_folder(made):
    assert [path.name for path in made.folder.parent.iterdir()] == ["tilted"]


def test_the_angle_set_is_the_optimum_of_its_task(tilted, made):
    angles = load_angles(tilted / "angles.json")
    task = load_task(made.folder.parents[1] / "tilted.toml")
    assert angles.task_sha256 == load_task(tilted / "task.toml").sha256() == task.sha256()
    found = find_optimum(task, no_progress).angle_set()
    assert angles == found.model_copy(update={"t_world_rot_mm": angles.t_world_rot_mm, "task_sha256": task.sha256()})
    assert angles.t_world_rot_mm == made.result.assembly.layout.deck.t_world_rot


def test_the_report_of_a_build_has_a_picture_of_every_place_that_a_warning_names(tilted):
    checks = json.loads((tilted / "checks.json").read_text())["checks"]
    severe = [check for check in checks if check["severity"] in ("warning", "error")]
    nowhere = {"fdm-0.4"} | {check["where"] for check in severe if check["kind"] == "lead_bend" and not check["value"]}
    placed = {(check["where"], check["kind"]) for check in severe} - {(w, c["kind"]) for w in nowhere for c in severe}
    text = (tilted / "report.html").read_text()
    assert text.count('<button type="button" class="where"') == len(placed) > 0


def test_a_second_run_does_no_work_and_says_so(tilted, monkeypatch, capsys):
    before = {path: path.stat().st_mtime_ns for path in tilted.rglob("*")}
    build(monkeypatch, tilted / "task.toml", "--out", tilted.parent)
    assert "is up to date" in capsys.readouterr().out
    assert {path: path.stat().st_mtime_ns for path in tilted.rglob("*")} == before


def test_a_build_whose_checks_fail_says_so_first_and_exits_with_1(tilted, tmp_path, command):
    folder = shutil.copytree(tilted, tmp_path / "tilted")
    words = "build", folder / "task.toml", "--out", tmp_path
    code, _, complaints = command(*words)
    assert code == 0 and complaints[-1].startswith("next: open ")
    assert not any(line.startswith("scanwright:") for line in complaints)
    built = sw.build(folder / "task.toml", tmp_path)
    assert built.failed == () and len(built.checks) > 20

    checks = json.loads((folder / "checks.json").read_text())
    checks["checks"][3] |= {"severity": "error", "message": "all is well"}  # the severity decides, not the words
    (folder / "checks.json").write_text(json.dumps(checks))
    enter(folder, "checks.json")
    code, out, complaints = command(*words)
    assert code == 1 and out == f"{folder} is up to date ({len(FILES) - 1} files)\n"
    assert complaints[:2] == [
        "error: check failed: all is well",
        f"error: 1 of {len(built.checks)} checks failed: do not make these parts",
    ]
    change = f"next: change {folder / 'task.toml'} as the failed checks state, and build again"
    assert complaints[-1] == f"{change}; {folder / 'report.html'} shows them"
    assert [check.message for check in sw.build(folder / "task.toml", tmp_path).failed] == ["all is well"]


def test_the_resolved_task_builds_the_same(tilted):
    assert is_current(tilted, load_task(tilted / "task.toml"))


def test_a_touched_file_is_no_current_build(tilted):
    loaded = load_task(tilted / "task.toml")
    table = tilted / "search.csv"
    kept = table.read_bytes()
    table.write_bytes(kept + b"\n")
    assert not is_current(tilted, loaded)
    table.write_bytes(kept)
    assert is_current(tilted, loaded)


def test_a_folder_of_two_designs_is_neither_checked_nor_reported(tilted, tmp_path, command):
    folder = shutil.copytree(tilted, tmp_path / "mine")
    shutil.rmtree(folder / "print")
    (folder / "parts/servo_shaft.stl").unlink()
    (folder / "angles.json").write_text((folder / "angles.json").read_text().replace("-20", "-25"))
    report = (folder / "report.html").read_bytes()
    for name in ("check", "report"):
        code, out, (complaint,) = command(name, folder)
        assert (code, out) == (2, "")
        assert f"{folder}: parts/servo_shaft.stl, " in complaint
        assert "angles.json was edited since it was built: build the folder again" in complaint
    assert (folder / "report.html").read_bytes() == report


def test_angles_and_task_alone_are_no_build_that_could_have_changed(tilted, tmp_path):
    for name in ("angles.json", "task.toml"):
        shutil.copy(tilted / name, tmp_path)
    require_as_built(tmp_path)
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(BuildError, match=r"manifest\.json was edited since it was built"):
        require_as_built(tmp_path)


def test_a_build_says_whose_work_it_replaces_and_ctrl_c_what_became_of_it(
    tilted, tmp_path, command, monkeypatch, caplog
):
    folder = shutil.copytree(tilted, tmp_path / "tilted")
    (folder / "parts/servo_shaft.stl").unlink()
    (folder / "bom.csv").write_text("mine")

    def stopped(_loaded, _target, _say):
        raise KeyboardInterrupt

    monkeypatch.setattr(pipeline, "_make", stopped)
    with pytest.raises(KeyboardInterrupt):
        pipeline.build_task(load_task(folder / "task.toml"), folder, no_progress)
    replaced = f"{folder}: parts/servo_shaft.stl is missing, bom.csv was edited: built again"
    assert caplog.messages == [replaced]
    code, out, complaints = command("build", folder / "task.toml", "--out", tmp_path)
    assert (code, out, complaints) == (130, "", [f"warning: {replaced}", f"note: stopped; {folder} is as it was"])

    def stopped_late(_loaded, target, _say):
        shutil.copytree(tilted, target, dirs_exist_ok=True)
        raise KeyboardInterrupt

    monkeypatch.setattr(pipeline, "_make", stopped_late)
    _, _, complaints = command("build", folder / "task.toml", "--out", tmp_path)
    assert complaints == [f"warning: {replaced}", f"note: stopped; {folder} is finished"]


def test_ctrl_c_waits_until_all_files_are_moved(tmp_path, monkeypatch):
    _build_of(tmp_path / "task", ["a.txt"])
    replace = Path.replace

    def interrupted(path, target):
        os.kill(os.getpid(), signal.SIGINT)
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        _build_of(tmp_path / "task", ["b.txt", "c.txt"])
    assert _files(tmp_path) == ["task/b.txt", "task/c.txt", "task/manifest.json"]


REBUILD = """
import sys
import without_posix
from scanwright.cad.assembly.assembly import alone
from scanwright.cad.files.step import step_text
from scanwright.cad.solids import box
from scanwright.cli.app import run
step_text(alone("box", box((0, 0, 0), (1, 1, 1)), (1.0, 0.0, 0.0)), "box")  # what is written later must not count on
if __name__ == "__main__":
    run()
"""


def test_another_process_builds_the_same_bytes_and_finds_the_one_file_that_was_touched(tilted, tmp_path):
    drawing = tilted / "wiring.svg"
    kept = drawing.read_bytes()
    drawing.write_bytes(kept + b"<!-- mine -->")  # the last of all files by name: every other one is compared before it
    assert max(FILES - {"manifest.json"}) == "wiring.svg"
    (tmp_path / "rebuild.py").write_text(REBUILD)
    words = [sys.executable, tmp_path / "rebuild.py", "build", "--check", tilted]
    environment = os.environ | {"PYTHONHASHSEED": "4242", "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests' / 'house'}"}
    environment["OPENBLAS_NUM_THREADS"] = "2"  # not as in this process
    done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=BOUND_S)
    drawing.write_bytes(kept)
    assert done.returncode == 1, done.stderr
    assert f"{tilted}: wiring.svg: sha256 " in done.stdout


def _written(folder, files):
    folder.mkdir()
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    manifest = {"files": {name: {} for name in files}}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


def test_the_first_difference_of_two_builds_is_named(tmp_path):
    first = _written(tmp_path / "first", {"a.txt": "a", "parts/b.stl": "b"})
    assert first_difference(first, _written(tmp_path / "same", {"a.txt": "a", "parts/b.stl": "b"})) is None
    other = _written(tmp_path / "other", {"a.txt": "a", "parts/b.stl": "B"})
    assert first_difference(first, other).startswith("parts/b.stl: sha256 ")
    more = _written(tmp_path / "more", {"a.txt": "a", "b.txt": "b", "parts/b.stl": "b"})
    assert first_difference(first, more) == "b.txt: missing"
    assert first_difference(more, first) == "b.txt: the second build has no such file"
    (first / "a.txt").unlink()
    assert first_difference(first, other) == "a.txt: missing"


def test_a_folder_without_a_manifest_is_no_build(tmp_path):
    with pytest.raises(BuildError, match=r"manifest\.json: missing or unreadable"):
        first_difference(tmp_path, _written(tmp_path / "again", {}))


def test_a_build_that_fails_leaves_the_last_one_alone(tmp_path):
    target = tmp_path / "task"
    target.mkdir()
    (target / "recording.mcap").write_bytes(b"mine")
    with pytest.raises(RuntimeError), fresh_folder(target) as work:
        (work / "angles.json").write_text("half")
        raise RuntimeError
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["recording.mcap"]


def test_a_build_that_fails_leaves_no_folder_where_there_was_none(tmp_path):
    with pytest.raises(RuntimeError), fresh_folder(tmp_path / "new" / "out" / "task") as work:
        (work / "angles.json").write_text("half")
        raise RuntimeError
    assert not list(tmp_path.iterdir())


def test_what_the_last_build_had_and_this_one_has_not_is_removed(tmp_path):
    target = tmp_path / "task"
    for files in (["a.txt", "b.txt"], ["a.txt"]):
        with fresh_folder(target) as work:
            for name in files:
                (work / name).write_text(name)
            (work / "manifest.json").write_text(json.dumps({"files": {name: {} for name in files}}))
    assert sorted(path.name for path in target.iterdir()) == ["a.txt", "manifest.json"]


def _build_of(target, files):
    with fresh_folder(target) as work:
        for name in files:
            (work / name).parent.mkdir(parents=True, exist_ok=True)
            (work / name).write_text(name)
        (work / "manifest.json").write_text(json.dumps({"files": {name: {} for name in files}}))


def _files(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_a_manifest_that_names_files_elsewhere_deletes_none_of_them(tmp_path):
    target, victim, other = tmp_path / "out" / "task", tmp_path / "victim.txt", tmp_path / "out" / "victim.txt"
    _build_of(target, ["a.txt"])
    for path in (victim, other):
        path.write_text("somebody's")
    named = ["../victim.txt", "../../victim.txt", str(victim), "parts/../../victim.txt", ""]
    (target / "manifest.json").write_text(json.dumps({"files": {name: {} for name in named}}))
    _build_of(target, ["b.txt"])
    assert victim.exists()
    assert other.exists()


@pytest.mark.parametrize("manifest", ["[]", '{"files": []}', '{"files": {}}', "[" * 100_000, "\0", '{"files": null}'])
def test_a_manifest_that_is_none_is_no_current_build(tilted, manifest):
    kept = (tilted / "manifest.json").read_text()
    (tilted / "manifest.json").write_text(manifest)
    current = is_current(tilted, load_task(tilted / "task.toml"))
    (tilted / "manifest.json").write_text(kept)
    assert not current


@pytest.mark.parametrize("key", ["versions", "code", "task_sha256"])
def test_a_build_of_another_program_or_task_is_not_current(tilted, key):
    kept = (tilted / "manifest.json").read_text()
    (tilted / "manifest.json").write_text(json.dumps(json.loads(kept) | {key: "other"}))
    current = is_current(tilted, load_task(tilted / "task.toml"))
    (tilted / "manifest.json").write_text(kept)
    assert not current


STEPS = 40  # more than a build of three files has


def _killed_at(step, target, files):
    """Build in a child that dies, as by kill -9, before its n-th change of the disk; whether it got that far."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    left = step

    def counted(change):
        def done(*words, **options):
            nonlocal left
            left -= 1
            if left < 0:
                os._exit(9)
            return change(*words, **options)

        return done

    for name in ("replace", "unlink", "rmdir", "mkdir", "write_text"):
        setattr(Path, name, counted(getattr(Path, name)))
    _build_of(target, files)
    os._exit(0)


def test_a_build_that_is_killed_at_any_step_leaves_nothing_unlisted_behind(tmp_path):
    for step in range(STEPS):
        target = tmp_path / str(step) / "task"
        _build_of(target, ["a.txt", "old/b.txt"])
        (target / "mine.txt").write_text("somebody's")
        killed = _killed_at(step, target, ["a.txt", "new/c.txt"])
        _build_of(target, ["d.txt"])
        assert _files(tmp_path / str(step)) == ["task/d.txt", "task/manifest.json", "task/mine.txt"], step
        assert {path.name for path in target.iterdir()} == {"d.txt", "manifest.json", "mine.txt"}, step
        if not killed:  # it was over before, and so is every later one
            break
    assert 15 < step < STEPS - 1


def test_two_builds_of_one_folder_do_not_mix(tmp_path):
    with (
        fresh_folder(tmp_path / "task") as work,
        pytest.raises(BuildError, match="another build of this folder is at work"),
        fresh_folder(tmp_path / "task"),
    ):
        pass
    assert not work.exists()
    _build_of(tmp_path / "task", ["a.txt"])
    assert _files(tmp_path) == ["task/a.txt", "task/manifest.json"]


def test_what_is_in_the_way_is_told_before_anything_moves(tmp_path):
    target = tmp_path / "task"
    _build_of(target, ["a.txt"])
    (target / "parts").write_text("in the way")
    with pytest.raises(BuildError, match="is a file, but the build needs a folder"):
        _build_of(target, ["parts/b.stl"])
    assert _files(target) == ["a.txt", "manifest.json", "parts"]


def test_an_error_of_the_work_is_not_told_of_the_folder(tmp_path):
    with pytest.raises(FileNotFoundError), fresh_folder(tmp_path / "task"):
        (tmp_path / "no such file").read_text()
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(BuildError, match="cannot write the build folder"), fresh_folder(tmp_path / "file" / "task"):
        pass


def test_warnings_of_one_remedy_are_one_unless_asked_for_in_full(tmp_path):
    found = [Finding("turn_from_metal", "note", "shaft", "shaft: of metal", hint="have it turned")]
    checks = tuple(Finding("unverified", "note", "UTM", f"UTM: {v} is not verified") for v in ("a = 1", "b = 2"))
    told = SimpleNamespace(table=list, lines=list, hole_lines=lambda **_: [], preferred_lines=list)
    made = Made(told, told, told, tuple(found), told, "")
    first, _, *gathered = Build(tmp_path, ("one",), ("slow",), checks, made).lines()
    assert first == f"wrote 1 files to {tmp_path}"
    assert gathered[0] == "warning: slow"
    assert gathered[1] == "note: shaft: of metal: have it turned"
    assert gathered[2].startswith("warning: unverified values shape parts (UTM: 2")
    assert len(gathered) == 3
    assert Build(tmp_path, ("one",), (), checks, made).lines(in_full=True)[2:] == [
        "note: shaft: of metal: have it turned",
        "note: UTM: a = 1 is not verified",
        "note: UTM: b = 2 is not verified",
    ]
