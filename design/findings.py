"""The record of every result that a person reads: checks, faults, remarks on devices, parts and recordings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Severity = Literal["ok", "note", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One result. Programs read its fields; nothing decides by its message.

    Attributes:
        code: kind of the result, the same in every version; lower case with underscores.
        severity: ok; note, which only informs; warning, for a person to look at; error, which fails a command.
        subject: part, product, device, field or topic that it is about.
        message: one sentence for a person, without the hint.
        value: the measured value; None if there is none.
        limit: the bound that the value must keep; None if it only informs.
        unit: of value and limit.
        hint: what to do about it; empty if there is nothing to do.
    """

    code: str
    severity: Severity
    subject: str
    message: str
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    hint: str = ""


def sentence(finding: Finding) -> str:
    """Return message and hint as one line."""
    return f"{finding.message}: {finding.hint}" if finding.hint else finding.message


def errors_in(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings of severity `error`."""
    return tuple(finding for finding in findings if finding.severity == "error")
