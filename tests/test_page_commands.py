"""The shell lines of the pages work as typed: quick ones run, and the program accepts the others.

Lines of three pages are typed by everybody. Each either runs here in a sandbox, or is in `ELSEWHERE` with the reason.
"""

import re
import shlex
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from typer.main import get_command

from scanwright.cli.app import app

ROOT = Path(__file__).parent.parent
PAGES = ["README.md", *(path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "docs").rglob("*.md")))]
PAGES = [page for page in PAGES if "_build" not in page and "docs/reference/" not in page]
TYPED_BY_ALL = ["README.md", "docs/install.md", "docs/how-to/first-hour.md"]
HERE = {"source .venv/bin/activate", "scanwright --version", "scanwright new"}  # beginnings of lines
ELSEWHERE = {  # beginnings of lines: why they do not run here, and the file that runs the same
    "sudo apt-get install": ("changes the system", ".ci/run", "need libgl1"),
    "python3 -m venv .venv": ("downloads 2.5 GB", ".ci/run", "pip install --quiet uv"),
    ".venv/bin/pip install -q uv": ("network", ".ci/run", "pip install --quiet uv"),
    ".venv/bin/uv sync": ("network", ".ci/run", "uv sync"),
    "pip install .": ("network", ".ci/run", "uv pip install --quiet --python"),
    "scanwright optimise": ("seconds", "tests/scanwright/cli/test_cli.py", '"optimise"'),
    "scanwright build": ("minutes", "tests/scanwright/pipeline/test_links.py", "build"),
    "scanwright emulate": ("a server", "tests/firmware_io/scan/test_real_time.py", '"emulate"'),
    "scanwright scan": ("needs emulators and a build", "tests/firmware_io/scan/test_acquire.py", '"scan"'),
    "scanwright servo-setup": ("needs a servo", "tests/firmware_io/servo/test_consent.py", '"servo-setup"'),
}


def shell_lines(text):
    """Return the lines that a page tells to type, without comments, continued lines joined."""
    lines = []
    for kind, block in re.findall(r"^```(sh|console)\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        typed = block.replace("\\\n", " ").splitlines()
        typed = [line[2:] for line in typed if line.startswith("$ ")] if kind == "console" else typed
        lines += [line for one in typed if (line := re.sub(r"(^|\s+)#.*", "", one).strip())]
    return lines


@cache
def own_commands(page):
    """Return the arguments of every `scanwright` line of a page."""
    lines = shell_lines((ROOT / page).read_text(encoding="utf-8"))
    pieces = [re.split(r" [<>] ", piece)[0].strip() for line in lines for piece in re.split(r"&&|\|", line)]
    own = (re.sub(r"^\S*uv run ", "", piece) for piece in pieces)
    return [shlex.split(re.sub(r"<\w+>", "NAME", piece))[1:] for piece in own if piece.startswith("scanwright ")]


@cache
def _program():
    return get_command(app)


def require_accepted(arguments):
    """Raise if the program would not accept these arguments: an unknown command or option, or a missing value."""
    command = _program()
    with command.make_context("scanwright", list(arguments), allow_extra_args=True) as context:
        if arguments[0].startswith("-"):
            return
        name, own, rest = command.resolve_command(context, list(arguments))
        own.make_context(name, rest, parent=context)


@pytest.mark.parametrize("page", [page for page in PAGES if own_commands(page)])
def test_the_program_accepts_every_line(page):
    for arguments in own_commands(page):
        require_accepted(arguments)


@pytest.mark.parametrize("wrong", [["no-such-command"], ["scan", "out/x", "--no-such-option"], ["optimise"]])
def test_a_wrong_line_is_rejected(wrong):
    with pytest.raises(Exception, match=r"(?i)no such|missing"):
        require_accepted(wrong)


def test_every_line_that_all_type_runs_here_or_elsewhere():
    for page in TYPED_BY_ALL:
        for line in shell_lines((ROOT / page).read_text(encoding="utf-8")):
            known = [start for start in (*HERE, *ELSEWHERE) if line.startswith(start)]
            assert known, f"{page}: {line}"
    for _, file, part in ELSEWHERE.values():
        assert part in (ROOT / file).read_text(encoding="utf-8"), file


@pytest.mark.parametrize("page", TYPED_BY_ALL)
def test_lines_run_as_typed(page, tmp_path):
    """In one shell and one folder, whose `.venv` is the environment of the tests."""
    (tmp_path / ".venv").symlink_to(sys.prefix)
    lines = shell_lines((ROOT / page).read_text(encoding="utf-8"))
    lines = [line for line in lines if line.startswith(tuple(HERE))]
    assert lines
    if lines[0] != "source .venv/bin/activate":
        lines.insert(0, "source .venv/bin/activate")
    subprocess.run(["bash", "-euc", "\n".join([*lines, "command -v scanwright"])], cwd=tmp_path, check=True)
