"""Values of a product that do not agree with the real device and that its record cannot hold right yet."""

from __future__ import annotations

import json

from pydantic_core import to_jsonable_python

from scanwright.design.files.record import Record

PATTERN_FIELDS = ("holes", "horn_holes", "horn_first_hole_deg")
"""Fields that place screws: if one is wrong, the screws do not meet the holes of the device."""


class KnownError(Record):
    """One wrong value.

    Attributes:
        field: its name, with its part after a dot; any words for a quantity that the record lacks.
        device: what the real device has.
        source: where `device` was read or measured.
        effect: what follows from the error, in words.
        fits: whether printed parts fit the device all the same.
    """

    field: str
    device: str
    source: str
    effect: str = ""
    fits: bool = False

    def words(self, product: object) -> str:
        """The error as a sentence, without the name of its product."""
        value = product
        for part in self.field.split("."):
            value = getattr(value, part, None)
        shown = self.field if value is None else f"{self.field} = {json.dumps(to_jsonable_python(value))}"
        pattern = self.field in PATTERN_FIELDS
        wrong = "is a hole pattern that does not exist on the device" if pattern else "is wrong"
        return f"{shown} {wrong}: the device has {self.device}{self.effect and f'; {self.effect}'}"
