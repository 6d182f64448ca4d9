"""The compiled sort of short lists."""

import numpy as np
import pytest

from scanwright.design.sphere.shell_sort import sort_indices


@pytest.mark.parametrize("crowd", [1, 400])
@pytest.mark.parametrize("n", [0, 1, 2, 5, 33, 400])
def test_the_first_indices_are_sorted_by_their_values_and_the_others_stay(n, crowd):
    values = np.round(np.random.default_rng(n).normal(size=n), 1)  # some are equal
    order = np.arange(n + 3)
    sort_indices(values, order, n, crowd)
    assert (np.diff(values[order[:n]]) >= 0).all()
    assert sorted(order[:n]) == list(range(n)) and order[n:].tolist() == [n, n + 1, n + 2]
