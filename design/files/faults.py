"""Faults of a record read from a file: key, line, value, bound and a suggestion."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from scanwright.design.errors import suggest
from scanwright.design.files.text_files import read_text

MOST_REPORTED = 20  # faults of one file: about one screen
NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$"
USB_ID = "^[0-9a-f]{4}:[0-9a-f]{4}$"
_PATTERNS = {
    NAME: "1 to 64 letters, digits, - and _, the first a letter or a digit",
    USB_ID: "vendor and product as two times four hexadecimal digits, such as '10c4:ea60'",
}
_LONGEST_STATEMENT = 1000  # lines: bounds the time that a file without an end of its statement takes


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of a file. Unlike a `Finding` it has the path of its key, which gives the line, and no severity."""

    path: tuple[str, ...]  # keys and array indices from the top of the file; empty for the entire file
    message: str  # value, bound and suggestion, with the punctuation that follows the path

    def __str__(self) -> str:
        return f"{'.'.join(self.path) or '(entire file)'}{self.message}".removeprefix("(entire file): ")


def format_validation_error(error: ValidationError, source: Path | str, model: type[BaseModel]) -> str:
    """Return one line for each fault: file, line, field, value, bound, and a suggestion if a known key is close."""
    return format_faults(faults_in(error, model), source)


def format_faults(faults: Sequence[Fault], source: Path | str) -> str:
    """Return one line for each fault in the order of the file, at most `MOST_REPORTED` and the number of the others.

    `source` is a file, whose line numbers are added if it is TOML, or its name.
    """
    lines = _key_lines(source) if isinstance(source, Path) and source.suffix == ".toml" else {}
    first = min(lines.values(), default=0)
    at = [next((lines[p] for p in _upwards(fault.path) if p in lines), first) for fault in faults]
    placed = sorted(zip(at, faults, strict=True), key=lambda pair: pair[0])
    shown = [f"{source}:{line}: {fault}" if line else f"{source}: {fault}" for line, fault in placed[:MOST_REPORTED]]
    more = len(faults) - len(shown)
    return "\n".join([*shown, f"{source}: and {more} more like these"] if more else shown)


def faults_in(error: ValidationError, model: type[BaseModel]) -> list[Fault]:
    """Return the faults of a validation, with the keys of the file.

    Faults that follow from another one are omitted: a key that is missing because it is misspelt, and the other types
    of a union.
    """
    walked = [(*_walk(model, fault["loc"]), fault) for fault in error.errors(include_url=False)]
    faults: dict[tuple[str, ...], list[str]] = {}
    meant: set[tuple[str, ...]] = set()
    for record, path, fault in sorted(walked, key=lambda each: each[2]["type"] != "extra_forbidden"):
        if fault["type"] == "missing" and path in meant:
            continue
        if fault["type"] == "extra_forbidden":
            near = suggest(path[-1], [field.alias or name for name, field in record.model_fields.items()])
            meant |= {(*path[:-1], key) for key in _keys(record) if near == f"; did you mean '{key}'?"}
            faults.setdefault(path, []).append(f": unknown key{near}")
        elif fault["type"] in ("union_tag_invalid", "union_tag_not_found"):
            message = _message(fault)
            if fault["type"] == "union_tag_not_found":
                key = next((part for part in reversed(fault["loc"]) if isinstance(part, str)), "")
                tags = sorted({tag for each in _records_in(_keys(record).get(key)) for tag in _tags(each)})
                message += f": one of {', '.join(map(repr, tags))}" if tags else ""
            faults.setdefault((*path, fault["ctx"]["discriminator"].strip("'")), []).append(message)
        else:
            faults.setdefault(path, []).append(_message(fault))
    deepest = [path for path in faults if not any(_inside(other, path) for other in faults)]
    return [Fault(path, _either(faults[path])) for path in deepest]


