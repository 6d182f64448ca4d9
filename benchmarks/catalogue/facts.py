"""Compare the catalogue with a table of facts about the real devices, row by row.

    uv run python -m benchmarks.catalogue.facts PATH_OF_FACTS_CSV

The table has the columns file, field, found_value, source and certainty. Rows whose value is a number, or a list of
numbers, are compared with the record of that file; the others need a person. Prints every difference with source and
certainty; one gives exit code 1.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scanwright.design.catalogue.catalogue import SHIPPED, load_product
from scanwright.design.catalogue.holes import Face, mounting_holes
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.servo import Servo

TOLERANCE = 1e-6
RENAMED = {
    "mount_holes_mm": "base.places",
    "mount_thread_depth_mm": "base.depth_mm",
    "case_holes_mm": "front.places",
    "case_rear_holes_mm": "rear.places",
}
FACES: dict[str, Face] = {"case_holes_z_mm": "+z", "case_rear_holes_z_mm": "-z"}
"""Where the record holds the values of a table that names the fields of version 0.1."""


@dataclass(frozen=True, slots=True)
class Row:
    """One fact that was compared.

    Attributes:
        verdict: agrees, differs, or no value.
        line: file, field, both values, certainty and source, for a person.
    """

    verdict: str
    line: str


def number_of(text: str) -> Any:
    """Return the number, or the nested list of numbers, that a text is; None if it is anything else."""
    try:
        value = json.loads(text)
    except json.JSONDecodeError:
        return None
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return None
    return value if numbers.size and not isinstance(value, bool) else None


def value_of(product: Product, field: str) -> Any:
    """Return the value of a field, or of a part of it after a dot; None if the record has none."""
    if field in FACES and isinstance(product, Servo):
        pattern = mounting_holes(product.holes, FACES[field])
        others = (hole.at_mm[2] for hole in product.holes if hole.axis == FACES[field])
        return pattern.z_mm if pattern.places else next(others, None)
    value: Any = product
    for part in RENAMED.get(field, field).split("."):
        value = getattr(value, part, None)
    return value


def same(value: Any, fact: Any) -> bool:
    """Return whether two numbers or lists of numbers are equal; the order of points in a list does not count."""
    if np.ndim(fact) == 2:
        value, fact = sorted(value), sorted(fact)
    return np.shape(value) == np.shape(fact) and bool(np.allclose(value, fact, rtol=0, atol=TOLERANCE))


def compared(rows: Iterator[dict[str, str]], folder: Path = SHIPPED) -> Iterator[Row]:
    """Compare every row whose value is a number or a list of numbers and whose file exists."""
    for row in rows:
        fact, path = number_of(row["found_value"]), folder / row["file"]
        if fact is None or not path.exists():
            continue
        product = load_product(path)
        value = value_of(product, row["field"])
        if value is None:
            verdict = "no value"
        elif same(value, fact):
            verdict = "agrees"
        else:
            verdict = "differs"
        shown = f"{row['file']} {row['field']}: catalogue {value}, device {fact}"
        yield Row(verdict, f"{verdict}: {shown} [{row['certainty']}; {row['source']}]")


def main() -> None:
    """Print the differences and a count; exit 1 if there is one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("facts", type=Path, help="table of facts, CSV")
    with parser.parse_args().facts.open(encoding="utf-8", newline="") as file:
        rows = list(compared(csv.DictReader(file)))
    for row in rows:
        if row.verdict != "agrees":
            print(row.line)
    counts = Counter(row.verdict for row in rows)
    print(f"{len(rows)} rows compared: " + ", ".join(f"{counts[verdict]} {verdict}" for verdict in sorted(counts)))
    sys.exit(counts["differs"] > 0)


if __name__ == "__main__":
    main()
