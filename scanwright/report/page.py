"""`report.html` from the files of a build folder: no search, no kernel, no network; equal files give equal bytes.

If a file is missing, the page names it and omits what needs it; only `angles.json` is required.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, UndefinedError

from scanwright.cad.checks.checks_json import read_checks
from scanwright.design.angles import AngleSet, load_angles
from scanwright.design.concurrency.processes import Begin, in_turn
from scanwright.design.errors import BuildError
from scanwright.design.findings import Finding, Severity
from scanwright.design.objective.holes import percent
from scanwright.design.objective.problem import Problem
from scanwright.design.self_occlusion import SelfOcclusion, load_self_occlusion
from scanwright.design.task.task import LoadedTask, load_task
from scanwright.report.answer import answer, problem_as_built
from scanwright.report.assembly_steps import steps_html
from scanwright.report.build_files import packed, read, read_json, read_picture, read_text
from scanwright.report.check_pictures import CheckPictures, PlacedBody, bodies_named, still
from scanwright.report.colours import COLOUR_STOPS
from scanwright.report.density_sphere import DensitySphere, density_sphere
from scanwright.report.first_screen import cards, count, motion_in_words, title, to_do
from scanwright.report.parts_list import price, read_parts
from scanwright.report.room import cloud_scene, one_scan, room_about, room_scene
from scanwright.report.scanner_scene import LARGEST_BYTES, load_glb, placed_bodies, robot_bodies, scanner_scene

REPORT = "report.html"
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note", "ok")  # the worst first
RAYS = 90_000  # of the cloud of one scan: it shares the 3 MB of a page with the scanner and the drawings
SPREAD_PERCENT = 1, 99  # of the heights, to which the colours reach
FLAT_M = 0.01  # heights of the cloud of an upright axis and a level lidar
CEILING_M = 1.2  # above the scanner, from which the cloud is cut away: it would hide the room


def report_html(folder: Path, begin: Begin = in_turn) -> str:
    """Return the page; `begin` runs what needs the task, and what needs the bodies of the scanner.

    Raises:
        TaskError: `angles.json` is missing or is no angle set, or `task.toml` is no task.
        BuildError: no build wrote another file in this form.
    """
    angles = load_angles(folder / "angles.json")
    on_task, on_bodies = begin(_on_task, folder), begin(_on_bodies, folder)
    parts = read(folder / "bom.csv", read_parts)
    findings = read(folder / "checks.json", read_checks)
    files = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    facts = {
        "angles": angles,
        "motion": motion_in_words(angles.motion),
        "parts": parts,
        "price": price,
        "checks": None if findings is None else by_severity(findings),
        "todo": to_do(files, findings or (), parts),
        "share": percent,
        "count": count,
        "steps": read(folder / "assembly.md", partial(_steps, folder)),
        "wiring": read(folder / "wiring.svg", read_picture),
        "wiring_words": read(folder / "wiring.md", _wiring_words),
        "drawings": {path.stem: packed(read_picture(path)) for path in sorted((folder / "drawings").glob("*.svg"))},
        "sheets": [name for name in files if name.startswith("drawings/") and name.endswith(".pdf")],
        "left_out": read(folder / "left_out.json", lambda path: read_json(path)["left_out"]),
        "manifest": read(folder / "manifest.json", read_json),
        "task_text": read(folder / "task.toml", read_text),
        **on_task(),
        **on_bodies(),
    }
    scenes = facts.pop("task_scene"), facts["scanner"] if isinstance(facts["scanner"], dict) else None
    facts["scene"] = {key: value for scene in scenes if scene for key, value in scene.items()}
    facts["packed_scene"] = packed(json.dumps(facts["scene"] | {"stops": COLOUR_STOPS}))
    try:
        return _environment().get_template("page.html.j2").render(facts)
    except UndefinedError as error:
        raise BuildError(
            f"{folder}: a file in it is not as a build writes it ({error}): build the folder again"
        ) from error


def by_severity(findings: Iterable[Finding]) -> dict[Severity, list[list[Finding]]]:
    """Return findings by severity; those of one kind about one subject together."""
    grouped: dict[Severity, dict[tuple[str, str], list[Finding]]] = {severity: {} for severity in SEVERITIES}
    for finding in findings:
        grouped[finding.severity].setdefault((finding.subject, finding.code), []).append(finding)
    return {severity: list(groups.values()) for severity, groups in grouped.items()}


def _steps(folder: Path, path: Path) -> list[str]:
    """Return HTML of what comes before the first step, and of each step."""
    texts = re.split(r"\n(?=## )", read_text(path))
    return [steps_html(text, lambda name: read(folder / name, read_picture)) for text in texts]


def _wiring_words(path: Path) -> tuple[str, str]:
    """Return HTML of the cautions before the picture, and of the text after it."""
    cautions, heading, words = read_text(path).partition("\n## Power")
    return steps_html(cautions), steps_html(heading + words)


def _on_task(folder: Path) -> dict[str, Any]:
    """Return what needs the task."""
    loaded = read(folder / "task.toml", load_task)
    if loaded is None:
        return dict.fromkeys(("title", "objective", "ball_deg", "answer", "sphere", "cards", "task_scene"))
    angles = load_angles(folder / "angles.json")
    problem, task = problem_as_built(loaded, angles), loaded.task
    own_body = read(folder / "own_body.npz", load_self_occlusion)
    shadow = None if own_body is None else own_body[0]
    result = answer(loaded, angles, shadow, read(folder / "checks.json", read_checks) or ())
    mounts = [mount.gain.mount for mount in result.as_built.mounts]
    sphere = density_sphere(problem, angles, mounts, shadow)
    return {
        "title": title(loaded),
        "objective": task.density.objective,
        "ball_deg": task.density.ball_radius_deg,
        "answer": result,
        "sphere": sphere,
        "task_scene": _task_scene(loaded, angles, problem, sphere, shadow),
        "cards": cards(angles, result, read(folder / "bom.csv", read_parts)),
    }


def _task_scene(
    loaded: LoadedTask, angles: AngleSet, problem: Problem, sphere: DensitySphere, shadow: SelfOcclusion | None
) -> dict[str, Any]:
    """Return the room with its maps, and the cloud of one scan of the furnished room, for the stage."""
    centre_m = angles.T_world_rot(0.0)[:3, 3]
    room = room_about(loaded.task)
    joint_rad = problem.joint_rad()
    scanner = loaded.scanner(angles.model_copy(update={"t_world_rot_mm": (0.0, 0.0, 0.0)}))
    points = one_scan(scanner, joint_rad, None, loaded.source.parent, shadow, RAYS)
    points = points[points[:, 2] < CEILING_M]
    low, high = np.percentile(points[:, 2], SPREAD_PERCENT)
    return room_scene(room, centre_m, np.array(sphere.middle), sphere.below) | {
        "robot": robot_bodies(loaded.task, loaded.source.parent, centre_m),
        "maps": len(sphere.maps),
        "cloud": cloud_scene(points + centre_m, (points[:, 2] - low) / max(high - low, FLAT_M)),
        "shown": len(points),
        "cast": problem.lines.count * problem.lines.repeats * len(problem.bearings_rad),
        "heights": [f"{low:.1f} m", f"{high:.1f} m"],
    }


def _on_bodies(folder: Path) -> dict[str, Any]:
    """Return what shows the scanner and its hidden beams."""
    angles, findings = load_angles(folder / "angles.json"), read(folder / "checks.json", read_checks)
    parts, own_body = read(folder / "bom.csv", read_parts), read(folder / "own_body.npz", load_self_occlusion)
    assembly, exploded = (read(folder / name, load_glb) for name in ("assembly.glb", "exploded.glb"))
    bodies = None if assembly is None else placed_bodies(assembly)
    return {
        "scanner": _not_drawn(folder) or scanner_scene(assembly, exploded, angles, own_body),
        "still": None if bodies is None else still(bodies),
        "places": {} if bodies is None else _places(bodies, findings or (), {} if parts is None else parts.bought),
    }


def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("scanwright.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def _not_drawn(folder: Path) -> str:
    """Return why the page draws no scanner; empty if it does."""
    path = folder / "assembly.glb"
    if not path.is_file():
        return "assembly.glb is not in this folder."
    if path.stat().st_size > LARGEST_BYTES:
        return f"assembly.glb has {path.stat().st_size / 1e6:.1f} MB, too much for one page: open it in a viewer."
    return ""


def _places(
    bodies: dict[str, PlacedBody], findings: Iterable[Finding], bought: dict[str, str]
) -> dict[str, dict[str, Any]]:
    """Return bodies and a picture of each subject of an error or a warning; a subject without bodies has none."""
    pictures = CheckPictures(bodies)
    codes = {finding.subject: finding.code for finding in findings if finding.severity in ("error", "warning")}
    named = {subject: bodies_named(code, subject, bodies, bought) for subject, code in codes.items()}
    return {subject: {"bodies": names, "picture": pictures.picture(names)} for subject, names in named.items() if names}
