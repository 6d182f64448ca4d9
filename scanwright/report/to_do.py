"""What to do with a build before the first scan, in order."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from scanwright.design.findings import Finding
from scanwright.report.parts_list import PartsList


@dataclass(frozen=True, slots=True)
class ToDo:
    """One thing to do.

    Attributes:
        title: what to do, in a few words.
        text: why, or how.
        files: of the build folder that it needs, or sections of the page, which begin with "#".
        findings: the values that it is about.
    """

    title: str
    text: str
    files: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()


def to_do(files: Collection[str], findings: Sequence[Finding], parts: PartsList | None) -> list[ToDo]:
    """Return what to do, the first first.

    Args:
        files: names in the build folder.
        findings: all results of its checks.
        parts: parts list; None if unknown.
    """
    todo = _before_making(findings)
    if "print/fit_coupon.3mf" in files:
        text = "It shows which clearance your printer needs. Write the result into the printer's catalogue file."
        todo.append(ToDo("Print the fit coupon", text, ("print/fit_coupon.3mf",)))
    if parts is not None:
        text = "Lidar, servo and slip ring first: they decide the delivery date."
        todo.append(ToDo("Order devices, screws and wiring", text, ("#parts", "bom.csv")))
    machined = parts.group("turned") if parts is not None else None
    if machined is not None:
        sheets = tuple(f"drawings/{row['part']}.pdf" for row in machined.rows)
        text = f"Send the drawings to a workshop. It costs about {machined.usd}."
        todo.append(ToDo(f"Have {count(len(sheets), 'part')} machined", text, sheets))
    if plates := tuple(sorted(name for name in files if name.startswith("print/plate_") and name.endswith(".3mf"))):
        text = "The files set layers and lines in PrusaSlicer; set them yourself in other slicers."
        todo.append(ToDo(f"Print {count(len(plates), 'plate')}", text, plates))
    if "assembly.md" in files:
        text = "Follow the pictures: each step ends with a check."
        todo.append(ToDo("Assemble and wire", text, ("#assembly", "#wiring")))
    return todo


def count(number: int, what: str) -> str:
    """Return a number of things."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def _before_making(findings: Sequence[Finding]) -> list[ToDo]:
    """Return what to do before any part is made: failed checks, wrong values, values to measure."""
    todo = []
    if failed := [finding for finding in findings if finding.severity == "error"]:
        text = "Change the task until no check fails: each check states what to change."
        todo.append(ToDo(f"Fix {count(len(failed), 'failed check')}", text, ("#checks", "task.toml")))
    how = "Copy the device's catalogue file, change the values, name the copy in task.toml, and build again."
    if wrong := [each for each in findings if each.code == "known_error" and each.severity == "warning"]:
        text = f"Parts made with these values do not fit the real devices. {how}"
        todo.append(ToDo(f"Correct {count(len(wrong), 'wrong value')}", text, ("#checks", "task.toml")))
    if unverified := tuple(each for each in findings if each.code == "unverified"):
        text = f"These values are not from a drawing. A wrong one makes a part that does not fit. {how}"
        todo.append(ToDo(f"Measure {count(len(unverified), 'value')}", text, ("task.toml",), unverified))
    return todo
