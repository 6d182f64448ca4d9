"""What devices need of the operating system. Everything that drives no device works without it."""

from __future__ import annotations

from importlib.util import find_spec

from scanwright.design.errors import InstallError

MODULES = ("fcntl", "termios")


def require_posix() -> None:
    """Refuse to look for devices on a system whose serial ports cannot be locked and set as the drivers need it.

    Raises:
        InstallError: Python's `fcntl` or `termios` is missing, as it is on Windows.
    """
    if not all(find_spec(module) for module in MODULES):
        raise InstallError("devices need Linux or macOS; everything that drives no device works here too")
