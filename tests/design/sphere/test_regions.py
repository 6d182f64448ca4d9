"""Weights and masks against a slow obvious loop, and their circle means against dense sampling and closed forms."""

from math import acos, atan2, cos, degrees, hypot, pi, radians, sin, sqrt

import numpy as np
import pytest
from quick_tests import samples
from random_fields import field, random_case
from scipy.spatial.transform import Rotation

from scanwright.design.sphere.outline import reach_about


def slow_value(direction, regions, maps, background):
    """The definition, one direction at a time: paint in order, the last region that holds the direction wins."""
    x, y, z = direction
    theta, phi = degrees(atan2(hypot(x, y), z)), degrees(atan2(y, x))
    maps = list(maps)
    value = background
    for region in regions:
        if region["shape"] == "all":
            value = region["value"]
        elif region["shape"] == "cone":
            length = sqrt(sum(a * a for a in region["axis"]))
            along = sum(a * b for a, b in zip(region["axis"], direction, strict=True)) / length
            if degrees(acos(max(-1, min(1, along)))) <= region["half_angle_deg"]:
                value = region["value"]
        elif region["shape"] == "band":
            (t0, t1), (p0, p1) = region["theta_deg"], region["phi_deg"]
            if t0 <= theta <= t1 and any(p0 <= phi + turn <= p1 for turn in (-720, -360, 0, 360, 720)):
                value = region["value"]
        else:
            table = maps.pop(0)
            rows, columns = table.shape
            row = min(int(theta / 180 * rows), rows - 1)
            value = region["value"] * table[row, int(phi % 360 / 360 * columns) % columns]
    return value


@pytest.mark.parametrize("seed", samples(range(40), range(15)))
def test_weights_and_masks_agree_with_the_slow_obvious_loop(seed):
    weight, mask, maps, background = random_case(seed)
    f = field(weight, mask, maps, background)
    directions = np.random.default_rng(seed).normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    of_weights = maps[: sum(region["shape"] == "map" for region in weight)]
    of_masks = iter(maps[len(of_weights) :])
    each = [(region, [next(of_masks)] if region["shape"] == "map" else []) for region in mask]
    masked = [any(slow_value(d, [region], table, 0.0) > 0 for region, table in each) for d in directions]
    painted = [slow_value(d, weight, of_weights, background) for d in directions]
    np.testing.assert_array_equal(f.masked_at(directions), masked)
    np.testing.assert_array_equal(f.weight_at(directions), np.where(masked, 0.0, painted))


def direction(theta_deg, phi_deg):
    t, p = radians(theta_deg), radians(phi_deg)
    return np.array([[sin(t) * cos(p), sin(t) * sin(p), cos(t)]])


BAND = {"shape": "band", "theta_deg": [40, 75], "phi_deg": [-20, 35], "value": 2.0}


@pytest.mark.parametrize("phi_deg", [[-20, 35], [340, 395], [-380, -325]])
def test_the_edges_of_a_band_belong_to_it_and_phi_wraps(phi_deg):
    f = field([BAND | {"phi_deg": phi_deg}])
    for theta in (40, 60, 75):
        for phi in (-20, 0, 35, 340, 395):
            assert f.weight_at(direction(theta, phi)) == 2
    for theta, phi in [(40 - 1e-6, 0), (75 + 1e-6, 0), (60, -20 - 1e-6), (60, 35 + 1e-6), (60, 180), (120, 0)]:
        assert f.weight_at(direction(theta, phi)) == 0


def test_the_edge_of_a_cone_belongs_to_it():
    f = field([{"shape": "cone", "axis": [0, 0, 7], "half_angle_deg": 30}])
    assert f.weight_at(direction(30, 123)) == 1
    assert f.weight_at(direction(30 + 1e-6, 123)) == 0


def test_a_band_all_round_holds_the_poles_and_the_seam():
    """From any heading, also where `start + 360` is rounded up."""
    for start in [-180.0, 179.95, *np.random.default_rng(0).uniform(-180, 180, 20).tolist()]:
        f = field([{"shape": "band", "theta_deg": [0, 180], "phi_deg": [start, start + 360]}])
        for theta, phi in [(0, 0), (180, 0), (90, start), (90, start - 1e-9), (90, start + 180)]:
            assert f.weight_at(direction(theta, phi)) == 1


def test_the_last_region_wins_and_masks_win_over_all():
    big, small = {"shape": "all", "value": 3}, BAND | {"value": 0}
    assert field([big, small]).weight_at(direction(60, 0)) == 0
    assert field([small, big]).weight_at(direction(60, 0)) == 3
    hidden = field([big, small | {"value": 9}], mask=[BAND])
    assert hidden.masked_at(direction(60, 0))
    assert hidden.weight_at(direction(60, 0)) == 0
    assert hidden.weight_at(direction(60, 60)) == 3
    assert field([], background=0.5).weight_at(direction(60, 0)) == 0.5


