"""Requirement of devices on the operating system."""

from __future__ import annotations

from importlib.util import find_spec

from scanwright.design.errors import InstallError

MODULES = ("fcntl", "termios")


def require_posix() -> None:
    """Raise InstallError without Python's `fcntl` and `termios`, as on Windows."""
    if not all(find_spec(module) for module in MODULES):
        raise InstallError("devices need Linux or macOS; everything that drives no device works here too")
