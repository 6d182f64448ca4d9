"""The simplex against scipy's: same steps, fewer values, nothing beyond the bounds."""

import numpy as np
import pytest
from scipy.optimize import minimize, rosen

from design.search.simplex import Enough, lowest_by_simplex

CORNERS = np.array([[-1.2, 0.8, 0.5], [-0.7, 0.8, 0.5], [-1.2, 0.4, 0.5], [-1.2, 0.8, 0.9]])


@pytest.mark.parametrize("bounds", [[-9.0, 9.0], [-2.0, 0.9]])
def test_it_goes_where_that_of_scipy_goes(bounds):
    bounds = np.array([bounds] * 3)
    values = np.array([rosen(corner) for corner in CORNERS])
    found = lowest_by_simplex(rosen, CORNERS, values, bounds, Enough(1e-6, 1e-9, 2000))
    options = {"initial_simplex": CORNERS, "xatol": 1e-6, "fatol": 1e-9}
    theirs = minimize(rosen, CORNERS[0], method="Nelder-Mead", bounds=bounds, options=options)
    assert found == pytest.approx(theirs.x, abs=1e-9)


@pytest.mark.parametrize("most", [3, 4, 31, 62])
def test_it_takes_no_more_values_than_it_may(most):
    taken = []

    def counted(point):
        taken.append(point)
        return rosen(point)

    values = np.array([rosen(corner) for corner in CORNERS])
    found = lowest_by_simplex(counted, CORNERS, values, np.array([[-9.0, 9.0]] * 3), Enough(1e-6, 1e-9, most))
    assert len(taken) <= most + len(CORNERS) - 1, "only a simplex that shrinks is brought to its end"
    assert rosen(found) == min([*values, *(rosen(point) for point in taken)])


def test_what_is_refused_is_kept_off():
    """The lowest value lies at the edge of what is allowed; beyond it the values would be lower still."""

    def value(point):
        return point.sum() if (point >= 1).all() else np.inf

    corners = np.array([[3.0, 3.0], [2.5, 3.0], [3.0, 2.5]])
    found = lowest_by_simplex(value, corners, corners.sum(axis=1), np.array([[-9.0, 9.0]] * 2), Enough(1e-3, 1e-3, 200))
    assert found == pytest.approx([1, 1], abs=0.05)
