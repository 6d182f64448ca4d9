"""Families of devices that installed packages add to the shipped ones, by entry points."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import entry_points
from typing import Protocol, TypeVar

from scanwright.design.errors import DeviceError


class Named(Protocol):
    """A family of lidars or servos."""

    @property
    def name(self) -> str:
        """Of the family, unlike any other."""


F = TypeVar("F", bound=Named)


def with_installed(group: str, kind: type[F], shipped: Iterable[F]) -> dict[str, F]:
    """The shipped families and those that the entry points of a group name, by name.

    Raises:
        DeviceError: an installed package names something else, or a family that there is already.
    """
    known = {family.name: family for family in shipped}
    for entry in sorted(entry_points(group=group), key=lambda entry: entry.name):
        try:
            family = entry.load()
        except Exception as error:  # of somebody else's code: whatever it raises
            raise DeviceError(f"entry point {entry.value} of {group}: {error}") from error
        if not isinstance(family, kind):
            raise DeviceError(f"entry point {entry.value} of {group}: it names no {kind.__name__}")
        if family.name in known:
            raise DeviceError(f"entry point {entry.value} of {group}: there is a family '{family.name}' already")
        known[family.name] = family
    return known
