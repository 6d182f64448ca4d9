"""Matrix products in the thread that asks: tiles of them are too small to be worth waking others for."""

from __future__ import annotations

import numpy as np

from scanwright.design.arrays import Array

ROWS = 16
ALONE = 1 << 18  # multiplications: OpenBLAS shares larger products out among threads of its own


def blocked_product(a: Array, b: Array, out: Array) -> None:
    """`np.matmul(a, b, out=out)` of shapes (n, k), (k, m) as a stack of products so small that none is shared out.

    Other processes and our own threads ask for the cores too: then OpenBLAS waits for its threads, 15 ms a product,
    where a tile of the search takes one. Stacked, blocks are as fast as one large product in one thread.
    """
    columns = max(ROWS, 1 << int(np.log2(max(1, ALONE / (ROWS * max(1, len(b)))))))
    rows_end, columns_end = len(a) // ROWS * ROWS, b.shape[1] // columns * columns
    for rows in (slice(0, rows_end), slice(rows_end, None)):
        for part in (slice(0, columns_end), slice(columns_end, None)):
            _stacked(a[rows], b[:, part], out[rows, part], columns)


def product(a: Array, b: Array) -> Array:
    """`a @ b`, as `blocked_product` makes it."""
    out = np.empty((len(a), b.shape[1]), np.result_type(a, b))
    blocked_product(a, b, out)
    return out


def _stacked(a: Array, b: Array, out: Array, columns: int) -> None:
    """The same of blocks of `ROWS` rows and so many columns, or of fewer that are one block."""
    n, m = min(ROWS, len(a)), min(columns, b.shape[1])
    if n and m:
        blocks = out.reshape(-1, n, out.shape[1] // m, m).swapaxes(1, 2)  # a view: axes are split only
        np.matmul(a.reshape(-1, 1, n, a.shape[1]), b.reshape(len(b), -1, m).swapaxes(0, 1), out=blocks)