def _message(fault: Any) -> str:
    if fault["type"] in ("missing", "union_tag_not_found"):
        return ": this key is required"
    if fault["type"] == "json_invalid":
        return f": not a JSON file: {fault['msg'].removeprefix('Invalid JSON: ')}"
    if fault["type"] == "union_tag_invalid":
        tag, known = fault["ctx"]["tag"], fault["ctx"]["expected_tags"]
        return f" = {tag!r}: not one of {known}{suggest(tag, known.replace(chr(39), '').split(', '))}"
    shown = repr(fault["input"])
    value = f" = {shown}" if len(shown) < 80 else ""
    if fault["type"] == "bool_type":
        return f"{value}: true or false, without quotes"
    if fault["type"] == "string_pattern_mismatch":
        return f"{value}: {_PATTERNS.get(fault['ctx']['pattern'], fault['msg'])}"
    return f"{value}: {fault['msg'].removeprefix('Value error, ')}"


def _either(messages: list[str]) -> str:
    """Join the messages of the types of a union: the value once, then what each type requires."""
    values, required = zip(*(message.rpartition(": ")[::2] for message in messages), strict=True)
    return messages[0] if len(messages) == 1 else f"{values[0]}: {', or '.join(dict.fromkeys(required))}"


def _inside(path: tuple[str, ...], other: tuple[str, ...]) -> bool:
    return len(other) > 0 and path[: len(other)] == other and path != other


def _upwards(path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    return (path[:length] for length in range(len(path), 0, -1))


def _key_lines(path: Path) -> dict[tuple[str, ...], int]:
    """Return the line, from 1, on which each key of a TOML file begins, by its path; array entries by their index.

    A statement of TOML ends at the end of a line and can be parsed alone: lines are joined until that works.
    """
    lines: dict[tuple[str, ...], int] = {}
    last: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    statement, first = "", 1
    try:
        text = read_text(path)
    except (OSError, ValueError):
        return lines
    for number, line in enumerate(text.split("\n"), 1):
        statement += line + "\n"
        try:
            parsed = tomllib.loads(statement)
        except ValueError:
            if number - first > _LONGEST_STATEMENT:
                break
            continue
        if statement.lstrip().startswith("["):
            table = _numbered(parsed, last)
            paths = [table]
        else:
            paths = [(*table, *inner) for inner in _paths(parsed)]
        for each in paths:
            for known in _upwards(each):
                lines.setdefault(known, first)
        statement, first = "", number + 1
    return lines


def _numbered(header: dict[str, Any], last: dict[tuple[str, ...], int]) -> tuple[str, ...]:
    """Return the path of the table of a header; `last` has the last index of each array of tables so far."""
    path: tuple[str, ...] = ()
    inside: Any = header
    while inside:
        ((name, inside),) = inside.items()
        path = (*path, name)
        if isinstance(inside, list):  # an array of tables begins an entry
            last[path] = last.get(path, -1) + 1
            inside = inside[0]
        if path in last:
            path = (*path, str(last[path]))
    return path


def _paths(value: Any, above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the paths to the leaves of a value."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    deeper = [path for key, item in inner for path in _paths(item, (*above, str(key)))]
    yield from deeper or [above]


def _walk(model: type[BaseModel], loc: tuple[int | str, ...]) -> tuple[type[BaseModel], tuple[str, ...]]:
    """Return the record that contains the last part of `loc`, and the path in the file.

    pydantic puts the tag of a union or the name of a tried type into `loc`: those parts are not keys of the file.
    """
    record: type[BaseModel] = model
    inside: Any = model
    path: tuple[str, ...] = ()
    for part in loc:
        records = _records_in(inside)
        if isinstance(part, int):
            path = (*path, str(part))
            continue
        holder = next((r for r in records if part in _keys(r)), None)
        if holder is not None:
            record, path = holder, (*path, str(part))
            inside = _keys(holder)[part]
            continue
        tagged = next((r for r in records if part in _tags(r)), None)
        if tagged is not None:
            record, inside = tagged, tagged
        elif part is loc[-1] and records:
            record, path = records[0], (*path, str(part))
    return record, path


def _records_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the record classes inside an annotation such as `tuple[Region, ...]` or `Spin | Sweep`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [record for argument in get_args(annotation) for record in _records_in(argument)]


def _keys(record: type[BaseModel]) -> dict[str, Any]:
    return {field.alias or name: field.annotation for name, field in record.model_fields.items()}


def _tags(record: type[BaseModel]) -> set[str]:
    fields = record.model_fields
    return {str(value) for name in ("shape", "mode") if name in fields for value in get_args(fields[name].annotation)}
