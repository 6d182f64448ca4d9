"""One check: what was measured, against what, and where; and `checks.json`, the list of them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from scanwright.cad.layout.loads import RATED_AT_MM, rated_moment_nm
from scanwright.cad.layout.names import SERVO
from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner

Severity = Literal["pass", "note", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Check:
    """One measured value.

    Attributes:
        kind: what was checked.
        severity: pass; note, where there is nothing to pass; warning, where a person should look; error, where it
            failed.
        value: measured, None where it could not be.
        limit: what the value must keep, None where it only informs.
        unit: of both.
        where: part, or parts.
        message: one line for a person.
    """

    kind: str
    severity: Severity
    value: float | None
    limit: float | None
    unit: str
    where: str
    message: str


def at_most(
    kind: str, value: float, limit: float, unit: str, where: str, what: str, doubt: float | None = None
) -> Check:
    """A check that fails above its limit, and warns where `doubt` of the value reaches above it."""
    fails, may_fail = value > limit, value + (doubt or 0.0) > limit
    severity: Severity = "error" if fails else "warning" if may_fail else "pass"
    relation = "over" if fails else "of"
    message = f"{where}: {what}: {doubted(value, doubt)} {unit}, {relation} {figures(limit)}"
    return Check(kind, severity, tidy(value), tidy(limit), unit, where, message)


def at_least(kind: str, value: float, limit: float, unit: str, where: str, what: str) -> Check:
    """A check that fails below its limit."""
    fails = value < limit
    message = f"{where}: {what}: {figures(value)} {unit}, {'under' if fails else 'at least'} {figures(limit)}"
    return Check(kind, "error" if fails else "pass", tidy(value), tidy(limit), unit, where, message)


def note(kind: str, value: float | None, unit: str, where: str, what: str, doubt: float | None = None) -> Check:
    """A value to know, within its doubt."""
    shown = "not known" if value is None else f"{doubted(value, doubt)} {unit}"
    return Check(kind, "note", None if value is None else tidy(value), None, unit, where, f"{where}: {what}: {shown}")


def rated(kind: str, value: float, rating: float | None, unit: str, where: str, what: str, by: str = "") -> Check:
    """A check against a maker's rating, with what that says; a value to know where the maker gives none."""
    if rating is None:
        return note(kind, value, unit, where, f"{what}, for which its maker gives no rating")
    return at_most(kind, value, rating, unit, where, f"{what}{by}")


def horn_check(scanner: Scanner, moment_nm: float, what: str) -> Check:
    """The tilt moment on the servo's horn against its rating."""
    by = f", rated {scanner.servo.radial_load_n:g} N at {RATED_AT_MM:g} mm" if scanner.servo.radial_load_n else ""
    return rated("tilt_moment", moment_nm, rated_moment_nm(scanner), "N m", SERVO, what, by)


def doubted(value: float, doubt: float | None) -> str:
    """A value, and how far it may be off where that is told."""
    return figures(value) if doubt is None else f"{figures(value)} +- {doubt:.1g}"


def figures(value: float) -> str:
    """Three figures, in full where they stand before the point: nobody reads 8.7e+04 mm3 off a printer."""
    short = f"{value:.3g}"
    return f"{float(short):,.0f}" if "e+" in short else short


def spot(point: Array) -> str:
    """Words for a point [mm], shape (3,), to a tenth."""
    x, y, z = (f"{round(float(c), 1) + 0.0:g}" for c in point)
    return f"at ({x}, {y}, {z}) in the rotation frame"


def checks_text(checks: Iterable[Check]) -> str:
    """`checks.json`."""
    content = {"schema": "scanwright/checks/1", "checks": [asdict(check) for check in checks]}
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def read_checks(path: Path) -> tuple[Check, ...]:
    """Return the checks of a `checks.json`.

    Raises:
        BuildError: the file is missing, or is not as a build writes it.
    """
    try:
        return tuple(Check(**entry) for entry in json.loads(path.read_text(encoding="utf-8"))["checks"])
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise BuildError(f"{path}: not as a build writes it ({error}): build the folder again") from error


def failed_of(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Return the checks that failed: those of severity `error`."""
    return tuple(check for check in checks if check.severity == "error")


def failure_lines(checks: Sequence[Check]) -> list[str]:
    """Return one line for each failed check and a summary; none if no check failed."""
    failed = failed_of(checks)
    if not failed:
        return []
    count = f"{len(failed)} of {len(checks)} checks failed"
    return [*(f"check failed: {check.message}" for check in failed), f"{count}: do not make these parts"]


def tidy(value: float) -> float:
    """Four digits: the last bits of a kernel's volumes are no measurement."""
    return float(f"{value:.4g}") + 0.0
