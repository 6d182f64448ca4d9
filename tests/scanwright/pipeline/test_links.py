"""Links in a folder of results: whatever a link or a manifest names, nothing outside is written or removed."""

import json
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanwright.cli.app import run as scanwright_command
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import BuildError, DeviceError
from scanwright.design.evaluation.comparison_table import write_csv
from scanwright.design.files.atomic_file import atomic_write
from scanwright.firmware_io.device_ports import Ports, announced
from scanwright.pipeline import records
from scanwright.pipeline.folder import fresh_folder
from scanwright.pipeline.manifest import MANIFEST, enter
from scanwright.study.results import Results, open_results

FILES = ("a", "parts/a", "parts/b", "parts/deep/c", "print/a", "recordings/r")
PLACES = (*FILES, "parts", "parts/deep", "print", "recordings", MANIFEST)
KINDS = ("file", "folder", "dangling", "sibling file", "sibling folder")
names = st.sets(st.sampled_from(FILES))


def state(folder):
    """Every entry of a folder, links unfollowed: name -> content, target of the link, or None for a folder."""
    return {
        path.relative_to(folder).as_posix(): path.readlink()
        if path.is_symlink()
        else path.read_bytes()
        if path.is_file()
        else None
        for path in folder.rglob("*")
    }


def put(folder, name, text):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def link(folder, name, kind, outside):
    """Put a link where a file or a folder would be; leaves what is there already."""
    where = {
        "file": outside / "a",
        "folder": outside,
        "dangling": outside / "nothing",
        "sibling file": folder / "own",
        "sibling folder": folder / "own_folder",
    }
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() and not path.is_symlink():
        path.symlink_to(where[kind])


def is_through_a_link(folder, name):
    return any(path.is_symlink() for path in (folder / name, *(folder / name).parents) if path.is_relative_to(folder))


@settings(max_examples=60)
@given(before=names, made=names, links=st.dictionaries(st.sampled_from(PLACES), st.sampled_from(KINDS), max_size=3))
def test_whatever_links_a_build_folder_holds_nothing_outside_changes(before, made, links):
    with tempfile.TemporaryDirectory() as name:
        root, outside = Path(name) / "task", Path(name) / "outside"
        for file in ("a", "b", "deep/c"):
            put(outside, file, "precious")
        for file in ("own", "own_folder/a"):
            put(root, file, "mine")
        for place, kind in sorted(links.items(), key=lambda pair: len(pair[0])):
            if not is_through_a_link(root, place):
                link(root, place, kind, outside)
        for file in before:
            if not is_through_a_link(root, file):
                put(root, file, "old")
        if not (root / MANIFEST).is_symlink():
            put(root, MANIFEST, json.dumps({"files": {file: {} for file in before}}))
        there, elsewhere = state(root), state(outside)
        known = (before if not (root / MANIFEST).is_symlink() else set()) | made | {MANIFEST}
        blocked = any(is_through_a_link(root, file) for file in known)

        def build():
            with fresh_folder(root) as work:
                for file in made:
                    put(work, file, "new")
                put(work, MANIFEST, json.dumps({"files": {file: {} for file in made}}))

        if blocked:
            with pytest.raises(BuildError, match="a symbolic link"):
                build()
            assert state(root) == there
        else:
            build()
            assert {file: (root / file).read_text() for file in made} == dict.fromkeys(made, "new")
            assert not any((root / file).exists() for file in before - made)
        assert state(outside) == elsewhere
        assert {entry: text for entry, text in state(root).items() if entry.startswith("own")} == {
            "own": b"mine",
            "own_folder": None,
            "own_folder/a": b"mine",
        }


def test_a_build_folder_may_itself_be_a_link(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "task").symlink_to(tmp_path / "disk")
    with fresh_folder(tmp_path / "task") as work:
        put(work, MANIFEST, "{}")
    assert [path.name for path in (tmp_path / "disk").iterdir()] == [MANIFEST]
    assert (tmp_path / "task").is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["disk", "task"]


@pytest.mark.parametrize("to", ["file", "dangling"])
def test_everything_that_writes_into_a_folder_of_results_refuses_or_replaces_a_link(to, tmp_path, monkeypatch):
    folder, precious = tmp_path / "task", tmp_path / "precious"
    if to == "file":
        precious.write_text("mine")
    folder.mkdir()

    def linked(name):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).symlink_to(precious)

    for name in ("report.html", "emulated.json", "compare.csv", f".study.csv.{os.getpid()}.part", "results.json"):
        linked(name)
    linked("ab/abc.json")
    monkeypatch.setattr(records, "require_as_built", lambda *_, **__: None)
    monkeypatch.setattr("scanwright.report.page.report_html", lambda *_: "a page")
    with pytest.raises(BuildError, match=r"report.html: a symbolic link"):
        records.write_report(folder)
    with pytest.raises(DeviceError, match=r"emulated.json: a symbolic link"), announced(folder, Ports("a", "b")):
        pass
    with pytest.raises(BuildError, match=r"results.json: a symbolic link"):
        open_results(folder)
    with pytest.raises(BuildError, match=r"abc.json: a symbolic link"):
        Results(folder, "").put("abc", {})
    write_csv(folder / "compare.csv", [])
    with atomic_write(folder / "study.csv", BuildError) as part:
        part.write_text("text")
    put(folder, MANIFEST, '{"files": {}}')
    (folder / f"{MANIFEST}.part").symlink_to(precious)
    put(folder, "new", "text")
    enter(folder, "new")
    assert "new" in json.loads((folder / MANIFEST).read_text())["files"]
    assert (precious.read_text() if to == "file" else precious.exists()) == ("mine" if to == "file" else False)


def test_a_scan_does_not_record_through_a_linked_folder_one_line_and_exit_2(tmp_path, monkeypatch, capsys):
    angles = Angles(alpha_rot=0, beta_rot=-55, alpha_laser=-80, beta_laser=75)
    motion = {"mode": "spin", "period_s": 2.0}
    angle_set = AngleSet(task="task", angles_deg=angles, sensor="UTM-30LX", servo="MX-64R", motion=motion)
    (tmp_path / "angles.json").write_text(angle_set.to_json())
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "recordings").symlink_to(tmp_path / "elsewhere")
    words = ["scan", str(tmp_path), "--lidar", "127.0.0.1:1", "--servo", "none", "--dry-run"]
    monkeypatch.setattr("sys.argv", ["scanwright", *words])
    with pytest.raises(SystemExit) as ended:
        scanwright_command()
    (line,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2
    assert line.startswith(f"error: {tmp_path / 'recordings'}: a symbolic link")
    monkeypatch.setattr("sys.argv", ["scanwright", *words, "--recording", str(tmp_path / "recordings" / "r.mcap")])
    with pytest.raises(SystemExit) as ended:
        scanwright_command()  # a place that the person names is theirs to choose
    assert not ended.value.code
