"""What is read from a file is checked before anyone uses it: records, tables of TOML, arrays of NumPy."""

from __future__ import annotations

import tomllib
import zipfile
from pathlib import Path
from typing import IO, Any, get_args

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from design.errors import ScanwrightError, TaskError, suggest

_NUMBERS = "biuf"
_MOST_BYTES = 1 << 30  # an archive may be packed a thousandfold: beyond this it is hardly packed, or refused


class Record(BaseModel):
    """Immutable; a misspelt key is an error and not a default; NaN and infinity are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """The table of a TOML file.

    Raises:
        TaskError: the file cannot be read or is not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise TaskError(f"{path}: cannot read {what}: {error.strerror}") from error
    except RecursionError as error:
        raise TaskError(f"{path}: not a TOML file: nested too deeply") from error
    except ValueError as error:  # not UTF-8, not TOML, or a path with a NUL in it
        raise TaskError(f"{path}: not a TOML file: {error}") from error


def read_npy(path: Path, refusal: type[ScanwrightError]) -> NDArray[Any]:
    """The array of an `.npy` file: numbers, no objects.

    Raises:
        ScanwrightError: a `refusal`: the file cannot be read, or is no such array.
    """
    try:
        with path.open("rb") as stream:
            return _array(stream, path.stat().st_size)
    except OSError as error:
        raise refusal(f"{path}: cannot read: {error.strerror}") from error
    except Exception as error:
        raise refusal(f"{path}: not an array of NumPy: {_first_line(error)}") from error


def read_npz(path: Path, refusal: type[ScanwrightError]) -> dict[str, NDArray[Any]]:
    """The arrays of an `.npz` archive by name: numbers, no objects.

    Raises:
        ScanwrightError: a `refusal`: the file cannot be read, or is no such archive.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            most = max(_MOST_BYTES, 4 * path.stat().st_size)
            if (size := sum(member.file_size for member in members)) > most:
                raise ValueError(f"{size:,} bytes unpacked: at most {most:,}")
            held = {}
            for member in members:
                with archive.open(member) as stream:
                    held[member.filename.removesuffix(".npy")] = _array(stream, member.file_size)
            return held
    except OSError as error:
        raise refusal(f"{path}: cannot read: {error.strerror or _first_line(error)}") from error
    except Exception as error:
        raise refusal(f"{path}: not an archive of NumPy, or damaged: {_first_line(error)}") from error


def _array(stream: IO[bytes], size: int) -> NDArray[Any]:
    version = npy.read_magic(stream)
    read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}[version]
    shape, fortran, kind = read_header(stream)
    if kind.kind not in _NUMBERS:
        raise ValueError(f"an array of {kind}: numbers only")
    count = 1
    for side in shape:
        count *= side
    if min(shape, default=0) < 0 or count * kind.itemsize > size:
        raise ValueError(f"an array of shape {shape}, {kind}, in {size:,} bytes")
    data = stream.read(count * kind.itemsize)
    found = np.frombuffer(data, kind, count).reshape(shape, order="F" if fortran else "C")
    return found.astype(kind.newbyteorder("="))


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0][:200]


def explain(error: ValidationError, source: Path | str, model: type[BaseModel]) -> str:
    """One line for a person: file, field, value, what is wrong, and a suggestion where one is near.

    Only the first fault is told in full, an unknown key before a missing one: the others often follow from it.
    """
    faults = sorted(error.errors(include_url=False), key=lambda fault: fault["type"] != "extra_forbidden")
    fault = faults[0]
    loc = fault["loc"]
    record, path = _walk(model, loc)
    where = ".".join(path) or "(whole file)"
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    if fault["type"] == "extra_forbidden":
        known = [field.alias or name for name, field in record.model_fields.items()]
        return f"{source}: {where}: unknown key{suggest(str(loc[-1]), known)}{more}"
    if fault["type"] == "missing":
        return f"{source}: {where}: this key is required{more}"
    if fault["type"] == "json_invalid":
        return f"{source}: not a JSON file: {fault['msg'].removeprefix('Invalid JSON: ')}"
    if fault["type"] == "union_tag_invalid":
        key, tag, known = (fault["ctx"][name] for name in ("discriminator", "tag", "expected_tags"))
        near = suggest(tag, known.replace("'", "").split(", "))
        return f"{source}: {where}.{key.strip(chr(39))} = {tag!r}: not one of {known}{near}{more}"
    shown = repr(fault["input"])
    value = f" = {shown}" if len(shown) < 80 else ""
    return f"{source}: {where}{value}: {fault['msg'].removeprefix('Value error, ')}{more}"


def _walk(model: type[BaseModel], loc: tuple[int | str, ...]) -> tuple[type[BaseModel], list[str]]:
    """The record that holds the last part of `loc`, and the path as the file's author wrote it.

    pydantic puts the tag of a union or the name of a tried type into `loc`: those parts are no keys of the file.
    """
    record: type[BaseModel] = model
    inside: Any = model
    path: list[str] = []
    for part in loc:
        records = _records_in(inside)
        if isinstance(part, int):
            path.append(str(part))
            continue
        holder = next((r for r in records if part in _keys(r)), None)
        if holder is not None:
            record, path = holder, [*path, part]
            inside = _keys(holder)[part]
            continue
        tagged = next((r for r in records if part in _tags(r)), None)
        if tagged is not None:
            record, inside = tagged, tagged
        elif part is loc[-1] and records:
            record, path = records[0], [*path, part]
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