def circle(axis, polar, count):
    """Points at equal steps along the circle at `polar` about `axis`."""
    p = 2 * pi * (np.arange(count) + 0.5) / count
    about_z = np.stack([sin(polar) * np.cos(p), sin(polar) * np.sin(p), np.full(count, cos(polar))], axis=1)
    return Rotation.align_vectors([axis], [[0, 0, 1]])[0].apply(about_z)


@pytest.mark.filterwarnings("ignore:Optimal rotation is not uniquely")
@pytest.mark.parametrize("seed", samples(range(40), range(12)))
def test_circle_means_agree_with_dense_sampling(seed):
    """Dense sampling errs by at most one step per jump; a circle jumps at most twice per edge plane."""
    weight, mask, maps, background = random_case(100 + seed)
    f = field(weight, mask, maps, background)
    rng = np.random.default_rng(seed)
    random_axis = rng.normal(size=3)
    axis = [random_axis / np.linalg.norm(random_axis), np.eye(3)[2], -np.eye(3)[2], np.eye(3)[0]][seed % 4]
    polar = np.concatenate([[1e-7, pi - 1e-7], rng.uniform(0, pi, 5)])
    means, shares = f.on_circles(axis, polar)
    both = np.array([axis, -axis])
    np.testing.assert_allclose(
        f.on_circles_about(both, polar, reach_about(f, both)), [means, f.on_circles(-axis, polar)[0]]
    )
    count = 20_000
    jump = max([background, *(r["value"] * 3 for r in weight)])
    for t, mean, share in zip(polar, means, shares, strict=True):
        points = circle(axis, t, count)
        assert mean == pytest.approx(f.weight_at(points).mean(), abs=2 * f.edges * jump / count + 1e-9)
        assert share == pytest.approx(1 - f.masked_at(points).mean(), abs=2 * f.edges / count + 1e-9)


def total(f, axis, circles=100_000):
    """`int w dO / 4 pi` and the unmasked share by circles about one axis: midpoints in z, error about circles**-1.5."""
    z = 1 - 2 * (np.arange(circles) + 0.5) / circles
    means, shares = f.on_circles(np.array(axis) / np.linalg.norm(axis), np.arccos(z))
    return means.mean(), shares.mean()


@pytest.mark.parametrize("seed", samples(range(6), range(3)))
def test_the_total_weight_does_not_depend_on_the_axis_of_the_circles(seed):
    f = field(*random_case(200 + seed))
    rng = np.random.default_rng(seed)
    one, other = (total(f, rng.normal(size=3)) for _ in range(2))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-6)


@pytest.mark.parametrize("axis", [[0.3, -0.5, 0.8], [1, 0.1, 0], [-0.2, 0.9, -0.1]])
def test_the_total_weight_of_a_band_and_of_a_cone_is_their_solid_angle(axis):
    band = (cos(radians(40)) - cos(radians(75))) * radians(55) / (4 * pi)
    assert total(field([BAND]), axis)[0] == pytest.approx(2 * band, abs=1e-6)
    for half in (0.5, 33, 90, 150, 180):
        cone = (1 - cos(radians(half))) / 2
        region = {"shape": "cone", "axis": [1, -2, 0.5], "half_angle_deg": half}
        assert total(field([region]), axis)[0] == pytest.approx(cone, abs=1e-6)
        assert total(field([], mask=[region]), axis)[1] == pytest.approx(1 - cone, abs=1e-6)


def test_the_total_weight_of_a_map_is_the_sum_over_its_cells():
    table = np.random.default_rng(3).random((7, 12))
    f = field([{"shape": "map", "file": "unused.npy", "value": 2.5}], maps=[table])
    edges = np.cos(np.linspace(0, pi, 8))
    cells = (edges[:-1] - edges[1:])[:, None] / 24
    assert total(f, [0.3, -0.5, 0.8])[0] == pytest.approx(2.5 * (table * cells).sum(), abs=1e-6)


def test_only_edges_between_cells_that_differ_are_looked_at():
    """A map of one bright patch has the four edges of it, and its means along circles stay those of all its cells."""
    table = np.zeros((18, 36))
    table[4:9, 10:16] = 2.0
    f = field([{"shape": "map", "file": "m.png"}], maps=[table])
    assert len(f.map_planes) == 4
    axis = np.array([0.6, 0.0, 0.8])
    polar = np.radians([20.0, 70.0, 110.0])
    seen = [f.weight_at(circle(axis, t, 100_000)).mean() for t in polar]
    assert f.on_circles(axis, polar)[0] == pytest.approx(seen, abs=1e-4)
