"""The files of a build that describe it: task, search table, omissions, report."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from scanwright.design.concurrency.processes import Begin, in_turn
from scanwright.design.errors import BuildError
from scanwright.design.files.atomic_file import atomic_write, place_in
from scanwright.design.left_out import LeftOut
from scanwright.design.scene.posture import SUFFIX as URDF
from scanwright.design.scene.ray_caster import load_triangles
from scanwright.design.search.search import SearchResult
from scanwright.design.task.shapes import MapRegion, MeshRegion
from scanwright.design.task.task import LoadedTask, Task
from scanwright.pipeline.manifest import enter, require_as_built, write_json

_BARE_MESH = {"joint_deg": {}, "joint_mm": {}, "frame": "", "omit": []}


def write_task(folder: Path, loaded: LoadedTask) -> None:
    """Write `task.toml` with all defaults, and copy the files that it names, so that the folder can be built alone."""
    table = loaded.task.model_dump(mode="json", exclude_none=True, exclude={"camera"})  # a camera affects no part
    rename_files(table, loaded.task, lambda file, role: _copied(folder, loaded.source.parent / file, role))
    for i, region in enumerate(loaded.task.mask):
        if isinstance(region, MeshRegion) and Path(region.file).suffix.lower() == URDF:
            file = _robot_mesh(folder, loaded.source.parent, region, f"mask-{i}")
            table["mask"][i] |= {"file": file, **_BARE_MESH}
    (folder / "task.toml").write_text(tomli_w.dumps(table), encoding="utf-8")


def rename_files(table: dict[str, Any], task: Task, name: Callable[[str, str], str]) -> None:
    """Rename every file in the table of a task; `name` maps its name and its role to the new name."""
    for key in ("weight", "mask"):
        for i, region in enumerate(getattr(task, key)):
            if isinstance(region, MapRegion | MeshRegion):
                table[key][i]["file"] = name(region.file, f"{key}-{i}")
    if task.scene is not None:
        table["scene"]["file"] = name(task.scene.file, "scene")
    if task.catalogue:
        table["catalogue"] = [name(extra, f"catalogue-{i}") for i, extra in enumerate(task.catalogue)]


def write_search(folder: Path, result: SearchResult) -> None:
    """Write `search.csv`, the lowest J and its axis for every scan plane, and `axes.csv`, the lowest J of every axis.

    J is the coarse J of the search, or its bound from the mean density if that is above the best J.
    """
    header = "alpha_laser_deg,beta_laser_deg,J,alpha_rot_deg,beta_rot_deg"
    np.savetxt(folder / "search.csv", result.planes, delimiter=",", header=header, comments="", fmt="%.5g")
    header = "alpha_rot_deg,beta_rot_deg,J"
    np.savetxt(folder / "axes.csv", result.axes, delimiter=",", header=header, comments="", fmt="%.5g")


def write_left_out(folder: Path, left_out: list[LeftOut]) -> None:
    """Write `left_out.json`, the skipped work."""
    entries = [asdict(each) for each in left_out]
    write_json(folder / "left_out.json", {"schema": "scanwright/left_out/1", "left_out": entries})


def write_report(folder: Path, begin: Begin = in_turn) -> Path:
    """Write `report.html` of a build folder from its files, and enter it into the manifest; `begin` as for the page.

    Raises:
        TaskError: `angles.json` or `task.toml` is missing or invalid.
        BuildError: another file is missing, was edited, or is invalid.
    """
    from scanwright.report.page import REPORT, report_html

    if not folder.is_dir():
        raise BuildError(f"{folder}: no such build folder; `scanwright build TASK` writes out/TASK")
    require_as_built(folder, but=REPORT)
    with atomic_write(place_in(folder, REPORT, BuildError), BuildError) as part:
        part.write_text(report_html(folder, begin), encoding="utf-8")
    enter(folder, REPORT)
    return folder / REPORT


def _copied(folder: Path, source: Path, prefix: str) -> str:
    name = f"{prefix}{source.suffix}"
    shutil.copyfile(source, folder / name)
    return name


def _robot_mesh(folder: Path, tasks: Path, region: MeshRegion, prefix: str) -> str:
    """Write the robot of a URDF as one mesh, since the meshes of a URDF are outside the folder; return its name."""
    import trimesh

    corners = load_triangles(tasks / region.file, posture=region.posture).reshape(-1, 3)
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    name = f"{prefix}.stl"
    (folder / name).write_bytes(trimesh.exchange.stl.export_stl(mesh))
    (folder / f"{prefix}{URDF}").unlink()
    return name
