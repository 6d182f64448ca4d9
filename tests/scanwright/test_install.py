"""What is not installed is said in one line, before anything else is done; what is imported stays light."""

import ctypes
import re
import subprocess
import sys
from importlib.metadata import requires

import pytest

from scanwright.pipeline.manifest import versions

NEEDS = {  # a file that is not there would be named first, if anything were looked at before the extra
    ("build", "no_such_task"): ("cadquery", "build needs the CAD kernel: pip install 'scanwright[cad]'"),
    ("build", "--check", "no_such"): ("manifold3d", "build needs the CAD kernel: pip install 'scanwright[cad]'"),
    ("check", "no_such"): ("shapely", "check needs the CAD kernel: pip install 'scanwright[cad]'"),
    ("report", "no_such"): ("jinja2", "report needs jinja2: pip install 'scanwright[cad]'"),
    ("studio", "no_such_task"): ("viser", "studio needs a page server: pip install 'scanwright[pages]'"),
    ("scan", "no_such", "--live"): ("websockets", "scan --live needs a page server: pip install 'scanwright[pages]'"),
    ("convert", "no_such.ply", "b.las"): ("laspy", "b.las: las needs laspy: pip install 'scanwright[clouds]'"),
    ("convert", "a.laz", "b.ply"): ("lazrs", "a.laz: laz needs laspy and lazrs: pip install 'scanwright[clouds]'"),
    ("convert", "no_such.ply", "b.pcd"): ("pypcd4", "b.pcd: pcd needs pypcd4: pip install 'scanwright[clouds]'"),
    ("register", "no_such.ply", "-o", "b.e57"): ("pye57", "b.e57: e57 needs pye57: pip install 'scanwright[clouds]'"),
}


@pytest.mark.parametrize("words", NEEDS, ids=" ".join)
def test_a_missing_extra_is_one_line_and_the_first(monkeypatch, tmp_path, command, words):
    package, line = NEEDS[words]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, package, None)  # as if it were not installed
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    assert command(*words) == (2, "", [f"error: {line}"])
    assert not list(tmp_path.iterdir())


def test_on_a_computer_without_a_wheel_the_line_does_not_send_in_circles(monkeypatch, command):
    monkeypatch.setitem(sys.modules, "pye57", None)
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    code, _, (line,) = command("convert", "a.e57", "b.ply")
    assert code == 2
    assert "no wheel for Linux on aarch64: choose another format" in line


@pytest.mark.skipif(sys.platform != "linux", reason="other systems bring the library")
@pytest.mark.parametrize("words", [("build", "no_such_task"), ("check", "no_such"), ("studio", "no_such_task")])
def test_a_missing_library_of_the_system_is_named_before_anything_is_searched(monkeypatch, command, words):
    def load(name):
        raise OSError(f"{name}: cannot open shared object file: No such file or directory")

    monkeypatch.setattr(ctypes, "CDLL", load)
    code, out, (line,) = command(*words)
    assert (code, out) == (2, "")
    assert re.fullmatch(rf"error: {words[0]} needs .*libGL\.so\.1.*apt-get install .*libgl1", line)


def test_the_package_is_imported_without_what_is_heavy():
    heavy = {"cadquery", "OCP", "scipy.spatial", "numba", "matplotlib", "trimesh", "viser"}
    code = f"import scanwright, sys; print(sorted(sys.modules.keys() & {heavy}))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "[]\n"


def test_what_writes_a_build_is_pinned_and_what_runs_on_a_robot_is_not():
    lines = {extra: [line for line in requires("scanwright") if f"extra == '{extra}'" in line] for extra in ("cad",)}
    pinned = {line.split("==")[0] for line in lines["cad"]}
    assert all(re.match(r"[\w-]+==[\w.]+($|;| )", line) for line in lines["cad"])
    assert versions().keys() - {"scanwright"} == pinned
    base = [line for line in requires("scanwright") if "extra ==" not in line]
    assert base
    assert all(re.fullmatch(r"[\w-]+>=[\w.]+(;.*)?", line) for line in base)
