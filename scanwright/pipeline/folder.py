"""The build folder `out/<task>/`: written whole or not at all, and known by the digests in its manifest.

Cheap to import: asking whether a build is current must not load what makes one.
"""

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

from design.errors import BuildError
from design.task.task import LoadedTask

MANIFEST = "manifest.json"
WRITERS = (
    "cadquery",
    "cadquery-ocp",
    "ezdxf",
    "jinja2",
    "matplotlib",
    "numba",
    "numpy",
    "pillow",
    "reportlab",
    "scipy",
    "tomli-w",
    "trimesh",
)


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


@contextmanager
def report_folder(target: Path) -> Iterator[Path]:
    """A folder for the report, made if need be, and removed again if nothing came into it.

    Raises:
        BuildError: it is a build folder, or cannot be written.
    """
    if manifest_of(target):
        raise BuildError(f"{target}: --out: this is a build folder, and holds nothing but the build: take another one")
    try:
        target.mkdir(parents=True, exist_ok=True)
        try:
            yield target
        finally:
            if not any(target.iterdir()):
                target.rmdir()
    except OSError as error:
        raise BuildError(f"{target}: cannot write the comparison: {error.strerror}") from error


def manifest_of(folder: Path) -> dict[str, Any]:
    """The manifest of a build folder; empty where there is none."""
    try:
        manifest: dict[str, Any] = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return manifest


def listed_files(folder: Path) -> tuple[str, ...]:
    """Files of a build folder as its manifest lists them; none where there is none."""
    return tuple(manifest_of(folder).get("files", {}))


def is_current(folder: Path, loaded: LoadedTask) -> bool:
    """Whether a folder holds the finished build of this very task by these versions, every file as it was written."""
    manifest = manifest_of(folder)
    if manifest.get("task_sha256") != loaded.sha256() or manifest.get("versions") != versions():
        return False
    files: dict[str, dict[str, Any]] = manifest["files"]
    return all((folder / name).is_file() and _sha256(folder / name) == facts["sha256"] for name, facts in files.items())


def first_difference(folder: Path, again: Path) -> str | None:
    """What tells a build folder from a second build of its task, in words; None where every byte is the same.

    Raises:
        BuildError: the first one is no finished build.
    """
    built = manifest_of(folder).get("files")
    if built is None:
        raise BuildError(f"{folder / MANIFEST}: missing or unreadable: not a finished build; build it first")
    rebuilt = manifest_of(again)["files"]
    for name in sorted({*built, *rebuilt}):
        if name not in rebuilt:
            return f"{name}: the second build has no such file"
        if not (folder / name).is_file():
            return f"{name}: missing"
        digests = _sha256(folder / name), _sha256(again / name)
        if digests[0] != digests[1]:
            return f"{name}: sha256 {digests[0][:12]}, built again {digests[1][:12]}"
    if (folder / MANIFEST).read_bytes() != (again / MANIFEST).read_bytes():
        return f"{MANIFEST}: differs, though no file does: other versions"
    return None


def write_manifest(folder: Path, loaded: LoadedTask, parts: list[dict[str, Any]]) -> None:
    """Digest every file in the folder; what is made later enters itself."""
    files = {path.relative_to(folder).as_posix(): _facts(path) for path in sorted(folder.rglob("*")) if path.is_file()}
    manifest = {
        "schema": "scanwright/manifest/1",
        "task": loaded.task.name,
        "task_sha256": loaded.sha256(),
        "versions": versions(),
        "parts": parts,
        "files": files,
    }
    write_json(folder / MANIFEST, manifest)


def enter(folder: Path, name: str) -> None:
    """Digest a file that was made from a build into the manifest of that build; nothing to do where there is none."""
    manifest = manifest_of(folder)
    if manifest:
        files = manifest["files"] | {name: _facts(folder / name)}
        manifest["files"] = dict(sorted(files.items(), key=lambda entry: Path(entry[0])))
        write_json(folder / MANIFEST, manifest)


def write_json(path: Path, value: Any) -> None:
    """One JSON file as all of them are written: two spaces, keys in their order, a line feed at the end."""
    path.write_text(json.dumps(value, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _facts(path: Path) -> dict[str, Any]:
    return {"sha256": _sha256(path), "bytes": path.stat().st_size}


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
