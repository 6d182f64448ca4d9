"""The results folder: one file for each result, under the digest of its record and of the program that made it.

So none is ever computed twice. It may be shared: then workers read and write it themselves, and what they finish stays
even if everybody else dies.
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
    """A results folder, and the mark that tells whether a worker sees the same one."""

    folder: Path
    mark: str

    def get(self, address: str) -> Result | None:
        """A result; None where there is none."""
        try:
            found: Result = json.loads(self._path(address).read_text(encoding="utf-8"))
        except (FileNotFoundError, json.JSONDecodeError):  # a file system may have lost its end
            return None
        return found

    def has(self, address: str) -> bool:
        """Whether there is a result."""
        return self._path(address).exists()

    def put(self, address: str, result: Result) -> None:
        """Keep a result: whole or not at all, whatever ends the program."""
        path = place_in(self.folder, f"{address[:2]}/{address}.json", BuildError)
        path.parent.mkdir(exist_ok=True)
        with atomic_write(path, BuildError) as part:
            part.write_text(json.dumps(result), encoding="utf-8")

    def is_here(self) -> bool:
        """Whether this process sees the folder of the client: another computer may have one of that name."""
        try:
            return bool(json.loads((self.folder / MARK).read_text())["mark"] == self.mark)
        except (OSError, ValueError, KeyError):
            return False

    def _path(self, address: str) -> Path:
        return self.folder / address[:2] / f"{address}.json"


def open_results(folder: Path) -> Results:
    """The results folder, made if need be.

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
        raise BuildError(f"{path}: not the mark of a results folder: remove it, or take another folder") from error


@cache
def program() -> dict[str, str]:
    """Versions of everything that a result comes from, and a digest of our own code: a checkout may be ahead of it."""
    return {"python": platform.python_version(), **versions(), "code": code_digest()}


def address(kind: str, digest: str) -> str:
    """Where the result of a record is kept: a digest of the record and of the program, 64 hex digits."""
    made_by = "\n".join(f"{name} {value}" for name, value in sorted(program().items()))
    return hashlib.sha256(f"{kind}\n{digest}\n{made_by}".encode()).hexdigest()
