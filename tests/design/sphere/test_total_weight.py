"""The integral of a weight: by circles about any axis, by directions drawn by area, and by the order of its masks."""

from itertools import permutations

import numpy as np
import pytest
from quick_tests import samples
from random_fields import field, random_field, unit_vectors, walls

from scanwright.design.errors import NumericalError, TaskError
from scanwright.design.sphere import polar_rule
from scanwright.design.sphere.polar_rule import circle_rule
from scanwright.design.sphere.total_weight import total_weight

NODES = 2187
NO_BREAKS = np.empty(0)


@pytest.mark.parametrize("seed", samples(range(60), range(12)))
def test_the_weight_about_any_axis_sums_to_its_integral(seed):
    f = random_field(seed)
    total = total_weight(f)
    for axis in unit_vectors(np.random.default_rng(seed), 4):
        assert circle_rule(f, axis, NO_BREAKS, NODES).fine.sum() == pytest.approx(total, rel=2e-3)


@pytest.mark.parametrize("seed", samples(range(16), range(4)))
def test_the_integral_is_the_mean_over_directions_drawn_by_area(seed):
    f = random_field(seed)
    weights = f.weight_at(unit_vectors(np.random.default_rng(seed), 200_000))
    error = 4 * weights.std() / len(weights) ** 0.5
    assert total_weight(f) / (4 * np.pi) == pytest.approx(weights.mean(), abs=error)


def test_a_rule_that_loses_weight_is_an_error(monkeypatch):
    f = field(walls(np.random.default_rng(1), 2))
    whole = polar_rule.weighted_segments

    def without_the_widest(*args):
        segments = whole(*args)
        return np.delete(segments, np.ptp(segments, axis=1).argmax(), axis=0)

    monkeypatch.setattr(polar_rule, "weighted_segments", without_the_widest)
    with pytest.raises(NumericalError, match="please report"):
        circle_rule(f, np.array([0.6, 0.0, 0.8]), NO_BREAKS, NODES)


def test_a_ring_that_is_too_thin_is_refused_with_its_width():
    """A mask leaves a ring of 1e-5 deg, less than what is looked at on both sides of an edge."""
    cone = {"shape": "cone", "axis": [1.0, 0.3, 0.2], "half_angle_deg": 10.0}
    f = field([cone], [cone | {"half_angle_deg": 10.0 - 1e-5}])
    with pytest.raises(TaskError, match="thinner than 2e-05 deg") as refused:
        circle_rule(f, np.array([0.866, 0.433, 0.25]), NO_BREAKS, NODES)
    assert not isinstance(refused.value, NumericalError)


@pytest.mark.parametrize("seed", samples(range(20), range(5)))
def test_masks_unite_in_any_order(seed):
    """Separate masks in each order, and all of them as one table: the same directions are hidden."""
    rng = np.random.default_rng(seed)
    tables = [np.isin(rng.integers(0, 4, (6, 12)), [0]).astype(float) for _ in range(2)]
    cone = {"shape": "cone", "axis": rng.normal(size=3).tolist(), "half_angle_deg": rng.uniform(5, 90)}
    low, high = np.sort(rng.uniform(0, 180, 2))
    band = {"shape": "band", "theta_deg": [low, high], "phi_deg": [-30, 200]}
    masks = [({"shape": "map", "file": "a.npy"}, [t]) for t in tables] + [(cone, []), (band, [])]
    directions = unit_vectors(rng, 2000)
    alone = [field([], [mask], maps).masked_at(directions) for mask, maps in masks]
    for order in permutations(masks):
        united = field([], [mask for mask, _ in order], [t for _, maps in order for t in maps])
        np.testing.assert_array_equal(united.masked_at(directions), np.any(alone, axis=0))
    merged = field([], [masks[0][0]], [np.maximum(*tables)])
    np.testing.assert_array_equal(merged.masked_at(directions), alone[0] | alone[1])


@pytest.mark.parametrize("seed", range(3))
def test_a_ring_of_a_thousandth_of_a_degree_is_seen_about_any_axis(seed):
    rng = np.random.default_rng(seed)
    cone = {"shape": "cone", "axis": unit_vectors(rng, 1)[0].tolist(), "half_angle_deg": rng.uniform(10, 80)}
    f = field([cone], [cone | {"half_angle_deg": cone["half_angle_deg"] - 0.001}])
    for axis in np.vstack([unit_vectors(rng, 2), cone["axis"]]):
        assert circle_rule(f, axis, NO_BREAKS, 243).fine.sum() == pytest.approx(total_weight(f), rel=2e-3)
