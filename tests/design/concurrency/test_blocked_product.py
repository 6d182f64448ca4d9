"""Products of all sizes against numpy's own, into part of a larger array too."""

import numpy as np
import pytest

from scanwright.design.concurrency.blocked_product import ROWS, blocked_product, product


@pytest.mark.parametrize("rows", [0, 1, ROWS, 5 * ROWS + 3])
@pytest.mark.parametrize(("inner", "columns"), [(1, 40), (91, 0), (91, 300), (721, 33)])
def test_blocks_are_the_product(rows, inner, columns):
    rng = np.random.default_rng(0)
    a, b = rng.random((rows, inner), np.float32), rng.random((inner, columns + 7), np.float32)
    assert product(a, b[:, 7:]) == pytest.approx(a @ b[:, 7:], rel=1e-5)
    out = np.full((rows + 2, columns), np.nan, np.float32)
    blocked_product(a, b[:, 7:], out[1:-1])
    assert out[1:-1] == pytest.approx(a @ b[:, 7:], rel=1e-5)
    assert np.isnan(out[[0, -1]]).all()
