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

_TOKEN = re.compile(r"'(?:[^']|'')*'|#\d+")
_COUNTER = re.compile(r"Open CASCADE STEP translator [\d.]+ [\d.]+")
_OCCURRENCE = re.compile(r"(NEXT_ASSEMBLY_USAGE_OCCURRENCE\()'\d+',('(?:[^']|'')*')")


def step_text(assembly: cq.Assembly, title: str) -> str:
    """The canonical STEP text of a named assembly of named, coloured parts; millimetres; `title` enters the header.

    Raises:
        BuildError: the kernel did not write it.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.step"
        assembly.export(str(path), exportType="STEP", write_pcurves=False)
        if not path.exists():
            raise BuildError(f"{assembly.name}: STEP: the CAD kernel wrote no file")
        return canonical_step(path.read_text(encoding="ascii").replace("'Open CASCADE Shape Model'", f"'{title}'", 1))


def canonical_step(text: str) -> str:
    """Rewrite STEP text so that only its content decides its bytes."""
    head, rest = text.split("DATA;", 1)
    data, tail = rest.split("ENDSEC;", 1)
    head = re.sub(r"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[^']*'", f"'{TIME_STAMP}'", head)
    head = _COUNTER.sub("Open CASCADE STEP translator", head)
    bodies = _entities(_COUNTER.sub("Open CASCADE STEP translator", data))
    # the id of an occurrence counts through the process: its name, unique in our assemblies, serves
    bodies = {key: _OCCURRENCE.sub(r"\1\2,\2", body) for key, body in bodies.items()}
    references = {key: [int(t[1:]) for t in _TOKEN.findall(body) if t[0] == "#"] for key, body in bodies.items()}
    digest = _digests(bodies, references)
    for key, body in bodies.items():
        if body.startswith(UNORDERED):
            bodies[key] = _with_sorted_lists(body, digest)
            references[key] = [int(t[1:]) for t in _TOKEN.findall(bodies[key]) if t[0] == "#"]
    pointed_at = {target for targets in references.values() for target in targets}
    roots = sorted((key for key in bodies if key not in pointed_at), key=lambda key: digest[key])
    order = _depth_first(roots, references)
    number = {key: i + 1 for i, key in enumerate(order)}

    def renumber(match: re.Match[str]) -> str:
        token = match.group()
        return f"#{number[int(token[1:])]}" if token[0] == "#" else token

    lines = [f"#{number[key]} = {_TOKEN.sub(renumber, bodies[key])};" for key in order]
    return f"{head}DATA;\n" + "\n".join(lines) + f"\nENDSEC;{tail}"


def _entities(data: str) -> dict[int, str]:
    """Entity bodies by number, white space outside strings squeezed; a string may hold a semicolon."""
    bodies = {}
    for match in re.finditer(r"#(\d+)\s*=\s*((?:'(?:[^']|'')*'|[^';])*);", data):
        parts = re.split(r"('(?:[^']|'')*')", match.group(2))
        bodies[int(match.group(1))] = "".join(p if p.startswith("'") else re.sub(r"\s+", "", p) for p in parts)
    return bodies


def _digests(bodies: dict[int, str], references: dict[int, list[int]]) -> dict[int, str]:
    """Merkle hash of every entity: independent of how the entities are numbered."""
    digest: dict[int, str] = {}
    for key in _depth_first(sorted(bodies), references, children_first=True):

        def resolve(match: re.Match[str]) -> str:
            token = match.group()
            return digest[int(token[1:])] if token[0] == "#" else token

        body = bodies[key]
        if body.startswith(UNORDERED):
            body = _with_sorted_lists(body, digest)
        digest[key] = hashlib.sha256(_TOKEN.sub(resolve, body).encode("ascii")).hexdigest()
    return digest


def _with_sorted_lists(body: str, digest: dict[int, str]) -> str:
    def in_order(match: re.Match[str]) -> str:
        items = match.group(1).split(",")
        return "(" + ",".join(sorted(items, key=lambda item: digest[int(item[1:])])) + ")"

    return re.sub(r"\((#\d+(?:,#\d+)+)\)", in_order, body)


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
