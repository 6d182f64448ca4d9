"""What a build says beside its files: findings for a person to read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class PartFinding:
    """One remark about a part. `note` informs, `warning` asks for a look before the part is made.

    Attributes:
        code: what kind of remark it is.
        severity: how much it matters.
        subject: the part or the product that it is about.
        message: the remark in words.
        value: the value of the product that it is about, as `field = value`; empty where it is about none.
    """

    code: str
    severity: Literal["note", "warning"]
    subject: str
    message: str
    value: str = ""
