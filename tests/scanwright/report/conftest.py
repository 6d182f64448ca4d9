"""What the tests of the report share."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from report_folder import Page, write_folder


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A build folder with a report: for reading only."""
    folder = tmp_path_factory.mktemp("builds") / "ground_ahead"
    folder.mkdir()
    write_folder(folder)
    return folder


@pytest.fixture(scope="session")
def text(folder):
    """Its page."""
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def page(text):
    """The same, taken apart."""
    return Page(text)
