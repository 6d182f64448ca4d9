"""What a robot does with the base install alone, no extra: run in an environment that holds nothing else.

Every module loads or lacks a package of a named extra; no file is missing beside them; twins are scanned to a cloud,
that is assembled again and registered; what needs an extra is refused in one line.
"""

import importlib
import json
import pkgutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

EXTRAS = {  # of the modules below a package, if no name below it has its own
    "scanwright.design": set(),
    "scanwright.firmware_io": {"laspy", "lzf", "pye57", "pypcd4", "launch", "builtin_interfaces", "rclpy"},
    "scanwright.cad": {"cadquery"},
    "scanwright": {"cadquery", "jinja2", "manifold3d", "msgspec", "viser", "websockets"},
}
ANGLES = {
    "schema": "scanwright/angles/1",
    "task": "base",
    "angles_deg": {"alpha_rot": 0, "beta_rot": -55, "alpha_laser": -80, "beta_laser": 75},
    "sensor": "URG-04LX",
    "servo": "MX-64R",
    "motion": {"mode": "spin", "period_s": 5.0},
}
COMMAND = Path(sys.executable).with_name("scanwright")


def load_every_module() -> None:
    """Import all there is; what is missing belongs to an extra, and to one of those that the room may ask for."""
    for module in pkgutil.walk_packages(importlib.import_module("scanwright").__path__, "scanwright."):
        package = next(name for name in EXTRAS if module.name.startswith(name))
        try:
            if package != "scanwright.cad" and not module.name.endswith("__main__"):
                importlib.import_module(module.name)
        except ModuleNotFoundError as error:
            lacks = str(error.name).partition(".")[0]
            assert lacks in EXTRAS[package], (
                f"{module.name} lacks {lacks}: in the base, or in an extra asked for first?"
            )
    assert "cadquery" not in sys.modules


def find_every_file() -> None:
    """What is no code is installed beside it: products, tasks, templates, scripts of the pages, type marks."""
    checkout = Path(__file__).parents[1]
    for package in EXTRAS:
        installed = Path(str(importlib.import_module(package).__file__)).parent
        folder = checkout / package.rpartition(".")[2]
        files = [path.relative_to(folder) for path in folder.rglob("*") if path.is_file()]
        absent = [file for file in files if "__pycache__" not in file.parts and not (installed / file).exists()]
        assert not absent, f"{package}: not in the wheel: {absent}"


def run(*words: str | Path) -> str:
    """What a command of the installed program prints."""
    told = subprocess.run([COMMAND, *words], text=True, capture_output=True)
    assert told.returncode == 0, told.stderr
    return told.stdout


def scan_once_or_twice(folder: Path, recording: Path) -> None:
    """A computer that stands still for a second looks like both devices falling silent, and a scan ends so by right."""
    try:
        run("scan", folder, "-o", recording)
    except AssertionError as silent:
        print("scanned once more, after:", silent, sep="\n")
        recording.unlink(missing_ok=True)
        run("scan", folder, "-o", recording)


def scan_the_twins(folder: Path) -> None:
    """From an angle set to a map."""
    (folder / "angles.json").write_text(json.dumps(ANGLES))
    with subprocess.Popen([COMMAND, "emulate", folder]) as twins:
        try:
            while not (folder / "emulated.json").exists():
                assert twins.poll() is None
                time.sleep(0.1)
            for scan in ("a", "c"):
                scan_once_or_twice(folder, folder / f"{scan}.mcap")
        finally:
            twins.terminate()
    run("assemble", folder / "a.mcap", "--angles", folder / "angles.json", "-o", folder / "b.ply")
    assert (folder / "a.ply").read_bytes() == (folder / "b.ply").read_bytes()
    assert "sigma" in run("register", folder / "a.ply", folder / "c.ply", "-o", folder / "map.ply")


def refuse_what_needs_an_extra() -> None:
    """One line, and nothing done."""
    told = subprocess.run([COMMAND, "build", "ground_ahead"], text=True, capture_output=True)
    line = "error: build needs the CAD kernel: pip install 'scanwright[cad]'\n"
    assert (told.returncode, told.stdout, told.stderr) == (2, "", line)


if __name__ == "__main__":
    load_every_module()
    find_every_file()
    with tempfile.TemporaryDirectory() as temporary:
        scan_the_twins(Path(temporary))
    run("evaluate", "rolling", "--angles=0,90,0,-90")
    refuse_what_needs_an_extra()
    print("the base install scans, assembles, registers and evaluates; build asks for its extra")
