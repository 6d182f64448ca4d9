"""What a build says beside its files: findings for a person to read, and what was left out and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Finding:
    """One remark about a part. `note` informs, `warning` asks for a look before the part is made."""

    code: str
    severity: Literal["note", "warning"]
    subject: str
    message: str


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Something that this scanner does not need. `saved` counts what was not made, never seconds."""

    what: str
    reason: str
    saved: str
