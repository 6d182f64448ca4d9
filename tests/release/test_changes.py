"""Change notes are short lines of a known type, so that a release has one page of them."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CONFIGURED = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["towncrier"]
TYPES = [kind["directory"] for kind in CONFIGURED["type"]]
MOST_CHARACTERS = 160
MOST_LINES = 60


def fault_of(name, text):
    """What is wrong with a change note; None if nothing is."""
    if not re.fullmatch(rf"\+[a-z0-9-]+\.({'|'.join(TYPES)})\.md", name):
        return f"{name}: allowed are names such as +undo-file.added.md, with a type of {', '.join(TYPES)}"
    if not re.fullmatch(r"\S[^\n]*\S\n", text) or text.startswith(("-", "#")):
        return f"{name}: one line of text, without a bullet"
    if len(text) > MOST_CHARACTERS + 1:
        return f"{name}: too long (got {len(text) - 1} characters, allowed {MOST_CHARACTERS})"
    return None


def notes():
    return [path for path in sorted((ROOT / CONFIGURED["directory"]).iterdir()) if path.name != "README.md"]


def test_each_note_has_a_known_type_and_is_one_short_line():
    assert [fault for path in notes() if (fault := fault_of(path.name, path.read_text(encoding="utf-8")))] == []


def test_a_release_has_at_most_a_page_of_notes():
    assert len(notes()) <= MOST_LINES
    page = (ROOT / "CHANGELOG.md").read_text()
    assert [
        release for release in re.split(r"^## ", page, flags=re.MULTILINE) if release.count("\n") > MOST_LINES
    ] == []


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("+a.mended.md", "Text.\n"),
        ("a.fixed.md", "Text.\n"),
        ("+a.fixed.txt", "Text.\n"),
        ("+a.fixed.md", ""),
        ("+a.fixed.md", "Two\nlines.\n"),
        ("+a.fixed.md", "- A bullet.\n"),
        ("+a.fixed.md", "x" * 161 + "\n"),
    ],
)
def test_a_faulty_note_is_named(name, text):
    assert fault_of(name, text).startswith(f"{name}: ")
    assert fault_of("+a.fixed.md", "Text.\n") is None


def test_towncrier_puts_each_note_under_its_type():
    command = [sys.executable, "-m", "towncrier", "build", "--draft", "--version", "9.9.9", "--date", "2000-01-01"]
    draft = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, encoding="utf-8").stdout
    assert draft.startswith("## 9.9.9 (2000-01-01)\n")
    parts = dict(re.findall(r"^### (\w+)\n(.*?)(?=^### |\Z)", draft, re.MULTILINE | re.DOTALL))
    for path in notes():
        assert f"- {path.read_text(encoding='utf-8')}" in parts[path.name.split(".")[1].capitalize()]


def test_the_changelog_has_the_line_that_towncrier_looks_for():
    assert (ROOT / CONFIGURED["filename"]).read_text().count(CONFIGURED["start_string"]) == 1
