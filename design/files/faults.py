"""Faults of a record read from a file: which key, on which line, and a suggestion."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from scanwright.design.errors import suggest
from scanwright.design.files.text_files import read_text

MOST_TOLD = 20  # faults of one file
_LONGEST_STATEMENT = 1000  # lines


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong in a file.

    Attributes:
        path: keys and numbers from the top of the file to it; empty where it is the whole file.
        says: value, bound and suggestion, as they follow the path in a line.
    """

    path: tuple[str, ...]
    says: str

    def __str__(self) -> str:
        return f"{'.'.join(self.path) or '(whole file)'}{self.says}"


def explain(error: ValidationError, source: Path | str, model: type[BaseModel]) -> str:
    """All faults for a person, one line each: file, line, field, value, what is wrong, a suggestion if one is near."""
    return tell(faults_of(error, model), source)


def tell(faults: Sequence[Fault], source: Path | str) -> str:
    """One line for each fault, in the order of the file; the first `MOST_TOLD` of them, where there are more.

    Args:
        faults: what is wrong.
        source: the file, whose lines are named where it is TOML; or what the file is called.
    """
    lines = _key_lines(source) if isinstance(source, Path) and source.suffix == ".toml" else {}
    first = min(lines.values(), default=0)
    at = [next((lines[p] for p in _upwards(fault.path) if p in lines), first) for fault in faults]
    placed = sorted(zip(at, faults, strict=True), key=lambda pair: pair[0])
    told = [f"{source}:{line}: {fault}" if line else f"{source}: {fault}" for line, fault in placed[:MOST_TOLD]]
    more = len(faults) - len(told)
    return "\n".join([*told, f"{source}: and {more} more like these"] if more else told)


def faults_of(error: ValidationError, model: type[BaseModel]) -> list[Fault]:
    """What a check of a record has found, in the words of the file.

    What only follows from another fault is left out: a key that is missing because it is misspelt, and a type of a
    union that nobody meant.
    """
    found = error.errors(include_url=False)
    walked = [(*_walk(model, fault["loc"]), fault) for fault in found]
    faults: dict[tuple[str, ...], list[str]] = {}
    meant: set[tuple[str, ...]] = set()
    for record, path, fault in sorted(walked, key=lambda each: each[2]["type"] != "extra_forbidden"):
        if fault["type"] == "missing" and path in meant:
            continue
        if fault["type"] == "extra_forbidden":
            near = suggest(path[-1], [field.alias or name for name, field in record.model_fields.items()])
            meant |= {(*path[:-1], key) for key in _keys(record) if near == f"; did you mean '{key}'?"}
            faults.setdefault(path, []).append(f": unknown key{near}")
        elif fault["type"] == "union_tag_invalid":
            faults.setdefault((*path, fault["ctx"]["discriminator"].strip("'")), []).append(_says(fault))
        else:
            faults.setdefault(path, []).append(_says(fault))
    deepest = [path for path in faults if not any(_inside(other, path) for other in faults)]
    return [Fault(path, _either(faults[path])) for path in deepest]


def _says(fault: Any) -> str:
    if fault["type"] == "missing":
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
    return f"{value}: {fault['msg'].removeprefix('Value error, ')}"


def _either(says: list[str]) -> str:
    """What the types of a union say of one value: the value once, then what each of them wants."""
    values, wants = zip(*(each.rpartition(": ")[::2] for each in says), strict=True)
    return says[0] if len(says) == 1 else f"{values[0]}: {', or '.join(dict.fromkeys(wants))}"


def _inside(path: tuple[str, ...], other: tuple[str, ...]) -> bool:
    return len(other) > 0 and path[: len(other)] == other and path != other


def _upwards(path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    return (path[:length] for length in range(len(path), 0, -1))


def _key_lines(path: Path) -> dict[tuple[str, ...], int]:
    """Line, from 1, on which each key of a TOML file begins, by its path; entries of arrays have their number.

    A statement of TOML ends where a line does, and can be read by itself: lines are gathered until they can.
    """
    lines: dict[tuple[str, ...], int] = {}
    last: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    statement, begun = "", 1
    try:
        text = read_text(path)
    except (OSError, ValueError):
        return lines
    for number, line in enumerate(text.split("\n"), 1):
        statement += line + "\n"
        try:
            parsed = tomllib.loads(statement)
        except ValueError:
            if number - begun > _LONGEST_STATEMENT:
                break
            continue
        if statement.lstrip().startswith("["):
            table = _numbered(parsed, last)
            paths = [table]
        else:
            paths = [(*table, *inner) for inner in _paths(parsed)]
        for each in paths:
            for known in _upwards(each):
                lines.setdefault(known, begun)
        statement, begun = "", number + 1
    return lines


def _numbered(header: dict[str, Any], last: dict[tuple[str, ...], int]) -> tuple[str, ...]:
    """Where the table of a header stands; `last` counts the entries of each array of tables so far."""
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
    """Paths to all that a value holds and that holds no more."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    deeper = [path for key, held in inner for path in _paths(held, (*above, str(key)))]
    yield from deeper or [above]


def _walk(model: type[BaseModel], loc: tuple[int | str, ...]) -> tuple[type[BaseModel], tuple[str, ...]]:
    """The record that holds the last part of `loc`, and the path as the file's author wrote it.

    pydantic puts the tag of a union or the name of a tried type into `loc`: those parts are no keys of the file.
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
    """Record classes inside an annotation such as `tuple[Region, ...]` or `Spin | Sweep`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [record for argument in get_args(annotation) for record in _records_in(argument)]


def _keys(record: type[BaseModel]) -> dict[str, Any]:
    return {field.alias or name: field.annotation for name, field in record.model_fields.items()}


def _tags(record: type[BaseModel]) -> set[str]:
    fields = record.model_fields
    return {str(value) for name in ("shape", "mode") if name in fields for value in get_args(fields[name].annotation)}
