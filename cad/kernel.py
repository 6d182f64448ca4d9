"""Check whether the CAD kernel is installed, without loading it, which takes seconds."""

import ctypes
import sys

from scanwright.design.errors import InstallError, require

_PACKAGES = ("cadquery", "OCP", "ezdxf", "jinja2", "manifold3d", "reportlab", "shapely")


def require_kernel(work: str) -> None:
    """Raise if the CAD kernel is not installed; `work` is the subject of the message, such as "build".

    Raises:
        InstallError: a package of the extra `cad`, or a system library of the kernel, is missing.
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
