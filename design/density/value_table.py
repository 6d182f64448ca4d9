"""Values of g for counts 0, 1, 2 .., as long as a scan needs them: few directions see more than some thousand beams."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from scanwright.design.arrays import Array, Counts, Ints
from scanwright.design.concurrency.parallel import in_chunks

FIRST = 1 << 14  # entries of the table that all directions are tried with

Walk = Callable[[Ints, Array], tuple[Array, Array, Array, Array, Ints]]
"""From directions, by their numbers, and a table of g to their statistics, and the entries that each needs."""


def walked(walk: Walk, directions: int, g: Callable[[Counts], Array], repeats: int, smallest: int) -> list[Array]:
    """The four statistics that a walk finds for so many directions, (directions,) each.

    Args:
        walk: leaves the statistics of a direction open if the table has fewer entries than it needs.
        directions: their number.
        g: of counts of beams.
        repeats: beams of each line that is counted.
        smallest: number of directions that is worth a thread.
    """
    result, need = _with_table(walk, np.arange(directions), _table(g, repeats, FIRST), smallest)
    late = np.flatnonzero(need > FIRST)
    if len(late):
        again, _ = _with_table(walk, late, _table(g, repeats, 1 << int(need.max() - 1).bit_length()), 1)
        for values, those in zip(result, again, strict=True):
            values[late] = those
    return result


def _with_table(walk: Walk, which: Ints, table: Array, smallest: int) -> tuple[list[Array], Ints]:
    parts = in_chunks(lambda chunk: walk(which[chunk], table), len(which), smallest=smallest)
    *result, need = (np.concatenate(values) for values in zip(*parts, strict=True))
    return result, need


@lru_cache(maxsize=64)
def _table(g: Callable[[Counts], Array], repeats: int, entries: int) -> Array:
    return g(repeats * np.arange(float(entries)))
