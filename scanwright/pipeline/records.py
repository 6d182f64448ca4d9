"""The files of a build that describe it: task, search table, omissions, report."""

from __future__ import annotations

import shutil
from collections.abc import Callable
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
    table = loaded.task.model_dump(mode="json", exclude_none=True, exclude={"camera"})  # it makes no part
    rename_files(table, loaded.task, lambda file, role: _bring(folder, loaded.source.parent / file, role))
    for i, region in enumerate(loaded.task.mask):
        if isinstance(region, MeshRegion) and Path(region.file).suffix.lower() == URDF:
            table["mask"][i] |= {"file": _bring_robot(folder, loaded.source.parent, region, f"mask-{i}"), **_BARE_MESH}
    (folder / "task.toml").write_text(tomli_w.dumps(table), encoding="utf-8")


def rename_files(table: dict[str, Any], task: Task, name: Callable[[str, str], str]) -> None:
    """Rename every file in the table of a task; `name` gets its present name and its role."""
    for key in ("weight", "mask"):
        for i, region in enumerate(getattr(task, key)):
            if isinstance(region, MapRegion | MeshRegion):
                table[key][i]["file"] = name(region.file, f"{key}-{i}")
    if task.scene is not None:
        table["scene"]["file"] = name(task.scene.file, "scene")
    if task.catalogue:
        table["catalogue"] = [name(extra, f"catalogue-{i}") for i, extra in enumerate(task.catalogue)]


def write_search(folder: Path, result: SearchResult) -> None:
    """Write `search.csv`: for every scan plane of the grid the lowest J, and its axis.

    And `axes.csv`: for every axis of the grid the lowest J of all scan planes. J is that of the search, on few nodes;
    where it cannot win it is the bound from the mean density.
    """
    header = "alpha_laser_deg,beta_laser_deg,J,alpha_rot_deg,beta_rot_deg"
    np.savetxt(folder / "search.csv", result.planes, delimiter=",", header=header, comments="", fmt="%.5g")
    header = "alpha_rot_deg,beta_rot_deg,J"
    np.savetxt(folder / "axes.csv", result.axes, delimiter=",", header=header, comments="", fmt="%.5g")


def write_left_out(folder: Path, left_out: list[LeftOut]) -> None:
    """Write `left_out.json`: what the task made unnecessary."""
    entries = [{"what": x.what, "why": x.why, "saved": x.saved, "unit": x.unit} for x in left_out]
    write_json(folder / "left_out.json", {"schema": "scanwright/left_out/1", "left_out": entries})


def write_report(folder: Path, begin: Begin = in_turn) -> Path:
    """Write `report.html` of a build folder from its files, and enter it into the manifest; `begin` as for the page.

    Raises:
        TaskError: `angles.json` is missing or is no angle set, or `task.toml` is no task.
        BuildError: another file is gone, was edited, or is not as a build writes it.
    """
    from scanwright.report.page import REPORT, report_html

    if not folder.is_dir():
        raise BuildError(f"{folder}: no such build folder; `scanwright build TASK` writes out/TASK")
    require_as_built(folder, but=REPORT)
    with atomic_write(place_in(folder, REPORT, BuildError), BuildError) as part:
        part.write_text(report_html(folder, begin), encoding="utf-8")
    enter(folder, REPORT)
    return folder / REPORT


def _bring(folder: Path, source: Path, prefix: str) -> str:
    name = f"{prefix}{source.suffix}"
    shutil.copyfile(source, folder / name)
    return name


def _bring_robot(folder: Path, tasks: Path, region: MeshRegion, prefix: str) -> str:
    """Write the robot of a URDF as one mesh, as its own meshes are elsewhere."""
    import trimesh

    corners = load_triangles(tasks / region.file, posture=region.posture).reshape(-1, 3)
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    name = f"{prefix}.stl"
    (folder / name).write_bytes(trimesh.exchange.stl.export_stl(mesh))
    (folder / f"{prefix}{URDF}").unlink()
    return name
