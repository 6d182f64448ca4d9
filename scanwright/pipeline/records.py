"""The files of a build that say what the scanner is: task, angle set, search table, what was left out."""

from __future__ import annotations

import shutil
from importlib.metadata import version
from pathlib import Path

import numpy as np
import tomli_w

from design.angles import Angles, AngleSet
from design.left_out import LeftOut
from design.motion import Shortest, Sweep
from design.search.families import Family
from design.search.search import SearchResult
from design.task.shapes import Map, Mesh
from design.task.task import LoadedTask
from scanwright.pipeline.folder import write_json


def write_task(folder: Path, loaded: LoadedTask) -> None:
    """`task.toml` with every default written out; files that it names come along, so the folder builds by itself."""
    table = loaded.task.model_dump(mode="json", exclude_none=True, exclude={"camera"})  # it makes no part
    for key in ("weight", "mask"):
        for i, region in enumerate(getattr(loaded.task, key)):
            if isinstance(region, Map | Mesh):
                table[key][i]["file"] = _bring(folder, loaded.source.parent / region.file, f"{key}-{i}")
    if loaded.task.scene is not None:
        table["scene"]["file"] = _bring(folder, loaded.source.parent / loaded.task.scene.file, "scene")
    table["catalogue"] = [
        _bring(folder, loaded.source.parent / extra, f"catalogue-{i}") for i, extra in enumerate(loaded.task.catalogue)
    ]
    (folder / "task.toml").write_text(tomli_w.dumps(table), encoding="utf-8")


def write_search(folder: Path, result: SearchResult) -> None:
    """`search.csv`: for every scan-plane setting of the grid the lowest J, and the axis it was found about.

    And `axes.csv`: for every axis of the grid the lowest J of all scan planes. J is that of the search, on few nodes;
    where it cannot win it is the bound from the mean density.
    """
    header = "alpha_laser_deg,beta_laser_deg,J,alpha_rot_deg,beta_rot_deg"
    np.savetxt(folder / "search.csv", result.planes, delimiter=",", header=header, comments="", fmt="%.5g")
    header = "alpha_rot_deg,beta_rot_deg,J"
    np.savetxt(folder / "axes.csv", result.axes, delimiter=",", header=header, comments="", fmt="%.5g")


def write_left_out(folder: Path, left_out: list[LeftOut]) -> None:
    """`left_out.json`: what the task made superfluous."""
    entries = [{"what": x.what, "why": x.why, "saved": x.saved, "unit": x.unit} for x in left_out]
    write_json(folder / "left_out.json", {"schema": "scanwright/left_out/1", "left_out": entries})


def angle_set(loaded: LoadedTask, family: Family) -> AngleSet:
    """The designed angle set of a family; J is rounded to its error."""
    task = loaded.task
    assert not isinstance(task.motion, Shortest)  # the search has put the period that it found
    alpha_rot, beta_rot, alpha_laser, beta_laser = family.angles_deg
    J, J_error = rounded_to_error(family.score.J, family.score.J_error)
    return AngleSet(
        task=task.name,
        task_sha256=loaded.sha256(),
        angles_deg=Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha_laser, beta_laser=beta_laser),
        sensor=task.sensor,
        servo=task.servo,
        slip_ring=None if isinstance(task.motion, Sweep) else task.slip_ring,
        motion=task.motion,
        J=J,
        J_error=J_error,
        versions={"scanwright": version("scanwright")},
    )


def rounded_to_error(value: float, error: float) -> tuple[float, float]:
    """A value rounded to one digit of its error, and the error rounded up to hold the rounding too."""
    if not error > 0:
        return value, error
    digits = -int(np.floor(np.log10(error)))
    unit = 10.0**-digits
    rounded = round(value, digits)
    total = error + abs(value - rounded)
    return rounded, round(float(np.ceil(total / unit - 1e-9)) * unit, digits)


def _bring(folder: Path, source: Path, prefix: str) -> str:
    name = f"{prefix}{source.suffix}"
    shutil.copyfile(source, folder / name)
    return name
