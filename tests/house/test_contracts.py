"""The walls of the house hold, and each contract can break."""

import re
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
    "cad": ("cad/solids.py", "import scanwright.cad.parts.mounts.base_mount"),
    "cad-layout": ("cad/layout/deck.py", "import scanwright.cad.solids"),
    "cad-layout-steps": ("cad/layout/direct/stack.py", "import scanwright.cad.layout.deck"),
    "firmware_io": ("firmware_io/recording/recording.py", "import scanwright.firmware_io.assembly.turns"),
    "scanwright": ("scanwright/report/page.py", "import scanwright.pipeline.folder"),
    "door": ("firmware_io/samples.py", "import typer"),
    "kernel": ("firmware_io/samples.py", "import cadquery"),
    "wire": ("cad/kernel.py", "import serial"),
    "hands": ("scanwright/api/parts.py", "import OCP"),
}


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    folder = tmp_path_factory.mktemp("house")
    left_out = shutil.ignore_patterns("__pycache__", "*.toml", "*.j2")
    for room in ("scanwright", "design", "cad", "firmware_io"):
        shutil.copytree(ROOT / room, folder / room, symlinks=True, ignore=left_out)
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def lint(house):
    return subprocess.run([LINT, "--no-cache"], cwd=house, capture_output=True, text=True).stdout


def test_each_contract_holds_and_each_can_break(house):
    """No intruder breaks another contract than its own, so one run shows all of them."""
    assert re.findall(r"Contracts: (.*)\.", lint(house)) == [f"{len(CONTRACTS)} kept, 0 broken"]
    for file, line in INTRUDERS.values():
        with (house / file).open("a", encoding="utf-8") as module:
            module.write(f"\n\ndef intruder():\n    {line}\n")  # an import in a function counts as any other
    (house / "firmware_io" / "intruder.py").write_text("import scanwright.design.errors\n")
    found = lint(house)
    assert re.findall(r"Contracts: (.*)\.", found) == [f"0 kept, {len(CONTRACTS)} broken"]
    assert "not listed as layers:\n\n- scanwright.firmware_io.intruder" in found


def test_every_contract_has_an_intruder():
    assert list(INTRUDERS) == CONTRACTS
