"""Common parts of the records of the catalogue: base class, provenance, wires. Millimetres, grams."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr
from pydantic_core import to_jsonable_python

from scanwright.design.files.faults import USB_ID
from scanwright.design.files.record import Record

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Box = tuple[Triple, Triple]
UsbId = Annotated[str, Field(pattern=USB_ID)]


def absent(value: object) -> bool:
    """Return whether to omit a new field from the dump, so that products without it keep their digest."""
    return value is None


def no_shape(description: str = "", **bounds: float) -> Any:
    """Return an optional field that affects no part: it is not in the dump, and so not in the digest of a task."""
    text = f"{description}; shapes no part" if description else "shapes no part"
    return Field(default=None, exclude=True, description=text, **bounds)  # type: ignore[call-overload]


class Provenance(Record):
    """Source of a value. `verified` means: two independent sources, or a drawing of the maker."""

    source: str
    verified: bool


LONGEST = 60
"""Characters of a value that a short list prints."""


class Product(Record):
    """Base of the catalogue records: name, maker, and the provenance of each value."""

    kind: str
    name: str
    maker: str
    _provenance: dict[str, Provenance] = PrivateAttr(default_factory=dict)

    def provenance(self) -> dict[str, Provenance]:
        """Source of each value, by field name."""
        return self._provenance

    def unverified(self) -> list[str]:
        """Names of the values that are not verified."""
        return [field for field, origin in self._provenance.items() if not origin.verified]

    def caution(self, field: str) -> str:
        """Return the end of a message on an unverified value; empty if it is verified."""
        origin = self._provenance.get(field)
        return "" if origin is None or origin.verified else " (not verified: measure yours)"

    def facts(self) -> dict[str, Any]:
        """Return every value, and under `provenance` its source, for JSON."""
        sources = {field: origin.model_dump() for field, origin in self._provenance.items()}
        values = {field: to_jsonable_python(getattr(self, field)) for field in type(self).model_fields}
        return {**values, "provenance": sources}

    def lines(self, in_full: bool = True) -> list[str]:
        """Return every value with its source; unless `in_full`, the unverified values without sources."""
        values = {field: json.dumps(to_jsonable_python(getattr(self, field))) for field in self._provenance}
        if in_full:
            lines = [
                f"  {' ' if origin.verified else '?'} {field} = {values[field]}   [{origin.source}]"
                for field, origin in self._provenance.items()
            ]
        else:
            short = {field: value if len(value) <= LONGEST else "..." for field, value in values.items()}
            unverified = "; ".join(f"{field} = {short[field]}" for field in self.unverified())
            lines = [f"  ? {unverified}"] if unverified else []
        mark = "  ? not verified: measure yours, and override the product in a catalogue file of your own"
        return [f"{self.name} ({self.maker})", *lines, mark]


Rating = Literal["usb2", "ethernet100", "none"]
Link = Literal["usb", "usb-powered", "ethernet", "serial"]


class Lead(Record):
    """One wire of a power lead. Several colours of one net are those of different revisions of the cable."""

    net: Literal["+", "-"]
    colour: str


class TiedPin(Record):
    """A pin that must be joined to another pin of the same plug if nothing drives it."""

    pin: str
    to: str


class Circuits(Record):
    """Equal circuits of a slip ring; a circuit for signals has less noise, not less current."""

    count: int = Field(gt=0)
    amps: float = Field(gt=0)
    use: Literal["power", "signal", "any"]
