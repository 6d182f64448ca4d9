"""Tables of g(0), g(1), g(2) .. for compiled kernels; few directions see more than some thousand beams."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from scanwright.design.arrays import Array, Counts, Ints
from scanwright.design.concurrency.parallel import in_chunks

FIRST = 1 << 14  # entries of the first table

Kernel = Callable[[Ints, Array], tuple[Array, Array, Array, Array, Ints]]
"""Maps indices of directions (n,) and a table of g to four statistics and the table entries needed, (n,) each."""


def with_value_table(
    kernel: Kernel, directions: int, g: Callable[[Counts], Array], repeats: int, smallest: int
) -> list[Array]:
    """Return the four statistics of all directions, (directions,) each, with a longer table for those that need it.

    `repeats` is the number of measurements of each line, `smallest` that of directions that are worth a thread.
    """
    result, need = _with_table(kernel, np.arange(directions), _table(g, repeats, FIRST), smallest)
    late = np.flatnonzero(need > FIRST)
    if len(late):
        again, _ = _with_table(kernel, late, _table(g, repeats, 1 << int(need.max() - 1).bit_length()), 1)
        for values, replaced in zip(result, again, strict=True):
            values[late] = replaced
    return result


def _with_table(kernel: Kernel, which: Ints, table: Array, smallest: int) -> tuple[list[Array], Ints]:
    parts = in_chunks(lambda chunk: kernel(which[chunk], table), len(which), smallest=smallest)
    *result, need = (np.concatenate(values) for values in zip(*parts, strict=True))
    return result, need


@lru_cache(maxsize=64)
def _table(g: Callable[[Counts], Array], repeats: int, entries: int) -> Array:
    return g(repeats * np.arange(float(entries)))
