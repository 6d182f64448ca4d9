"""The hosted workflows call scripts of `.ci/` and hold no command, no secret and no more rights than they need."""

import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
STEPS = re.findall(r"^(\w+)\(\) \{", (ROOT / ".ci/run").read_text(), re.MULTILINE)


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_runs_scripts_of_ci_and_nothing_else(path):
    read = yaml.safe_load(path.read_text())
    assert read["permissions"] == {"contents": "read"}
    assert "secrets." not in path.read_text()
    for job in read["jobs"].values():
        assert "uses" in job or job["timeout-minutes"] <= 90
        for step in job.get("steps", ()):
            script, *words = step.get("run", ".ci/run").split()
            assert script.startswith(".ci/") and (ROOT / script).is_file()
            assert script != ".ci/run" or set(words[:1]) <= set(STEPS)


@pytest.mark.parametrize("path", sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml")), ids=lambda path: path.name)
def test_an_issue_form_asks_named_questions(path):
    read = yaml.safe_load(path.read_text())
    fields = [field for field in read.get("body", ()) if field["type"] != "markdown"]
    assert path.name == "config.yml" or len({field["id"] for field in fields}) == len(fields) >= 3


def test_the_matrix_has_every_python_of_the_classifiers():
    matrix = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())["jobs"]["quick"]["strategy"]["matrix"]
    stated = re.findall(r'"Programming Language :: Python :: (3\.\d+)"', (ROOT / "pyproject.toml").read_text())
    assert matrix["python"] == stated
