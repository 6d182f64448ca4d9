"""Regions of many edges: directions stand for them; against sums over the cells and directions drawn by area."""

import numpy as np
import pytest
from random_fields import field, random_region, unit_vectors

from scanwright.design.sphere import directions
from scanwright.design.sphere.directions import weighted_samples
from scanwright.design.sphere.polar_rule import circle_rule, has_all_breaks

NODES = 243


def noise(rng, rows):
    """A map of noise, and the directions and weights of 36 parts of each of its cells."""
    table = rng.random((rows, 2 * rows))
    theta = np.pi * (np.arange(6 * rows) + 0.5) / (6 * rows)
    phi = np.pi * (np.arange(12 * rows) + 0.5) / (6 * rows)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    cells = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3)
    weights = (np.repeat(np.repeat(table, 6, axis=0), 6, axis=1) * np.sin(t)).ravel()
    return field([{"shape": "map", "file": "noise.npy"}], maps=[table]), cells, weights * (np.pi / (6 * rows)) ** 2


@pytest.mark.parametrize("seed", range(3))
def test_a_mean_over_a_fine_map_is_that_over_its_cells(seed):
    rng = np.random.default_rng(seed)
    f, cells, weights = noise(rng, int(rng.integers(45, 60)))
    assert not has_all_breaks(f)
    for axis in unit_vectors(rng, 2):
        rule = circle_rule(f, axis, rng.uniform(0, np.pi, 4), NODES)
        value = rule.fine @ np.cos(3 * rule.polar_rad) / rule.fine.sum()
        truth = weights @ np.cos(3 * np.arccos(np.clip(cells @ axis, -1, 1))) / weights.sum()
        coarse = rule.coarse @ np.cos(3 * rule.polar_rad) / rule.coarse.sum()
        assert value == pytest.approx(truth, abs=1e-3)
        assert rule.fine.sum() == pytest.approx(weights.sum(), rel=1e-3)
        assert coarse == pytest.approx(truth, abs=1e-2)


@pytest.mark.parametrize("seed", range(3))
def test_many_regions_that_overlap_are_looked_at_once(seed, monkeypatch):
    rng = np.random.default_rng(seed)
    f = field([random_region(rng, "band") for _ in range(40)])
    looks = []
    spread = directions._spread
    monkeypatch.setattr(directions, "_spread", lambda *args: looks.append(args[2]) or spread(*args))
    samples = weighted_samples(f, 4000)
    assert sum(looks) < 5 * 4000
    weights = f.weight_at(unit_vectors(rng, 40_000))
    error = 4 * weights.std() / len(weights) ** 0.5
    assert samples.weights.sum() / (4 * np.pi) == pytest.approx(weights.mean(), abs=error + 0.01 * weights.mean())
