"""The scan, the calibration and the cloud of the tutorial print the lines of the page, on a virtual clock."""

import re
from pathlib import Path

import pytest
from virtual_scanner import VirtualScanner

from benchmarks.scanwright.printed.blocks import NUMBER, blocks_of
from scanwright.design.angles import AngleSet
from scanwright.firmware_io.calibration import entropy
from scanwright.firmware_io.scan import lidar_scans

TUTORIAL = (Path(__file__).parents[2] / "docs/tutorial.md").read_text(encoding="utf-8")
LATE = "dropped : servo angles with uncertain timestamp"  # on a computer that does other work too
FOLDER = Path("out/ground_ahead")
SCANNER = AngleSet.model_validate(
    {
        "task": "ground_ahead",
        "angles_deg": {"alpha_rot": -180, "beta_rot": 55.61, "alpha_laser": 78.72, "beta_laser": -79.75},
        "sensor": "UTM-30LX",
        "servo": "MX-64R",
        "motion": {"mode": "spin", "period_s": 2.0},
    }
)


def kinds(lines):
    """Return lines without numbers, and without the breaks of long ones."""
    joined = re.sub(r"\n {2,}(?=[^ ])(?! *[\w ]+ {3,})", " ", "\n".join(lines))
    return [re.sub(rf"(?:{NUMBER})+|\s+", " ", line).strip() for line in joined.splitlines()]


@pytest.fixture
def run(monkeypatch, tmp_path, command):
    """Run the command of a block of the page here; what it prints, and what the page shows."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(lidar_scans, "_CLOCK_LEAST_S", 0.3)
    monkeypatch.setattr(entropy, "_SAMPLE", 1500)
    FOLDER.mkdir(parents=True)
    (FOLDER / "angles.json").write_text(SCANNER.to_json())
    VirtualScanner(SCANNER).install(monkeypatch)

    def compared(name, *more):
        block = next(one for one in blocks_of(TUTORIAL) if one.command.startswith(f"scanwright {name} "))
        code, printed, _ = command(*block.command.replace("\\\n", " ").split()[1:], *more)
        assert code == 0
        return kinds(printed.splitlines()), kinds(block.output)

    return compared


def test_the_tutorial_shows_what_a_scan_its_calibration_and_its_cloud_print(run):
    printed, page = run("scan", "--lidar", "lidar", "--servo", "servo")
    start = next(k for k, line in enumerate(page) if line.startswith("frames"))
    assert set(page[start:]) - {LATE} <= set(printed)
    printed, page = run("calibrate")
    assert set(page) - {"wrote out/ground_ahead/scanner.calibrated.urdf"} <= set(printed)
    printed, page = run("assemble")
    assert page == printed
