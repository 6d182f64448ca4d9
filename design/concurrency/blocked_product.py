"""Matrix products in the calling thread: products of tiles are too small to share between threads."""

from __future__ import annotations

import numpy as np

from scanwright.design.arrays import Array

ROWS = 16  # of a block
ALONE = 1 << 18  # multiplications: OpenBLAS distributes larger products over its threads


def blocked_product(a: Array, b: Array, out: Array) -> None:
    """`np.matmul(a, b, out=out)` of shapes (n, k), (k, m) as a stack of products too small for OpenBLAS threads.

    If other processes and our own threads use the cores, OpenBLAS waits for its threads, 15 ms a product, while a tile
    of the search takes 1 ms. Stacked, blocks are as fast as one large product in one thread.
    """
    columns = max(ROWS, 1 << int(np.log2(max(1, ALONE / (ROWS * max(1, len(b)))))))
    rows_end, columns_end = len(a) // ROWS * ROWS, b.shape[1] // columns * columns
    for rows in (slice(0, rows_end), slice(rows_end, None)):
        for part in (slice(0, columns_end), slice(columns_end, None)):
            _stacked(a[rows], b[:, part], out[rows, part], columns)


def product(a: Array, b: Array) -> Array:
    """Return `a @ b`, computed by `blocked_product`."""
    out = np.empty((len(a), b.shape[1]), np.result_type(a, b))
    blocked_product(a, b, out)
    return out


def _stacked(a: Array, b: Array, out: Array, columns: int) -> None:
    """Multiply blocks of `ROWS` rows and `columns` columns, or one smaller block."""
    n, m = min(ROWS, len(a)), min(columns, b.shape[1])
    if n and m:
        blocks = out.reshape(-1, n, out.shape[1] // m, m).swapaxes(1, 2)  # a view: axes are split only
        np.matmul(a.reshape(-1, 1, n, a.shape[1]), b.reshape(len(b), -1, m).swapaxes(0, 1), out=blocks)
