"""`report.html` from the files of a build folder: no search, no kernel, no network; equal files give equal bytes.

Whatever a file is missing for is left out with one line that says so; only `angles.json` has to be there.
"""

from __future__ import annotations

import csv
import json
from base64 import b64encode
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, UndefinedError

from design.angles import AngleSet, load_angles
from design.errors import BuildError
from design.frames import Array
from design.shadow import load_own_body
from design.task.task import load_task
from scanwright.pipeline.manifest import MANIFEST, enter
from scanwright.report.answer import OFF_DEG, as_built, hidden_by, sight_of
from scanwright.report.pictures import AXIS, PLANE, landscape
from scanwright.report.scene import LARGEST_BYTES, bodies_of, scene_of
from scanwright.report.sphere import sphere_of
from scanwright.report.steps import steps_html
from scanwright.report.where import Pictures, named_in

REPORT = "report.html"
SEVERITIES = ("error", "warning", "note", "pass")
PLANES_CSV = ("alpha_laser_deg", "beta_laser_deg", "J", "alpha_rot_deg", "beta_rot_deg")
AXES_CSV = ("alpha_rot_deg", "beta_rot_deg", "J")
DIRECTIONS = {
    "ahead": (1.1, 0, 0),
    "behind": (-1.1, 0, 0),
    "left": (0, 1.1, 0),
    "right": (0, -1.1, 0),
    "up": (0, 0, 1.1),
    "down": (0, 0, -1.1),
}  # of the world, beside the ball
IMAGES = {".png": "image/png", ".svg": "image/svg+xml"}

T = TypeVar("T")


def write_report(folder: Path) -> Path:
    """Write `report.html` into a build folder, and its digest into the manifest.

    Raises:
        TaskError: `angles.json` is missing or is no angle set, or `task.toml` is no task.
        BuildError: another file is not as a build writes it.
    """
    path = folder / REPORT
    path.write_text(report_html(folder), encoding="utf-8")
    enter(folder, REPORT)
    return path


def report_html(folder: Path) -> str:
    """The page.

    Raises:
        TaskError: `angles.json` is missing or is no angle set, or `task.toml` is no task.
        BuildError: another file is not as a build writes it.
    """
    angles = load_angles(folder / "angles.json")
    loaded = _read(folder / "task.toml", load_task)
    own_body = _read(folder / "own_body.npz", load_own_body)
    bom = _read(folder / "bom.csv", _table)
    planes = _read(folder / "search.csv", lambda path: _columns(path, PLANES_CSV))
    axes = _read(folder / "axes.csv", lambda path: _columns(path, AXES_CSV))
    checks = _read(folder / "checks.json", lambda path: _by_severity(_json(path)["checks"]))
    facts = {
        "angles": angles,
        "motion": _motion(angles),
        "objective": None if loaded is None else loaded.task.density.objective,
        "ball_deg": None if loaded is None else loaded.task.density.ball_radius_deg,
        "off_deg": OFF_DEG,
        "directions": DIRECTIONS,
        "sight": None if loaded is None else sight_of(loaded, angles),
        "hidden": None if own_body is None else hidden_by(own_body[0]),
        "total": None if bom is None else next((row for row in bom if row.get("kind") == "total"), None),
        "scene": _scene(folder, angles, own_body),
        "density": _read(folder / "density.png", _data_uri),
        "sphere": None if loaded is None else sphere_of(loaded, angles, axes),
        "planes": planes,
        "planes_picture": None if planes is None else landscape(planes[:, :3], PLANE, angles, "lowest J, any axis"),
        "axes": axes,
        "axes_picture": None if axes is None else landscape(axes, AXIS, angles, "lowest J, any scan plane"),
        "lowest": None if planes is None else _lowest(planes),
        "checks": checks,
        "places": {} if checks is None else _places(folder, checks, bom),
        "bom": bom,
        "steps": _read(folder / "assembly.md", lambda path: steps_html(path.read_text(encoding="utf-8"))),
        "drawings": {path.stem: _data_uri(path) for path in sorted((folder / "drawings").glob("*.svg"))},
        "left_out": _read(folder / "left_out.json", lambda path: _json(path)["left_out"]),
        "manifest": _read(folder / MANIFEST, _manifest),
        "task_text": _read(folder / "task.toml", lambda path: path.read_text(encoding="utf-8")),
    }
    try:
        return _environment().get_template("page.html.j2").render(facts)
    except UndefinedError as error:
        raise BuildError(
            f"{folder}: a file in it is not as a build writes it ({error}): build the folder again"
        ) from error


