"""Reference pages of task files, product files and JSON output, written from schemas when the pages are built."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

Schema = dict[str, Any]
_TYPES = {"number": "number", "integer": "integer", "string": "text", "boolean": "true or false"}


def write_schema_pages(folder: Path) -> None:
    """Write task-file.md, catalogue.md, devices.md and json.md into a folder."""
    from scanwright.design.catalogue.lidar import Lidar
    from scanwright.design.catalogue.products import Bearing, Belt, Printer
    from scanwright.design.catalogue.servo import Servo
    from scanwright.design.catalogue.slip_ring import SlipRing
    from scanwright.design.task.task import Task

    folder.mkdir(parents=True, exist_ok=True)
    task = [
        "# Task file",
        "",
        "Every key, with its default and its bounds. `scanwright new` writes a task file, `scanwright schema` prints "
        "the schema for an editor. Angles are in degrees, lengths in the unit that ends the key.",
        "",
        *_sections(Task.model_json_schema(), "At the top of the file"),
    ]
    (folder / "task-file.md").write_text("\n".join(task), encoding="utf-8")
    catalogue = [
        "# Product files",
        "",
        "Every key of a product in a catalogue file ([how to write one](../../how-to/your-lidar.md)). Lengths are in "
        "millimetres, masses in grams.",
        "",
    ]
    kinds = (Lidar, Servo, SlipRing, Bearing, Belt, Printer)
    shown: set[str] = set()
    for kind in kinds:
        catalogue += _sections(kind.model_json_schema(), kind.__name__, shown)
    (folder / "catalogue.md").write_text("\n".join(catalogue), encoding="utf-8")
    _write_sketches(folder)
    (folder / "json.md").write_text("\n".join(_json_page()), encoding="utf-8")


def _write_sketches(folder: Path) -> None:
    """Write devices.md with a sketch of every product that has dimensions."""
    from scanwright.cad.drawings.sketch import sketch_svg
    from scanwright.design.catalogue.catalogue import load_catalogue
    from scanwright.design.catalogue.products import Belt, Multibeam, Printer

    page = [
        "# Sketches of the products",
        "",
        "Drawn from the records of the catalogue, in the frame of each device. `scanwright catalogue NAME --sketch "
        "FILE.svg` draws the same. A `?` marks values that no source verifies.",
    ]
    (folder / "sketches").mkdir(exist_ok=True)
    for product in load_catalogue():
        if not isinstance(product, Belt | Multibeam | Printer):
            file = f"sketches/{product.name.lower().replace(' ', '-')}.svg"
            (folder / file).write_bytes(sketch_svg(product))
            page += ["", f"## {product.name}", "", f"![{product.name} with its dimensions]({file})"]
    (folder / "devices.md").write_text("\n".join([*page, ""]), encoding="utf-8")


def _json_page() -> Iterator[str]:
    """Yield the lines of the page on `--json`: a table for each record, where it is used first."""
    from scanwright.cli.results.schemas import RESULTS, result_schema

    yield from ("# JSON output", "")
    yield (
        "With `--json` a command prints one object on standard output, also with exit code 1; errors and warnings are "
        "on standard error. `scanwright schema COMMAND` prints its JSON schema. Infinite numbers are null."
    )
    shown: set[str] = set()
    for name in RESULTS:
        schema = result_schema(name)
        yield from ("", f"## {name}", "")
        tops = [schema["title"]] if "properties" in schema else [_named(one) for one in schema["anyOf"]]
        yield from (f"Prints {' or '.join(f'[{top}](#{top.lower()})' for top in tops)}.", "")
        records = {schema["title"]: schema} if "properties" in schema else {}
        for title, record in (records | schema.get("$defs", {})).items():
            if title not in shown and "properties" in record:
                shown.add(title)
                yield from _record(title, record)


def _record(title: str, record: Schema) -> Iterator[str]:
    """Yield a heading and a table for a record of the JSON output."""
    yield from (f"### {title}", "", record["description"], "", "| key | value | meaning |", "| --- | --- | --- |")
    for key, field in record["properties"].items():
        cells = (f"`{key}`", _type(field).replace("table", "object"), field["description"])
        yield f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |"
    yield ""


def _sections(schema: Schema, title: str, shown: set[str] | None = None) -> Iterator[str]:
    """Yield a heading and a table for a record, then for each record inside it that is not yet in `shown`."""
    shown = set() if shown is None else shown
    yield from _section(schema, title)
    for name, inner in schema.get("$defs", {}).items():
        if name not in shown and "properties" in inner:
            shown.add(name)
            yield from _section(inner, name)


def _section(schema: Schema, title: str) -> Iterator[str]:
    text = str(schema.get("description", "")).split("\n\nAttributes:")[0].strip()
    required = schema.get("required", ())
    yield from (f"## {title}", "", *(() if "Base of" in text else (text, "")))
    yield from ("| key | value | default | meaning |", "| --- | --- | --- | --- |")
    for key, field in schema["properties"].items():
        value = field.get("default")
        default = "required" if key in required else "its own" if isinstance(value, dict) else f"`{_toml(value)}`"
        cells = (f"`{key}`", _type(field), default, str(field.get("description", "")))
        yield f"| {' | '.join(cell.replace('|', '&#124;').replace(chr(10), ' ') for cell in cells)} |"
    yield ""


def _type(field: Schema) -> str:
    """Return the values that a key accepts, in words."""
    if "$ref" in field:
        return f"[{_named(field)}](#{_named(field).lower()})"
    if "const" in field:
        return f'`"{field["const"]}"`' if isinstance(field["const"], str) else f"`{field['const']}`"
    if "enum" in field:
        return ", ".join(f"`{_toml(value)}`" for value in field["enum"])
    if choices := field.get("anyOf") or field.get("oneOf"):
        return " or ".join(_type(choice) for choice in choices if choice.get("type") != "null")
    if field.get("type") == "array":
        inner = field.get("prefixItems") or [field.get("items", {})]
        return f"list of {' and '.join(dict.fromkeys(_type(item) for item in inner))}{_count(field)}"
    kinds = field.get("type", "")
    kind = next(kind for kind in kinds if kind != "null") if isinstance(kinds, list) else kinds
    return f"{_TYPES.get(kind, 'table')}{_bounds(field)}"


def _named(field: Schema) -> str:
    return str(field["$ref"]).rpartition("/")[2]


def _count(field: Schema) -> str:
    least, most = field.get("minItems"), field.get("maxItems")
    return f" ({least})" if least is not None and least == most else f" (at least {least})" if least else ""


def _bounds(field: Schema) -> str:
    names = {"exclusiveMinimum": "above", "minimum": "at least", "exclusiveMaximum": "below", "maximum": "at most"}
    bounds = [f"{word} {field[name]:g}" for name, word in names.items() if abs(field.get(name, 1e300)) < 1e300]
    return f" ({', '.join(bounds)})" if bounds else ""


def _toml(value: Any) -> str:
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if value is None or isinstance(value, bool):
        return "none" if value is None else str(value).lower()
    return f'"{value}"' if isinstance(value, str) else f"{value}"
