"""What several test files share."""

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import settings

import scanwright

# CI judges the change, not the dice, and shares its cores; at a developer's desk every run draws new examples
settings.register_profile("ci", derandomize=True, deadline=None)
if os.environ.get("CI"):
    settings.load_profile("ci")


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of real recordings, from the environment variable SCANWRIGHT_DATA."""
    folder = os.environ.get("SCANWRIGHT_DATA")
    if not folder:
        pytest.skip("SCANWRIGHT_DATA is not set: it names the folder of real recordings")
    return Path(folder)


@pytest.fixture
def command(monkeypatch, capsys):
    """Run a command as its user would: exit code, what it printed, and the lines of complaint (progress left out)."""

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["scanwright", *map(str, words)])
        try:
            scanwright.run()
            code = 0
        except SystemExit as stop:
            code = stop.code or 0
        printed = capsys.readouterr()
        return code, printed.out, [line for line in printed.err.splitlines() if not line.startswith("  ..")]

    return run


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """One tilted scanner with all its files: the folder, what was made and exported, and the scanner."""
    from cad.build import build_parts
    from cad.deck import mount_offset_mm
    from cad.exports import export_scanner
    from design.angles import Angles, AngleSet
    from design.catalogue import load_catalogue
    from design.scanner import scanner_of

    angles = AngleSet(
        task="tilted",
        angles_deg=Angles(alpha_rot=0, beta_rot=35, alpha_laser=-20, beta_laser=-70),
        sensor="UTM-30LX",
        servo="MX-64R",
        slip_ring="UH1256-02-0610-06S",
        motion={"mode": "spin", "period_s": 18.0},
    )
    offset = mount_offset_mm(scanner_of(angles, "fdm-0.4", load_catalogue()))
    scanner = scanner_of(angles.model_copy(update={"t_world_rot_mm": offset}), "fdm-0.4", load_catalogue())
    folder = tmp_path_factory.mktemp("made")
    result = build_parts(scanner, folder, lambda _: None)
    exports = export_scanner(scanner, result, folder, lambda _: None)
    return SimpleNamespace(folder=folder, result=result, exports=exports, scanner=scanner)
