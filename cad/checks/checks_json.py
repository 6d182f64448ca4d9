"""`checks.json`: the findings of all checks, written and read, and the lines of those that failed."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from scanwright.design.errors import BuildError
from scanwright.design.findings import Finding, Severity, errors_in, sentence

SEVERITY_IN_FILE: dict[Severity, str] = {"ok": "pass", "note": "note", "warning": "warning", "error": "error"}
SEVERITY_OF = {word: severity for severity, word in SEVERITY_IN_FILE.items()}


def checks_text(checks: Iterable[Finding]) -> str:
    """Return the content of `checks.json`."""
    content = {"schema": "scanwright/checks/1", "checks": entries_of(checks)}
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def entries_of(checks: Iterable[Finding]) -> list[dict[str, Any]]:
    """Return the checks with the keys of the file; a hint is the end of its message."""
    return [
        {
            "kind": check.code,
            "severity": SEVERITY_IN_FILE[check.severity],
            "value": check.value,
            "limit": check.limit,
            "unit": check.unit,
            "where": check.subject,
            "message": sentence(check),
        }
        for check in checks
    ]


def add_check(path: Path, check: Finding) -> None:
    """Add a check of the scanner on its robot to the checks of its parts; raises as `read_checks`."""
    path.write_text(checks_text((*read_checks(path), check)), encoding="utf-8")


def read_checks(path: Path) -> tuple[Finding, ...]:
    """Return the checks of a `checks.json`; an unknown severity counts as an error.

    Raises:
        BuildError: the file is missing, or no build wrote it.
    """
    try:
        return tuple(
            Finding(
                entry["kind"],
                SEVERITY_OF.get(entry["severity"], "error"),
                entry["where"],
                *(entry[key] for key in ("message", "value", "limit", "unit")),
            )
            for entry in json.loads(path.read_text(encoding="utf-8"))["checks"]
        )
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise BuildError(f"{path}: not as a build writes it ({error}): build the folder again") from error


def failure_lines(checks: Sequence[Finding]) -> list[str]:
    """Return one line for each failed check and a summary; none if no check failed."""
    failed = errors_in(checks)
    if not failed:
        return []
    count = f"{len(failed)} of {len(checks)} checks failed"
    return [*(f"check failed: {sentence(check)}" for check in failed), f"{count}: do not make these parts"]
