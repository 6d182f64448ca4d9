"""The version is written in one file; everything else that states it agrees."""

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

import scanwright
from scanwright.pipeline.manifest import versions

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_a_version_is_three_numbers():
    assert re.fullmatch(r"\d+\.\d+\.\d+((a|b|rc|\.dev)\d+)?", scanwright.__version__)


def test_the_build_reads_the_version_of_the_package():
    assert "version" not in PROJECT["project"]
    assert PROJECT["tool"]["hatch"]["version"] == {"path": "scanwright/__init__.py"}


def test_an_installation_has_the_version_of_its_code():
    assert version("scanwright") == scanwright.__version__, "run `uv sync`: the installed metadata are older"


def test_the_command_prints_the_version(command):
    assert command("--version") == (0, f"scanwright {scanwright.__version__}\n", [])


def test_a_manifest_and_the_citation_state_the_version():
    assert versions()["scanwright"] == scanwright.__version__
    assert re.findall(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE) == [scanwright.__version__]


@pytest.mark.parametrize("group", PROJECT["dependency-groups"])
def test_tools_have_exact_versions(group):
    tools = [tool for tool in PROJECT["dependency-groups"][group] if isinstance(tool, str)]
    assert [tool for tool in tools if "==" not in tool] == (["scanwright[all]"] if group == "dev" else [])
