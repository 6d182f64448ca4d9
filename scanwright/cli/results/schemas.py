"""JSON schemas of the `--json` output of the commands."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import is_dataclass
from typing import Any, get_args, get_type_hints

from pydantic import TypeAdapter

from scanwright.cli.results.angles import Compared, Evaluated, Optimised
from scanwright.cli.results.of_commands import (
    Built,
    Calibrated,
    Checked,
    Created,
    Devices,
    Diagnosis,
    Mapped,
    MeasuredModel,
    OpenedPage,
    Products,
    Published,
    Rebuilt,
    Registered,
    Settings,
    Studied,
    WrittenFiles,
)
from scanwright.cli.results.scans import Repaired, ScanResult
from scanwright.firmware_io.assembly.assemble import AssembleSummary
from scanwright.firmware_io.recording.convert import Converted
from scanwright.firmware_io.recording.importer import ImportSummary

RESULTS: dict[str, Any] = {
    "new": Created,
    "optimise": Optimised,
    "evaluate": Evaluated,
    "compare": Compared,
    "catalogue": Products,
    "accuracy": WrittenFiles,
    "build": Built | Rebuilt,
    "check": Checked,
    "measure": MeasuredModel,
    "report": WrittenFiles,
    "study": Studied,
    "emulate": Devices,
    "doctor": Diagnosis | Settings,
    "servo-setup": Settings,
    "scan": ScanResult,
    "ros2": Published,
    "import": ImportSummary,
    "repair": Repaired,
    "assemble": AssembleSummary,
    "calibrate": Calibrated,
    "register": Registered,
    "map": Mapped,
    "convert": Converted,
    "studio": OpenedPage,
    "view": OpenedPage,
}
"""Command -> record that it prints with `--json`."""


def result_schema(command: str) -> dict[str, Any]:
    """Return the JSON schema of the `--json` output of a command, with descriptions from the records."""
    schema = TypeAdapter(RESULTS[command]).json_schema(mode="serialization")
    kinds = {kind.__name__: kind for kind in _records_in(RESULTS[command])}
    for record in (schema, *schema.get("$defs", {}).values()):
        if kind := kinds.get(record.get("title", "")):
            record["description"] = inspect.cleandoc(kind.__doc__ or "").split("\n\n", maxsplit=1)[0]
            for name, words in _attributes(kind).items():
                record["properties"].get(name, {})["description"] = words
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _records_in(kind: Any) -> Iterator[type[Any]]:
    """Yield the dataclasses in a type."""
    if is_dataclass(kind):
        yield kind  # type: ignore[misc]
        for inner in get_type_hints(kind).values():
            yield from _records_in(inner)
    for inner in get_args(kind):
        yield from _records_in(inner)


def _attributes(kind: type[Any]) -> dict[str, str]:
    """Return field -> description: the comment behind or above it, or else its entry in the docstring."""
    described: dict[str, str] = {}
    for base in filter(is_dataclass, reversed(kind.__mro__)):
        _, _, listed = inspect.cleandoc(base.__doc__ or "").partition("\nAttributes:\n")
        entries = re.findall(r"^    (\w+): (.*(?:\n {5,}.*)*)", listed, re.MULTILINE)
        described |= {name: " ".join(words.split()) for name, words in entries}
        fields = re.findall(
            r"^((?: +# .*\n)*) +(\w+): .*?(?:  # (?!noqa)(.*))?$", inspect.getsource(base), re.MULTILINE
        )
        for above, name, behind in fields:
            if words := " ".join([*re.findall("# (.*)", above), behind]).strip():
                described[name] = f"{words}."
    return described
