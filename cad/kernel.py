"""The CAD kernel takes seconds to load, so it is loaded late; whether it can be is asked first, and costs nothing."""

from __future__ import annotations

import ctypes
import sys

from scanwright.design.errors import InstallError, require

_PACKAGES = ("cadquery", "OCP", "ezdxf", "jinja2", "manifold3d", "reportlab", "shapely")


def require_kernel(work: str) -> None:
    """Refuse work that needs the CAD kernel where that is not installed. It is not loaded.

    Args:
        work: what the line says needs it, such as "build".

    Raises:
        InstallError: a package of the extra `cad`, or the system library that the kernel draws with, is missing.
    """
    require("cad", f"{work} needs the CAD kernel", *_PACKAGES)
    if sys.platform == "linux":
        try:
            ctypes.CDLL("libGL.so.1")
        except OSError as error:
            raise InstallError(
                f"{work} needs the CAD kernel, and that a library of the system ({error}): "
                "apt-get install --no-install-recommends libgl1"
            ) from error
