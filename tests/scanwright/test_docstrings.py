"""The example in the docstring of each public function runs, in a folder with the files that the examples name."""

import doctest
import shutil
from inspect import isfunction

import pytest

import scanwright as sw
from benchmarks.firmware_io.calibration import designed
from benchmarks.firmware_io.rooms import FURNISHED, Setup, Truth, simulate, write
from scanwright import api
from scanwright.cad.checks.checks_json import read_checks
from scanwright.design.motion import Spin
from scanwright.firmware_io.calibration import entropy
from scanwright.firmware_io.emulators.scanner import emulated_scanner
from scanwright.firmware_io.emulators.world import room
from scanwright.firmware_io.recording.convert import export_bag

FUNCTIONS = {name for name, value in vars(api).items() if isfunction(value)}
OF_BUILDS = {"build", "make_parts", "check"}
OF_DEVICES = {"open_servo", "set_up_servo", "open_lidar", "scan"}
SETUP = Setup(beams=120)
SCANNER = designed(SETUP).model_copy(update={"sensor": "UTM-30LX", "motion": Spin(period_s=2.0)})


def run(name, **names):
    """Run the example of a function with further names in it."""
    (example,) = doctest.DocTestFinder(recurse=False).find(getattr(sw, name), name, globs=names)
    tried = doctest.DocTestRunner(verbose=False).run(example)
    assert (tried.failed, tried.attempted > 1) == (0, True)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """A folder with an angle set, a recording, a bag of it, and two clouds of one place."""
    folder = tmp_path_factory.mktemp("examples")
    (folder / "angles.json").write_text(SCANNER.to_json())
    for seed, cloud in enumerate(("a", "b")):
        recording = write(folder / "turn.mcap", simulate(FURNISHED, SETUP, Truth(), seed=seed))
        sw.assemble(recording, SCANNER, folder / f"{cloud}.ply")
    export_bag(folder / "turn.mcap", folder / "turn.bag")
    return folder


@pytest.fixture
def here(recordings, monkeypatch):
    monkeypatch.chdir(recordings)
    monkeypatch.setattr(entropy, "_SAMPLE", 1500)  # the pairs of points grow with the square


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "angles.json").write_text(SCANNER.to_json())
    return tmp_path


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", sorted(FUNCTIONS - OF_BUILDS - OF_DEVICES))
def test_an_example_runs(name):
    run(name)


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", sorted(OF_DEVICES))
def test_an_example_with_devices_runs(name):
    with emulated_scanner(SCANNER, room(None)) as emulators:
        run(name, servo_port=emulators.ports.servo, lidar_port=emulators.ports.lidar)


@pytest.mark.parametrize("name", sorted(OF_BUILDS))
def test_an_example_of_a_build_runs(folder, made, name, monkeypatch):
    monkeypatch.setattr("scanwright.cad.assembly.make.make_parts", lambda _: made.result.assembly)
    monkeypatch.setattr("scanwright.cad.checks.run.check_scanner", lambda *_: read_checks(made.folder / "checks.json"))
    shutil.copytree(made.folder, folder / "out" / made.folder.name)
    (folder / f"{made.folder.name}.toml").write_text((made.folder / "task.toml").read_text())
    run(name)
