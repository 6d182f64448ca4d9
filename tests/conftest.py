"""What several test files share."""

import os
import sys
from pathlib import Path

import pytest

import scanwright


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