def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("scanwright.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def _read(path: Path, reader: Callable[[Path], T]) -> T | None:
    """What a reader makes of a file; None where there is none.

    Raises:
        BuildError: the file is not as a build writes it.
    """
    if not path.is_file():
        return None
    with as_built(path):
        return reader(path)


def _json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _data_uri(path: Path) -> str:
    return f"data:{IMAGES[path.suffix]};base64,{b64encode(path.read_bytes()).decode('ascii')}"


def _manifest(path: Path) -> dict[str, Any]:
    """The manifest without the report's own digest: a report made again must be the same."""
    manifest: dict[str, Any] = _json(path)
    return manifest | {"files": {name: facts for name, facts in manifest["files"].items() if name != REPORT}}


def _motion(angles: AngleSet) -> str:
    motion = angles.motion
    if motion is None:
        return "The motion is not known."
    if motion.mode == "spin":
        return f"{motion.duration_s:g} s: one turn at constant speed."
    if motion.mode == "sweep":
        low, high = motion.limits_deg
        return f"{motion.duration_s:g} s: from {low:g} to {high:g} deg and back."
    return f"{motion.duration_s:g} s: {motion.stops} stops of {motion.dwell_s:g} s in one turn."


def _scene(folder: Path, angles: AngleSet, own_body: Any) -> dict[str, Any] | str:
    """What the page draws, or why it draws nothing."""
    path = folder / "assembly.glb"
    if not path.is_file():
        return "assembly.glb is not in this folder."
    if path.stat().st_size > LARGEST_BYTES:
        return f"assembly.glb has {path.stat().st_size / 1e6:.1f} MB, too much for one page: open it in a viewer."
    return scene_of(folder, angles, own_body)


def _by_severity(checks: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Checks by severity, the worst first; a severity not known here comes with the errors."""
    known = {severity: [c for c in checks if c["severity"] == severity] for severity in SEVERITIES}
    known["error"] += [c for c in checks if c["severity"] not in SEVERITIES]
    return known


def _columns(path: Path, columns: tuple[str, ...]) -> Array:
    """Columns of a table of numbers, shape (rows, columns)."""
    return np.array([[float(row[column]) for column in columns] for row in _table(path)]).reshape(-1, len(columns))


def _lowest(planes: Array) -> dict[str, Any] | None:
    """The lowest J of the table, and the settings that have it."""
    open_planes = planes[np.isfinite(planes[:, 2])]
    if not len(open_planes):
        return None
    lowest = open_planes[:, 2].min()
    return {"J": float(lowest), "rows": open_planes[open_planes[:, 2] == lowest].tolist()}


def _places(
    folder: Path, checks: dict[str, list[dict[str, Any]]], bom: list[dict[str, str]] | None
) -> dict[str, dict[str, Any]]:
    """By the `where` of a check the bodies that it names and a picture of them; what is no place is not there."""
    path = folder / "assembly.glb"
    if not path.is_file():
        return {}
    bodies = bodies_of(path)
    pictures = Pictures(bodies)
    bought = {row.get("number", ""): row.get("part", "") for row in bom or () if row.get("kind") == "bought"}
    wheres = dict.fromkeys(str(check.get("where", "")) for found in checks.values() for check in found)
    named = {where: named_in(where, bodies, bought) for where in wheres}
    return {where: {"bodies": names, "picture": pictures.of(names)} for where, names in named.items() if names}
