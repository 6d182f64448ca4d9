"""The manifest of a build folder: the digest of every file, the task, the versions and the code.

The module imports no CAD, so that the check whether a build is current is fast.
"""

from __future__ import annotations

import hashlib
import json
import re
from functools import cache
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import Any

from scanwright.design.errors import BuildError
from scanwright.design.files.atomic_file import place_in
from scanwright.design.task.task import LoadedTask

MANIFEST = "manifest.json"
_CODE = (".py", ".csv", ".j2", ".js", ".css")  # products and tasks are in the digest of the task
_PACKAGES = ("scanwright.design", "scanwright.cad", "scanwright")
_NESTED = {"design", "cad", "firmware_io"}  # links in a checkout, folders of an installed package
_NAMED = 3  # files of a kind that a message names


@cache
def versions() -> dict[str, str]:
    """Return the versions of this program and of all packages that the extra `cad` pins."""
    pinned = {line.split("==")[0] for line in requires("scanwright") or () if re.search(r"extra == .cad\b", line)}
    return {name: _version(name) for name in ("scanwright", *sorted(pinned))}


@cache
def code_digest() -> str:
    """Return the digest of our own code, 12 hex digits: a checkout can be newer than its version."""
    digest = hashlib.sha256()
    for package in _PACKAGES:
        spec = find_spec(package)
        for root in [] if spec is None else sorted(spec.submodule_search_locations or []):
            for path in sorted(path for path in Path(root).resolve().rglob("*") if path.suffix in _CODE):
                name = path.relative_to(Path(root).resolve())
                if package != "scanwright" or name.parts[0] not in _NESTED:
                    digest.update(f"{package}/{name.as_posix()}\n".encode())
                    digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of a build folder; empty if it is missing or invalid."""
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    if not isinstance(manifest, dict) or not isinstance(manifest.get("files"), dict):
        return {}
    return manifest


def listed_files(folder: Path) -> tuple[str, ...]:
    """Return the files that the manifest of a build folder lists, without names that lead out of the folder."""
    return tuple(name for name in read_manifest(folder).get("files", {}) if inside(name))


def inside(name: str) -> bool:
    """Return whether a relative file name stays inside its folder."""
    path = PurePosixPath(name)
    return bool(path.parts) and not path.is_absolute() and ".." not in path.parts and "\0" not in name


def changes(folder: Path, but: str | None = None) -> str:
    """Return the files of a build folder except `but` that changed, as "a.stl is missing, b.csv was edited".

    The text is empty if none changed, or without a manifest.
    """
    manifest = read_manifest(folder)
    if not manifest and (folder / MANIFEST).exists():
        return f"{MANIFEST} was edited"
    files = {name: facts for name, facts in manifest.get("files", {}).items() if name != but}
    here = {name: facts for name, facts in files.items() if inside(name) and (folder / name).is_file()}
    missing = [name for name in files if name not in here]
    edited = [name for name, facts in here.items() if not _is_as_written(folder / name, facts)]
    kinds = (missing, "is missing", "are missing"), (edited, "was edited", "were edited")
    return ", ".join(f"{_some(names)} {one if len(names) == 1 else all_}" for names, one, all_ in kinds if names)


def require_as_built(folder: Path, but: str | None = None) -> None:
    """Reject a build folder with missing or edited files except `but`; a folder without a manifest passes.

    Raises:
        BuildError: a file is missing or was edited.
    """
    if edits := changes(folder, but):
        raise BuildError(
            f"{folder}: {edits} since it was built: build the folder again, or copy angles.json, task.toml and "
            "the files that it names to another folder"
        )


def is_current(folder: Path, loaded: LoadedTask) -> bool:
    """Return whether a folder is the complete, unchanged build of this task by this program."""
    manifest = read_manifest(folder)
    files = manifest.get("files")
    if not files or manifest.get("task_sha256") != loaded.sha256():
        return False
    if manifest.get("versions") != versions() or manifest.get("code") != code_digest():
        return False
    return not changes(folder)


def first_difference(folder: Path, again: Path) -> str | None:
    """Describe the first difference between a build folder and a rebuild of its task; None if all bytes are equal.

    Raises:
        BuildError: the folder is not a finished build.
    """
    built = set(listed_files(folder))
    if not read_manifest(folder):
        raise BuildError(f"{folder / MANIFEST}: missing or unreadable: not a finished build; build it first")
    rebuilt = set(listed_files(again))
    for name in sorted(built | rebuilt):
        if name not in rebuilt:
            return f"{name}: the second build has no such file"
        if not (folder / name).is_file():
            return f"{name}: missing"
        digests = _sha256(folder / name), _sha256(again / name)
        if digests[0] != digests[1]:
            return f"{name}: sha256 {digests[0][:12]}, built again {digests[1][:12]}"
    if (folder / MANIFEST).read_bytes() != (again / MANIFEST).read_bytes():
        return f"{MANIFEST}: differs, though no file does: other versions, or other code"
    return None


def write_manifest(folder: Path, loaded: LoadedTask, parts: list[dict[str, Any]]) -> None:
    """Write the digests of all files in the folder; later files are entered by `enter`."""
    files = {path.relative_to(folder).as_posix(): _facts(path) for path in sorted(folder.rglob("*")) if path.is_file()}
    manifest = {
        "schema": "scanwright/manifest/1",
        "task": loaded.task.name,
        "task_sha256": loaded.sha256(),
        "versions": versions(),
        "code": code_digest(),
        "parts": parts,
        "files": files,
    }
    write_json(folder / MANIFEST, manifest)


def enter(folder: Path, name: str) -> None:
    """Add the digest of a later file to the manifest of its build, if there is one."""
    manifest = read_manifest(folder)
    if manifest:
        files = manifest["files"] | {name: _facts(folder / name)}
        manifest["files"] = dict(sorted(files.items(), key=lambda entry: Path(entry[0])))
        write_json(place_in(folder, MANIFEST, BuildError), manifest)


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file atomically: two spaces, keys in order, a line feed at the end."""
    part = path.with_name(f"{path.name}.part")
    part.unlink(missing_ok=True)  # a link of that name would be followed
    part.write_text(json.dumps(value, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    part.replace(path)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # of an extra that is not installed
        return "none"


def _is_as_written(path: Path, facts: Any) -> bool:
    return isinstance(facts, dict) and _sha256(path) == facts.get("sha256")


def _some(names: list[str]) -> str:
    """Return a few names and the number of the others."""
    if len(names) > _NAMED:
        return f"{', '.join(names[:_NAMED])} and {len(names) - _NAMED} more"
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _facts(path: Path) -> dict[str, Any]:
    return {"sha256": _sha256(path), "bytes": path.stat().st_size}


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
