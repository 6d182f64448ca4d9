"""Hulls are one closed body of the volume that scipy says, where their polygons are nearly flat too."""

import numpy as np
import pytest
from scanners import scanner_at
from scipy.spatial import ConvexHull

from scanwright.cad import solids
from scanwright.cad.layout.placement import placement_of
from scanwright.cad.parts.mounts.base_mount import base_mount


@pytest.mark.parametrize("twist", [0.0, 2e-7, 1e-6, 1e-5, 1e-4, 1e-2])
@pytest.mark.parametrize("seed", range(3))
def test_a_hull_of_two_squares_that_are_hardly_askew(twist, seed):
    rng = np.random.default_rng(seed)
    square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    tilt = twist * rng.choice([-1.0, 1.0], 2)
    low = np.column_stack([30 * square, np.zeros(4)])
    high = np.column_stack([20 * square, 50 + 20 * square @ tilt])
    made = solids.hull(np.concatenate([low, high]))
    assert made.isValid()
    assert made.Volume() == pytest.approx(ConvexHull(np.concatenate([low, high])).volume, rel=1e-9)


@pytest.mark.parametrize("axis_deg", [(0.01, -0.01), (180.01, 0.01)])
def test_a_deck_that_is_out_of_square_by_a_hundredth_of_a_degree_gets_its_mount(axis_deg):
    """Both angles alike, so that opposite corners of the pad are at one height: quadrilaterals that are nearly flat."""
    mount = base_mount(placement_of(scanner_at((*axis_deg, -55.4, -59.4))))
    beside = base_mount(placement_of(scanner_at((axis_deg[0], 1.3 * axis_deg[1], -55.4, -59.4))))
    assert mount.isValid()
    assert mount.Volume() == pytest.approx(beside.Volume(), rel=1e-4)
