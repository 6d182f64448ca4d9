"""The CAD kernel is imported late, and says in one line what it misses."""

from __future__ import annotations

import importlib

from design.errors import BuildError


def require_kernel() -> None:
    """Import cadquery.

    Raises:
        BuildError: cadquery, or a system library that it needs, is not installed.
    """
    try:
        importlib.import_module("cadquery")
    except ImportError as error:
        if "libGL" in str(error):
            raise BuildError(
                f"the CAD kernel misses a system library ({error}): apt-get install --no-install-recommends libgl1"
            ) from error
        raise BuildError(f"the CAD kernel is not installed ({error}): install cadquery==2.8.0") from error
