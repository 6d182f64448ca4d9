"""The front page keeps its promises: short, its Python runs, its links and commands exist."""

import json
import re
import tomllib
from pathlib import Path

import pytest

import scanwright as sw

ROOT = Path(__file__).parent.parent
TOP = "README", "CONTRIBUTING", "CHANGELOG", "SECURITY"
PAGES = [*(ROOT / f"{name}.md" for name in TOP), *sorted((ROOT / "docs").glob("*.md"))]
README = (ROOT / "README.md").read_text()


def test_readme_is_a_front_page():
    assert len(README.splitlines()) <= 130


def test_the_python_of_readme_runs(capsys):
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    exec(compile(block, "README.md", "exec"), {})
    said = capsys.readouterr().out
    assert "(720, 1081)" in said


def test_the_task_of_readme_is_one():
    (block,) = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    assert sw.load_task(tomllib.loads(block)).task.motion.duration_s == 18.0


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    """GitHub shows these pages as they are; the build of the pages looks at anchors too."""
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text()):
        if not target.startswith(("http", "reference/")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("page", [*PAGES, *sorted((ROOT / "docs/how-to").glob("*.md"))], ids=lambda page: page.name)
def test_commands_exist(page):
    text = page.read_text()
    for module in set(re.findall(r"python -m (benchmarks[\w.]+)", text)):
        path = ROOT / module.replace(".", "/")
        assert path.with_suffix(".py").exists() or (path / "__main__.py").exists(), module
    for folder in set(re.findall(r"(?<![\w/])tests/[\w/.]+", text)):
        assert (ROOT / folder).exists(), folder


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_paths_of_the_project_exist(page):
    for path in re.findall(
        r"`((?:design|cad|firmware_io|scanwright|benchmarks|examples|docs|tests)/[\w./-]*)`", page.read_text()
    ):
        assert (ROOT / path).exists(), f"{page.name}: {path}"


def test_pictures_are_small():
    assert all(picture.stat().st_size <= 500_000 for picture in (ROOT / "docs/pictures").iterdir())


def test_the_angle_set_of_a_page_is_valid_and_its_comparison_runs(tmp_path, capsys, monkeypatch):
    (block,) = re.findall(r"```json\n(.*?)```", (ROOT / "docs/how-to/a-bag.md").read_text(), re.DOTALL)
    (tmp_path / "mine.json").write_text(block)
    assert sw.load_angles(tmp_path / "mine.json").t_rot_laser_mm == (0, -80, 0)
    (tmp_path / "out" / "ground_ahead").mkdir(parents=True)
    moving = json.loads(block) | {"sensor": "LD19", "motion": {"mode": "spin", "period_s": 4}}
    (tmp_path / "out" / "ground_ahead" / "angles.json").write_text(json.dumps(moving))
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/how-to/calibrate.md").read_text(), re.DOTALL)
    exec(compile(code, "calibrate.md", "exec"), {})
    median_mm = float(capsys.readouterr().out.split()[1])
    assert 1 < median_mm < 30  # of 0.5 deg at most in a room of some metres


def test_the_price_in_the_readme_is_that_of_the_table():
    row = re.search(r"^\| `low_cost` .*", (ROOT / "docs/choose-hardware.md").read_text(), re.MULTILINE)
    assert row is not None
    low, high = re.findall(r"(\d+) to (\d+)", row[0])[0]
    assert f"${low} to ${high}" in (ROOT / "README.md").read_text()
