"""The build folder `out/<task>/`: written completely or not at all, by one build at a time.

A build is made in `.<task>.building` next to its folder, and then moved file by file. `.<task>.moving` lists the files
of the move, so that the next build removes those of a build that was killed during the move. Manifests can contain any
file names, and the folder can contain links: `_require_free_names` checks each name before anything moves.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from scanwright.design.concurrency.processes import sigint_deferred
from scanwright.design.errors import BuildError, ScanwrightError
from scanwright.design.files.atomic_file import place_in
from scanwright.pipeline.manifest import MANIFEST, inside, listed_files, read_manifest, write_json

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


@contextmanager
def fresh_folder(target: Path) -> Iterator[Path]:
    """Make a folder next to `target` that replaces its build when the block ends; it is removed if the block fails.

    Files of the previous build that the new one does not have are removed; anything else in `target`, such as a
    recording, stays. `target` may be a link to a folder.

    Raises:
        BuildError: the folder cannot be written, or another build of it is running.
    """
    if target.is_symlink():
        target = target.resolve()
    created = [folder for folder in (target.parent, *target.parent.parents) if not folder.exists()]
    work, moving = (target.with_name(f".{target.name}.{what}") for what in ("building", "moving"))
    try:
        with _disk_errors(target):
            target.parent.mkdir(parents=True, exist_ok=True)
        with _alone(target):
            try:
                with _disk_errors(target):
                    shutil.rmtree(work, ignore_errors=True)  # of a build that was killed
                    work.mkdir()
                yield work
                with _disk_errors(target), sigint_deferred():
                    made = _files_in(work)
                    known = {*listed_files(target), *_names_in_transit(moving), *made}
                    _require_free_names(target, made, known)
                    _move(work, target, moving, made, known)
            finally:
                shutil.rmtree(work, ignore_errors=True)
    finally:
        for folder in created:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


@contextmanager
def _disk_errors(target: Path, what: str = "the build folder") -> Iterator[None]:
    """Raise errors of the system as errors of the folder."""
    try:
        yield
    except ScanwrightError:
        raise
    except OSError as error:
        raise BuildError(f"{target}: cannot write {what}: {error.strerror or error}") from error


@contextmanager
def report_folder(target: Path) -> Iterator[Path]:
    """Make a folder for reports if needed, and remove it if it stays empty.

    Raises:
        BuildError: it is a build folder, or cannot be written.
    """
    if read_manifest(target):
        raise BuildError(f"{target}: is a build folder, which must not contain other files; choose another folder")
    with _disk_errors(target, "the comparison"):
        target.mkdir(parents=True, exist_ok=True)
        try:
            yield target
        finally:
            if not any(target.iterdir()):
                target.rmdir()


@contextmanager
def _alone(target: Path) -> Iterator[None]:
    """Lock a build folder; the lock ends with the process.

    Raises:
        BuildError: another process has locked it.
    """
    path = target.with_name(f".{target.name}.lock")
    with _locked(path, target) as lock:
        if not path.exists() or path.stat().st_ino != os.fstat(lock.fileno()).st_ino:  # the holder has removed it
            raise BuildError(f"{target}: another build of this folder has just ended: build again")
        try:
            yield
        finally:
            if fcntl is None:
                lock.close()  # Windows cannot remove an open file
            path.unlink(missing_ok=True)


def _locked(path: Path, target: Path) -> TextIO:
    """Open the lock file and lock it; if the system has no `flock`, the file alone is the lock.

    Raises:
        BuildError: another process has locked it.
    """
    busy = f"{target}: another build of this folder is at work: wait for it"
    with _disk_errors(target):
        try:
            lock = path.open("x" if fcntl is None else "a+", encoding="utf-8")
        except FileExistsError:
            raise BuildError(f"{busy}; if that build was killed, remove {path}") from None
    try:
        if fcntl is not None:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.close()
        raise BuildError(busy) from None
    return lock


def _require_free_names(target: Path, made: Iterable[str], known: Iterable[str]) -> None:
    """Stop the build before anything moves if a name of `target` cannot be written or removed.

    `made` move into it; `known` are those and the files of earlier builds, which are removed.

    Raises:
        BuildError: a file has the name of a folder, or a folder that of a file, or a path contains a link.
    """
    if target.exists() and not target.is_dir():
        raise BuildError(f"{target}: cannot write the build folder: a file has that name")
    for name in sorted({MANIFEST, *known}):
        place_in(target, name, BuildError)
    for name in made:
        for parent in (target / name).parents:
            if parent == target:
                break
            if parent.exists() and not parent.is_dir():
                raise BuildError(f"{parent}: is a file, but the build needs a folder of that name: move it")
        if (target / name).is_dir():
            raise BuildError(f"{target / name}: is a folder, but the build needs a file of that name: move it")


def _move(work: Path, target: Path, moving: Path, made: list[str], known: set[str]) -> None:
    """Move every file of `work` into `target`, the manifest last, and remove files of earlier builds."""
    write_json(moving, sorted(known))
    target.mkdir(exist_ok=True)
    (target / MANIFEST).unlink(missing_ok=True)  # an interrupted move leaves no valid build
    for name in made:
        if name != MANIFEST:
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            (work / name).replace(target / name)
    for name in sorted(known - set(made)):
        (target / name).unlink(missing_ok=True)
    _drop_empty_folders(target, known)
    if MANIFEST in made:
        (work / MANIFEST).replace(target / MANIFEST)
    moving.unlink(missing_ok=True)


def _names_in_transit(moving: Path) -> set[str]:
    """Return the files that a killed build can have left in the folder."""
    try:
        names = json.loads(moving.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return set()
    return {name for name in names if isinstance(name, str) and inside(name)} if isinstance(names, list) else set()


def _drop_empty_folders(target: Path, names: Iterable[str]) -> None:
    """Remove folders of build files that are empty now."""
    for folder in sorted({parent for name in names for parent in Path(name).parents if parent.parts}, reverse=True):
        if (target / folder).is_dir() and not any((target / folder).iterdir()):
            (target / folder).rmdir()


def _files_in(folder: Path) -> list[str]:
    return [path.relative_to(folder).as_posix() for path in sorted(folder.rglob("*")) if path.is_file()]
