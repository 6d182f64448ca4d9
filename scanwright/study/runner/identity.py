"""What a result depends on beside its record: the program. Equal on client and workers, part of every address."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from scanwright.pipeline.folder import versions

DECIDES = (".py", ".csv")  # products and tasks are part of the record


@cache
def identity() -> dict[str, str]:
    """Versions of everything that a result comes from, and a digest of our own code: a checkout may be ahead of it."""
    return {"python": platform.python_version(), **versions(), "code": _code()}


def tools() -> dict[str, str]:
    """The same, and the versions that must agree for client and workers to talk."""
    return identity() | {name: version(name) for name in ("dask", "distributed", "cloudpickle")}


def address(kind: str, digest: str) -> str:
    """Where the result of a record is kept: a digest of the record and of the program, 64 hex digits."""
    program = "\n".join(f"{name} {value}" for name, value in sorted(identity().items()))
    return hashlib.sha256(f"{kind}\n{digest}\n{program}".encode()).hexdigest()


def _code() -> str:
    digest = hashlib.sha256()
    for package in ("design", "cad", "scanwright"):
        spec = find_spec(package)
        for root in [] if spec is None else sorted(spec.submodule_search_locations or []):
            for path in sorted(p for p in Path(root).rglob("*") if p.suffix in DECIDES):
                digest.update(f"{package}/{path.relative_to(root).as_posix()}\n".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
