"""What a build says beside its files: findings for a person to read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class PartFinding:
    """One remark about a part. `note` informs, `warning` asks for a look before the part is made."""

    code: str
    severity: Literal["note", "warning"]
    subject: str
    message: str
