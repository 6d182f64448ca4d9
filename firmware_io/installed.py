"""Families of devices and formats of clouds of installed packages, by entry points."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import entry_points
from typing import Any, TypeVar

from scanwright.design.errors import DeviceError, ScanwrightError

F = TypeVar("F", bound=Any)  # a family of lidars or servos, or a format of clouds, with a unique `name`


def with_installed(
    group: str, kind: type[F], shipped: Iterable[F], refusal: type[ScanwrightError] = DeviceError
) -> dict[str, F]:
    """Return the shipped ones and those of the entry points of a group, by name.

    Raises `refusal` if an entry point is not of this kind, or its name is already used.
    """
    known = {family.name: family for family in shipped}
    for entry in sorted(entry_points(group=group), key=lambda entry: entry.name):
        try:
            family = entry.load()
        except Exception as error:  # third-party code
            raise refusal(f"entry point {entry.value} of {group}: {error}") from error
        if not isinstance(family, kind):
            raise refusal(f"entry point {entry.value} of {group}: it names no {kind.__name__}")
        if family.name in known:
            raise refusal(f"entry point {entry.value} of {group}: there is a '{family.name}' already")
        known[family.name] = family
    return known
