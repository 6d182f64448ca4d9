"""No figure of a valid task ends in a traceback: `benchmarks/design/shown.py` shows thousands of tasks."""

import numpy as np
import pytest
from quick_tests import samples

from benchmarks.design.shown import shown, shown_task


@pytest.mark.parametrize("number", samples(range(24), [0]))
def test_all_figures_of_a_random_task_are_shown(number, tmp_path):
    """Through what stands behind `evaluate`, `compare`, the report and the studio."""
    failures, _ = shown(shown_task(np.random.default_rng([5, number]), tmp_path), tmp_path)
    assert not failures, failures[0].trace
