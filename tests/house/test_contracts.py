"""The walls of the house hold, and each contract can break."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LINT = Path(sys.executable).with_name("lint-imports")
CONTRACTS = [c["id"] for c in tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]]
INTRUDERS = {  # contract -> a file, and an import in it that breaks that one
    "design": ("design/sphere/regions.py", "import scanwright.design.search.constraints"),
    "cad": ("cad/layout/deck.py", "import scanwright.cad.parts.base_mount"),
    "cad-layout": ("cad/layout/deck.py", "import scanwright.cad.solids"),
    "cad-layout-steps": ("cad/layout/direct/stack.py", "import scanwright.cad.layout.deck"),
    "firmware_io": ("firmware_io/recording/recording.py", "import scanwright.firmware_io.assembly.turns"),
    "scanwright": ("scanwright/report/page.py", "import scanwright.pipeline.folder"),
    "door": ("firmware_io/samples.py", "import typer"),
    "kernel": ("design/frames.py", "import cadquery"),
    "wire": ("cad/kernel.py", "import serial"),
    "hands": ("scanwright/api/parts.py", "import OCP"),
}


@pytest.fixture
def house(tmp_path):
    left_out = shutil.ignore_patterns("__pycache__", "*.toml", "*.j2")
    for room in ("scanwright", "design", "cad", "firmware_io"):
        shutil.copytree(ROOT / room, tmp_path / room, symlinks=True, ignore=left_out)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def lint(house, *words):
    return subprocess.run([LINT, "--no-cache", *words], cwd=house, capture_output=True, text=True)


def test_the_house_as_it_stands(house):
    told = lint(house)
    assert told.returncode == 0, told.stdout


def test_every_contract_has_an_intruder():
    assert list(INTRUDERS) == CONTRACTS


@pytest.mark.parametrize("contract", CONTRACTS)
def test_each_contract_can_break(house, contract):
    file, line = INTRUDERS[contract]
    with (house / file).open("a", encoding="utf-8") as module:
        module.write(f"\n\ndef intruder():\n    {line}\n")  # an import in a function counts as any other
    told = lint(house, "--contract", contract)
    assert told.returncode == 1
    assert "BROKEN" in told.stdout


def test_a_module_that_no_layer_names_breaks_a_contract(house):
    (house / "design" / "intruder.py").write_text("import scanwright.design.errors\n")
    assert lint(house, "--contract", "design").returncode == 1
