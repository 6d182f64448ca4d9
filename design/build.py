"""The build folder `out/<task>/`: written whole or not at all, and known by the digests in its manifest."""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from design.angles import STANDARD_DEG, Angles, AngleSet
from design.errors import BuildError
from design.families import Family
from design.frames import Array
from design.left_out import LeftOut
from design.objective import Problem
from design.search import SearchResult
from design.sphere import spiral
from design.task import LoadedTask, Map

MANIFEST = "manifest.json"
WRITERS = ("cadquery", "cadquery-ocp", "matplotlib", "numba", "numpy", "scipy", "trimesh")
SQUARE_DEGREES = 41_253  # on the whole sphere


def versions() -> dict[str, str]:
    """Versions of this program and of everything that writes bytes of a build."""
    return {name: version(name) for name in ("scanwright", *WRITERS)}


@contextmanager
def fresh_folder(target: Path) -> Iterator[Path]:
    """A folder beside `target` that takes the place of its build when the block ends, and vanishes if it fails.

    Files of the previous build that the new one does not have are removed; anything else in `target`, such as a
    recording, stays.

    Raises:
        BuildError: the folder cannot be written.
    """
    created = [folder for folder in (target, *target.parents) if not folder.exists()]
    try:
        target.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    except OSError as error:
        raise BuildError(f"{target}: cannot write the build folder: {error.strerror}") from error
    try:
        yield work
        previous = manifest_of(target).get("files", {})
        made = [path.relative_to(work) for path in sorted(work.rglob("*")) if path.is_file()]
        (target / MANIFEST).unlink(missing_ok=True)  # a build cut off while files move is no build
        for name in made:
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            if name != Path(MANIFEST):
                (work / name).replace(target / name)
        for name in set(previous) - {str(m) for m in made}:
            (target / name).unlink(missing_ok=True)
        (work / MANIFEST).replace(target / MANIFEST)
    finally:
        shutil.rmtree(work, ignore_errors=True)
        for folder in created:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def manifest_of(folder: Path) -> dict[str, Any]:
    """The manifest of a build folder; empty where there is none."""
    try:
        manifest: dict[str, Any] = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return manifest


def is_current(folder: Path, loaded: LoadedTask) -> bool:
    """Whether a folder holds the finished build of this very task by these versions, every file as it was written."""
    manifest = manifest_of(folder)
    if manifest.get("task_sha256") != loaded.sha256() or manifest.get("versions") != versions():
        return False
    files: dict[str, dict[str, Any]] = manifest["files"]
    return all((folder / name).is_file() and _sha256(folder / name) == facts["sha256"] for name, facts in files.items())


def write_manifest(folder: Path, loaded: LoadedTask, parts: list[dict[str, Any]]) -> None:
    """Digest every file in the folder; the last thing a build does."""
    files = {
        path.relative_to(folder).as_posix(): {"sha256": _sha256(path), "bytes": path.stat().st_size}
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    manifest = {
        "schema": "scanwright/manifest/1",
        "task": loaded.task.name,
        "task_sha256": loaded.sha256(),
        "versions": versions(),
        "parts": parts,
        "files": files,
    }
    write_json(folder / MANIFEST, manifest)


def write_json(path: Path, value: Any) -> None:
    """One JSON file as all of them are written: two spaces, keys in their order, a line feed at the end."""
    path.write_text(json.dumps(value, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def write_task(folder: Path, loaded: LoadedTask) -> None:
    """`task.toml` with every default written out; files that it names come along, so the folder builds by itself."""
    table = loaded.task.model_dump(mode="json", exclude_none=True)
    for key in ("weight", "mask"):
        for i, region in enumerate(getattr(loaded.task, key)):
            if isinstance(region, Map):
                table[key][i]["file"] = _bring(folder, loaded.source.parent / region.file, f"{key}-{i}")
    table["catalogue"] = [
        _bring(folder, loaded.source.parent / extra, f"catalogue-{i}") for i, extra in enumerate(loaded.task.catalogue)
    ]
    (folder / "task.toml").write_text(tomli_w.dumps(table), encoding="utf-8")


def write_search(folder: Path, result: SearchResult) -> None:
    """`search.csv`: for every scan-plane setting of the grid the lowest J, and the axis it was found about."""
    header = "alpha_laser_deg,beta_laser_deg,J,alpha_rot_deg,beta_rot_deg"
    np.savetxt(folder / "search.csv", result.planes, delimiter=",", header=header, comments="", fmt="%.5g")


def write_left_out(folder: Path, left_out: list[LeftOut]) -> None:
    """`left_out.json`: what the task made superfluous."""
    entries = [{"what": x.what, "why": x.why, "saved": x.saved, "unit": x.unit} for x in left_out]
    write_json(folder / "left_out.json", {"schema": "scanwright/left_out/1", "left_out": entries})


def angle_set(loaded: LoadedTask, family: Family) -> AngleSet:
    """The designed angle set of a family; J is rounded to its error."""
    task = loaded.task
    alpha_rot, beta_rot, alpha_laser, beta_laser = family.angles_deg
    J, J_error = rounded_to_error(family.score.J, family.score.J_error)
    return AngleSet(
        task=task.name,
        task_sha256=loaded.sha256(),
        angles_deg=Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha_laser, beta_laser=beta_laser),
        sensor=task.sensor,
        servo=task.servo,
        slip_ring=task.slip_ring,
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


def directions_left_out(problem: Problem) -> list[LeftOut]:
    """Directions that no J ever looked at, in square degrees."""
    directions: Array = spiral(SQUARE_DEGREES)
    masked = problem.field.masked_at(directions)
    ignored = (problem.field.weight_at(directions) == 0) & ~masked
    out = []
    if masked.any():
        out.append(LeftOut("masked directions", "the robot hides them", int(masked.sum()), "square degrees"))
    if ignored.any():
        out.append(LeftOut("directions of weight zero", "they add nothing to J", int(ignored.sum()), "square degrees"))
    return out


def standard_settings() -> dict[str, Array]:
    """The standard alignments in radians: what an optimum is compared with."""
    return {name: np.radians(angles) for name, angles in STANDARD_DEG.items()}


def _bring(folder: Path, source: Path, prefix: str) -> str:
    name = f"{prefix}{source.suffix}"
    shutil.copyfile(source, folder / name)
    return name


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
