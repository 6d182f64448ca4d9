"""Canonical STEP: the same scanner gives the same bytes, in every process and under every hash seed.

The kernel's writer stamps the time, counts products per process, and orders colours by memory address. After
writing, every entity gets the hash of its own text with its references replaced by their hashes (a Merkle
tree); roots are sorted by hash and everything is renumbered depth first.
"""

from __future__ import annotations

import hashlib
import re
import tempfile
from pathlib import Path

import cadquery as cq

from design.errors import BuildError

TIME_STAMP = "2000-01-01T00:00:00"
# Entities whose list of references the kernel fills in the order of memory addresses.
UNORDERED = ("MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION",)

STAND_INS = {"#": "\0", ";": "\1"}  # inside strings; STEP is ASCII without control characters

_STRING = re.compile(r"('(?:[^']|'')*')")
_COUNTER = re.compile(r"Open CASCADE STEP translator [\d.]+ [\d.]+")
_OCCURRENCE = re.compile(r"(NEXT_ASSEMBLY_USAGE_OCCURRENCE\()'\d+',('(?:[^']|'')*')")
_REFERENCE = re.compile(r"#(\d+)")

Pieces = list[str]
"""An entity: text and the numbers that it refers to by turns, text first and last."""


def step_text(assembly: cq.Assembly, title: str) -> str:
    """The canonical STEP text of a named assembly of named, coloured parts; millimetres; `title` enters the header.

    Raises:
        BuildError: the kernel did not write it.
    """
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
    bodies = (entity.split("=", 1) for entity in data.split(";")[:-1])
    entities = {int(name[1:]): _REFERENCE.split(body) for name, body in bodies}
    references = {key: [int(number) for number in pieces[1::2]] for key, pieces in entities.items()}
    digest = _digests(entities, references)
    for key, pieces in entities.items():
        if pieces[0].startswith(UNORDERED):
            entities[key] = _with_sorted_lists(pieces, digest)
            references[key] = [int(number) for number in entities[key][1::2]]
    pointed_at = {target for targets in references.values() for target in targets}
    roots = sorted((key for key in entities if key not in pointed_at), key=lambda key: digest[key])
    order = _depth_first(roots, references)
    number = {key: f"#{i + 1}" for i, key in enumerate(order)}
    lines = [f"{number[key]} = {_filled(entities[key], references[key], number)};" for key in order]
    return f"{head}DATA;\n" + _readable("\n".join(lines)) + f"\nENDSEC;{tail}"


def _bare(data: str) -> str:
    """Without the white space outside strings, and without what means something there inside of them."""
    parts = _STRING.split(data)
    parts[::2] = ["".join(part.split()) for part in parts[::2]]
    for sign, stands_in in STAND_INS.items():
        parts[1::2] = [part.replace(sign, stands_in) for part in parts[1::2]]
    return "".join(parts)


def _readable(data: str) -> str:
    for sign, stands_in in STAND_INS.items():
        data = data.replace(stands_in, sign)
    return data


def _filled(pieces: Pieces, references: list[int], words: dict[int, str]) -> str:
    """The text of an entity with a word for each reference."""
    filled = pieces.copy()
    filled[1::2] = [words[key] for key in references]
    return "".join(filled)


def _digests(entities: dict[int, Pieces], references: dict[int, list[int]]) -> dict[int, str]:
    """Merkle hash of every entity: independent of how the entities are numbered."""
    digest: dict[int, str] = {}
    for key in _depth_first(sorted(entities), references, children_first=True):
        pieces, targets = entities[key], references[key]
        if pieces[0].startswith(UNORDERED):
            pieces = _with_sorted_lists(pieces, digest)
            targets = [int(number) for number in pieces[1::2]]
        digest[key] = hashlib.sha256(_readable(_filled(pieces, targets, digest)).encode("ascii")).hexdigest()
    return digest


def _with_sorted_lists(pieces: Pieces, digest: dict[int, str]) -> Pieces:
    def in_order(match: re.Match[str]) -> str:
        items = match.group(1).split(",")
        return "(" + ",".join(sorted(items, key=lambda item: digest[int(item[1:])])) + ")"

    body = _filled(pieces, list(range(len(pieces) // 2)), {i: f"#{number}" for i, number in enumerate(pieces[1::2])})
    return _REFERENCE.split(re.sub(r"\((#\d+(?:,#\d+)+)\)", in_order, body))


def _depth_first(roots: list[int], references: dict[int, list[int]], *, children_first: bool = False) -> list[int]:
    """Every entity once, in the order of a depth-first walk; iterative, because chains of entities are long."""
    order: list[int] = []
    seen: set[int] = set()
    stack = [(root, False) for root in reversed(roots)]
    while stack:
        key, finished = stack.pop()
        if finished:
            order.append(key)
            continue
        if key in seen:
            continue
        seen.add(key)
        if children_first:
            stack.append((key, True))
        else:
            order.append(key)
        stack.extend((child, False) for child in reversed(references[key]) if child not in seen)
    return order
