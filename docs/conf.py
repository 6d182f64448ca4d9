"""How the pages are made: `uv run sphinx-build -n -W --keep-going docs docs/_build`.

The docstrings of this project write names, formulas and files in single backquotes. Such a word becomes a link
if it names something of ours. If it seems to (it begins with one of our packages, or is the path of a file or
page) but does not exist, the build fails.
"""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from scanwright import __version__

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(Path(__file__).parent))
from schema_pages import write_schema_pages  # noqa: E402  beside this file, which is no package

FOLDERS = ("scanwright", "design", "cad", "firmware_io")
OURS = re.compile(r"scanwright(\.[A-Za-z_]\w*)+")
SHORT = re.compile(r"(?<=`)(?=(design|cad|firmware_io)\.[a-z_])")  # docstrings leave the name of the package out
IN_THE_PROJECT = re.compile(rf"(({'|'.join(FOLDERS)}|docs|examples|tests|benchmarks)/[\w./-]+|[\w-]+\.md)")
WRITTEN_BY_A_BUILD = {"wiring.md", "assembly.md"}

project = "Scanwright"
author = "the Scanwright authors"
copyright = f"2026, {author}"  # noqa: A001  the name that Sphinx reads
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.apidoc"]
suppress_warnings = ["ref.python"]  # a word that several classes have, such as shape, is no reference
exclude_patterns = ["_build", "reference/*/modules.rst"]
html_theme = "furo"
html_title = f"Scanwright {__version__}"
html_show_sphinx = False
default_role = "py:obj"
ACCESS = """addEventListener("DOMContentLoaded", () => {
  const all = (where) => document.querySelectorAll(where);
  const set = (where, name, value) => all(where).forEach((each) => each.setAttribute(name, value));
  set("pre", "tabindex", "0");
  set(".caption[role=heading]", "aria-level", "2");
  set(".sidebar-drawer", "aria-label", "All pages");
  set(".toc-drawer", "aria-label", "This page");
  set(".content-icon-container", "role", "navigation");
});"""
"""What the theme leaves out: scrolling by keyboard, levels of headings, names of landmarks."""

myst_heading_anchors = 3
myst_enable_extensions = ["deflist"]

add_module_names = False
autodoc_member_order = "bysource"
autodoc_mock_imports = [  # the robot's own ROS 2
    "builtin_interfaces",
    "geometry_msgs",
    "rcl_interfaces",
    "rclpy",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
]
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike", "Floats", "Mask", "Times")}
napoleon_numpy_docstring = False
napoleon_use_ivar = True

apidoc_modules = [
    {
        "path": "../scanwright",
        "destination": "reference/modules",
        "follow_links": True,
        "max_depth": 1,
        "module_first": True,
        "automodule_options": {"members", "undoc-members"},
    }
]


def describe_commands(app: Any) -> None:
    """Write the page of all commands from the commands themselves."""
    from typer.main import get_command

    from scanwright.cli.app import app as commands

    page = ["# Commands", "", "`scanwright COMMAND --help` prints the same.", ""]
    for name, command in sorted(get_command(commands).commands.items()):  # type: ignore[attr-defined]
        page += [f"## {name}", "", str(command.help).replace("<", "&lt;"), ""]
        for parameter in command.params:
            written = ", ".join(parameter.opts) if parameter.param_type_name == "option" else parameter.metavar
            page += [f"`{written}`", f": {parameter.help or 'value'}", ""]
    folder = Path(app.srcdir) / "reference/cli"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "commands.md").write_text("\n".join(page))
    for group in commands.registered_groups:
        for command in group.typer_instance.registered_commands:
            _hide_source(command.callback)


def _hide_source(function: Any) -> None:
    """Let Sphinx read the defaults of a command from its signature if a decorator gave it further options."""
    while function is not None:
        inner = vars(function).get("__wrapped__")
        if "__signature__" in vars(function):
            vars(function).pop("__wrapped__", None)
        function = inner


def describe_checks(app: Any) -> None:
    """Write the page of all checks from their table."""
    from scanwright.cad.checks.table import table_page

    folder = Path(app.srcdir) / "reference/checks"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "table.md").write_text(table_page(), encoding="utf-8")


def describe_files(app: Any) -> None:
    """Write the pages of task and product files from their schemas."""
    write_schema_pages(Path(app.srcdir) / "reference/files")


def name_packages(_app: Any, page: str, source: list[str]) -> None:
    """Title the page of a package with its name alone; its modules follow without a heading over them."""
    if page.startswith("reference/"):
        text = re.sub(r"^(Subpackages|Submodules)\n-+\n", "", source[0], flags=re.MULTILINE)
        source[0] = re.sub(r"^(\S+) (package|module)\n(=+|-+)$", r"\1\n\3", text, flags=re.MULTILINE)


def points_nowhere(_app: Any, _env: Any, node: Any, contnode: Any) -> Any:
    """Leave words that name nothing of ours unchanged; None lets Sphinx warn about those that seem to."""
    target = str(node.get("reftarget", ""))
    if node.get("refdomain") != "py":
        return None
    if IN_THE_PROJECT.fullmatch(target) and target not in WRITTEN_BY_A_BUILD:
        return contnode if (ROOT / target).exists() or (ROOT / "docs" / target).exists() else None
    return None if OURS.fullmatch(target) and not _is_something(target) else contnode


def _is_something(name: str) -> bool:
    """Whether a name that has no page of its own, such as a constant, can be imported."""
    try:
        resolve_name(name)
    except (ImportError, AttributeError):
        return False
    return True


def drawn_as_typed(_app: Any, _what: str, _name: str, _it: Any, _options: Any, lines: list[str]) -> None:
    """Show formulas, tables and sketches, which are indented after a blank line, as they are."""
    for k in range(len(lines) - 1, 1, -1):
        before = next((line for line in reversed(lines[: k - 1]) if line.strip()), "")
        if lines[k].strip() and not lines[k - 1].strip() and _indent(lines[k]) >= _indent(before) + 4:
            lines[k:k] = [" " * _indent(before) + "::", ""]


def named_in_full(_app: Any, _what: str, _name: str, _it: Any, _options: Any, lines: list[str]) -> None:
    """Write `design.frames` as the `scanwright.design.frames` that can be imported."""
    lines[:] = [SHORT.sub("scanwright.", line) for line in lines]


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def setup(app: Any) -> None:
    """Called by Sphinx."""
    for heavy in ("cadquery", "matplotlib.figure", "numba", "scipy.spatial"):
        import_module(heavy)  # once: Sphinx forks its readers
    app.add_js_file(None, body=ACCESS)
    app.connect("source-read", name_packages)
    app.connect("builder-inited", describe_commands)
    app.connect("builder-inited", describe_checks)
    app.connect("builder-inited", describe_files)
    app.connect("autodoc-process-docstring", named_in_full)
    app.connect("autodoc-process-docstring", drawn_as_typed, priority=400)  # before napoleon's 500
    app.connect("missing-reference", points_nowhere)
