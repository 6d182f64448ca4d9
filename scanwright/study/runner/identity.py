"""What a result depends on beside its record: the program. Equal on client and workers, part of every address."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import version

from scanwright.pipeline.manifest import code_digest, versions


@cache
def identity() -> dict[str, str]:
    """Versions of everything that a result comes from, and a digest of our own code: a checkout may be ahead of it."""
    return {"python": platform.python_version(), **versions(), "code": code_digest()}


def tools() -> dict[str, str]:
    """The same, and the versions that must agree for client and workers to talk."""
    return identity() | {name: version(name) for name in ("dask", "distributed", "cloudpickle")}


def address(kind: str, digest: str) -> str:
    """Where the result of a record is kept: a digest of the record and of the program, 64 hex digits."""
    program = "\n".join(f"{name} {value}" for name, value in sorted(identity().items()))
    return hashlib.sha256(f"{kind}\n{digest}\n{program}".encode()).hexdigest()
