"""The results folder: every result under the address of its record, so that none is ever computed twice.

It may be shared: then workers read and write it themselves, and what they finish stays even if everybody else dies.
"""

from __future__ import annotations

import json
import os
import secrets
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from design.errors import BuildError

MARK = "results.json"

Result = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Store:
    """A results folder, and the mark that tells whether a worker sees the same one."""

    folder: Path
    mark: str

    def get(self, address: str) -> Result | None:
        """A result; None where there is none."""
        try:
            found: Result = json.loads(self._path(address).read_text(encoding="utf-8"))
        except (FileNotFoundError, json.JSONDecodeError):
            return None
        return found

    def has(self, address: str) -> bool:
        """Whether there is a result."""
        return self._path(address).exists()

    def put(self, address: str, result: Result) -> None:
        """Keep a result: whole or not at all, whatever ends the program."""
        path = self._path(address)
        path.parent.mkdir(exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=".part", delete=False, encoding="utf-8") as file:
            json.dump(result, file)
        os.replace(file.name, path)  # noqa: PTH105  both names are strings

    def _path(self, address: str) -> Path:
        return self.folder / address[:2] / f"{address}.json"


def open_store(folder: Path) -> Store:
    """The results folder, made if need be.

    Raises:
        BuildError: it cannot be written.
    """
    path = folder.resolve() / MARK
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            path.write_text(json.dumps({"schema": "scanwright/results/1", "mark": secrets.token_hex(16)}) + "\n")
        return Store(folder.resolve(), json.loads(path.read_text())["mark"])
    except OSError as error:
        raise BuildError(f"{folder}: cannot write the results folder: {error.strerror}") from error
    except (ValueError, KeyError) as error:
        raise BuildError(f"{path}: not the mark of a results folder: remove it, or take another folder") from error


def shared_store(folder: str, mark: str) -> Store | None:
    """The results folder as a worker sees it; None where it is not the client's."""
    try:
        store = Store(Path(folder), json.loads((Path(folder) / MARK).read_text())["mark"])
    except (OSError, ValueError, KeyError):
        return None
    return store if store.mark == mark else None
