"""Canonical STEP: the same scanner gives the same bytes in every process.

The kernel's writer adds the time, counts products per process, and orders colours by memory address. Every entity gets
the hash of its text with its references replaced by their hashes (a Merkle tree); roots are sorted by hash and
everything is renumbered depth first.
"""

import hashlib
import re
import tempfile
from pathlib import Path

import cadquery as cq

from scanwright.design.errors import BuildError

TIME_STAMP = "2000-01-01T00:00:00"
# Entities whose list of references the kernel fills in the order of memory addresses.
UNORDERED = ("MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION",)

STAND_INS = {"#": "\0", ";": "\1"}  # inside strings; STEP is ASCII without control characters

_STRING = re.compile(r"('(?:[^']|'')*')")
_COUNTER = re.compile(r"Open CASCADE STEP translator [\d.]+ [\d.]+")
_OCCURRENCE = re.compile(r"(NEXT_ASSEMBLY_USAGE_OCCURRENCE\()'\d+',('(?:[^']|'')*')")
_REFERENCE = re.compile(r"#(\d+)")
_LIST = re.compile(r"\((#\d+(?:,#\d+)+)\)")

Entity = tuple[str, tuple[int, ...]]
"""Text with `%s` for each reference, and the numbers that these refer to."""


def step_text(assembly: cq.Assembly, title: str) -> str:
    """Return the canonical STEP text of an assembly of named, coloured parts [mm]; `title` enters the header."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.step"
        assembly.export(str(path), exportType="STEP")
        if not path.exists():
            raise BuildError(f"{assembly.name}: STEP: the CAD kernel wrote no file")
        return canonical_step(path.read_text(encoding="ascii").replace("'Open CASCADE Shape Model'", f"'{title}'", 1))


def canonical_step(text: str) -> str:
    """Rewrite STEP text so that only its content decides its bytes."""
    head, rest = text.split("DATA;", 1)
    data, tail = rest.split("ENDSEC;", 1)
    head = re.sub(r"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[^']*'", f"'{TIME_STAMP}'", head)
    head = _COUNTER.sub("Open CASCADE STEP translator", head)
    # the id of an occurrence counts through the process: its name, unique in our assemblies, serves
    data = _OCCURRENCE.sub(r"\1\2,\2", _bare(_COUNTER.sub("Open CASCADE STEP translator", data)))
    entities = {int(name[1:]): _entity(body) for name, body in (line.split("=", 1) for line in data.split(";")[:-1])}
    digest = _digests(entities)
    pointed_at = {target for _, targets in entities.values() for target in targets}
    roots = sorted(entities.keys() - pointed_at, key=digest.__getitem__)
    order = _parents_first(roots, entities)
    number = {name: f"#{i}" for i, name in enumerate(order, start=1)}
    lines = [f"{number[name]} = {_filled(entities[name], number)};" for name in order]
    return f"{head}DATA;\n" + _readable("\n".join(lines)) + f"\nENDSEC;{tail}"


def _bare(data: str) -> str:
    """Remove white space outside strings, and replace signs with a meaning inside them."""
    parts = _STRING.split(data)
    parts[::2] = ["".join(part.split()) for part in parts[::2]]
    for sign, stand_in in STAND_INS.items():
        parts[1::2] = [part.replace(sign, stand_in) for part in parts[1::2]]
    return "".join(parts)


def _readable(data: str) -> str:
    for sign, stand_in in STAND_INS.items():
        data = data.replace(stand_in, sign)
    return data


def _entity(body: str) -> Entity:
    return _REFERENCE.sub("%s", body.replace("%", "%%")), tuple(map(int, _REFERENCE.findall(body)))


def _filled(entity: Entity, words: dict[int, str]) -> str:
    """Return the text of an entity with each reference replaced by its word."""
    text, targets = entity
    return text % tuple(map(words.__getitem__, targets))


def _digests(entities: dict[int, Entity]) -> dict[int, str]:
    """Return the Merkle hash of every entity, independent of their numbers; unordered lists are sorted."""
    digest: dict[int, str] = {}
    for name in _children_first(entities):
        if entities[name][0].startswith(UNORDERED):
            entities[name] = _with_sorted_lists(entities[name], digest)
        text = _readable(_filled(entities[name], digest))
        digest[name] = hashlib.sha256(text.encode("ascii")).hexdigest()
    return digest


def _with_sorted_lists(entity: Entity, digest: dict[int, str]) -> Entity:
    def in_order(match: re.Match[str]) -> str:
        return "(" + ",".join(sorted(match[1].split(","), key=lambda item: digest[int(item[1:])])) + ")"

    return _entity(_LIST.sub(in_order, _filled(entity, {number: f"#{number}" for number in entity[1]})))


def _children_first(entities: dict[int, Entity]) -> list[int]:
    """Return every entity once, after all that it refers to."""
    order: dict[int, None] = {}
    for first in entities:
        stack = [first]
        while stack:
            waiting = [target for target in entities[stack[-1]][1] if target not in order]
            stack += waiting
            if not waiting:
                order[stack.pop()] = None
    return list(order)


def _parents_first(roots: list[int], entities: dict[int, Entity]) -> list[int]:
    """Return every entity once, depth first; iterative, because chains of entities are long."""
    order: dict[int, None] = {}
    stack = roots[::-1]
    while stack:
        name = stack.pop()
        if name not in order:
            order[name] = None
            stack += reversed(entities[name][1])
    return list(order)
