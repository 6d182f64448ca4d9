"""The results folder: one file per result, named by the digest of its record and of the program.

So no result is computed twice. If the folder is shared, workers read and write it themselves, and finished results stay
even if the client ends.
"""

from __future__ import annotations

import hashlib
import json
import platform
import secrets
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from scanwright.design.errors import BuildError
from scanwright.design.files.atomic_file import atomic_write, place_in
from scanwright.pipeline.manifest import code_digest, versions

MARK = "results.json"

Result = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Results:
    """A results folder, and the mark with which a worker verifies that it has the same folder."""

    folder: Path
    mark: str

    def get(self, address: str) -> Result | None:
        """Return a result; None if there is none."""
        try:
            result: Result = json.loads(self._path(address).read_text(encoding="utf-8"))
        except (FileNotFoundError, json.JSONDecodeError):  # a file system can lose the end of a file
            return None
        return result

    def has(self, address: str) -> bool:
        """Return whether there is a result."""
        return self._path(address).exists()

    def put(self, address: str, result: Result) -> None:
        """Store a result atomically."""
        path = place_in(self.folder, f"{address[:2]}/{address}.json", BuildError)
        path.parent.mkdir(exist_ok=True)
        with atomic_write(path, BuildError) as part:
            part.write_text(json.dumps(result), encoding="utf-8")

    def is_here(self) -> bool:
        """Return whether this process sees the client's folder, not another one of the same name."""
        try:
            return bool(json.loads((self.folder / MARK).read_text())["mark"] == self.mark)
        except (OSError, ValueError, KeyError):
            return False

    def _path(self, address: str) -> Path:
        return self.folder / address[:2] / f"{address}.json"


def open_results(folder: Path) -> Results:
    """Open the results folder, and create it if it does not exist.

    Raises:
        BuildError: it cannot be written.
    """
    path = place_in(folder.resolve(), MARK, BuildError)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            path.write_text(json.dumps({"schema": "scanwright/results/1", "mark": secrets.token_hex(16)}) + "\n")
        return Results(folder.resolve(), json.loads(path.read_text())["mark"])
    except OSError as error:
        raise BuildError(f"{folder}: cannot write the results folder: {error.strerror}") from error
    except (ValueError, KeyError) as error:
        raise BuildError(f"{path}: not the mark of a results folder: remove it, or choose another folder") from error


@cache
def program() -> dict[str, str]:
    """Return the versions that results depend on, and the digest of our own code."""
    return {"python": platform.python_version(), **versions(), "code": code_digest()}


def address(kind: str, digest: str) -> str:
    """Return the address of a result: digest of its record and of the program, 64 hex digits."""
    made_by = "\n".join(f"{name} {value}" for name, value in sorted(program().items()))
    return hashlib.sha256(f"{kind}\n{digest}\n{made_by}".encode()).hexdigest()
