"""The walls of the house hold, and each contract can break."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LINT = Path(sys.executable).with_name("lint-imports")


@pytest.fixture
def house(tmp_path):
    for room in ("design", "cad", "firmware_io"):
        shutil.copytree(ROOT / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def lint(house):
    return subprocess.run([LINT, "--no-cache"], cwd=house, capture_output=True, text=True)


def test_the_house_as_it_stands(house):
    assert lint(house).returncode == 0


@pytest.mark.parametrize(
    ("room", "line"),
    [
        ("design", "import cad.layout.direct_stack"),
        ("design", "import firmware_io.samples"),
        ("cad", "import firmware_io.samples"),
        ("firmware_io", "import cad.layout.direct_stack"),
        ("design", "import cadquery"),
        ("firmware_io", "import OCP"),
        ("cad", "import serial"),
        ("design", "import dynamixel_sdk"),
        ("cad", "import scanwright"),
        ("firmware_io", "import typer"),
    ],
)
def test_each_contract_can_break(house, room, line):
    (house / room / "intruder.py").write_text(line + "\n")
    told = lint(house)
    assert told.returncode == 1
    assert "BROKEN" in told.stdout
