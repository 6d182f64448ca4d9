"""Filters of clouds against the plain loops that they stand for, and against shapes whose normals are known."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from scanwright.firmware_io.clouds.filters import normals, one_to_a_voxel, outliers

counts = st.integers(1, 60)


def points_of(seed, count, spread=1.0):
    return np.random.default_rng(seed).normal(0, spread, (count, 3)).astype(np.float32)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), count=counts, edge_m=st.sampled_from([0.2, 0.5, 3.0]))
def test_each_voxel_keeps_the_point_nearest_to_its_mean(seed, count, edge_m):
    points = points_of(seed, count)
    voxels = {}
    for index, point in enumerate(points.astype(float)):
        voxels.setdefault(tuple(np.floor(point / edge_m)), []).append(index)
    kept = one_to_a_voxel(points, edge_m)
    assert len(kept) == len(voxels) and (np.diff(kept) > 0).all()
    for members in voxels.values():
        (mine,) = set(members) & set(kept.tolist())
        off = np.linalg.norm(points[members].astype(float) - points[members].astype(float).mean(axis=0), axis=1)
        assert np.linalg.norm(points[mine] - points[members].astype(float).mean(axis=0)) <= off.min() + 1e-9


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), count=counts, sigmas=st.sampled_from([0.5, 1.0, 2.0]))
def test_outliers_are_those_of_the_definition(seed, count, sigmas):
    points = points_of(seed, count).astype(float)
    apart = np.sort(np.linalg.norm(points[:, None] - points[None], axis=2), axis=1)[:, 1:6]
    expected = np.zeros(count, bool)
    if count > 1:
        mean = apart.mean(axis=1)
        expected = mean > mean.mean() + sigmas * mean.std() + 1e-12
    found = outliers(points, sigmas, neighbours=5)
    np.testing.assert_array_equal(found & (count > 2), expected & (count > 2))  # of two both are as far


def test_a_stray_point_goes_and_a_wall_stays():
    wall = np.stack([*np.meshgrid(np.arange(30) * 0.05, np.arange(30) * 0.05), np.zeros((30, 30))], axis=2)
    points = np.vstack([wall.reshape(-1, 3), [[0.7, 0.7, 1.5]]])
    assert np.flatnonzero(outliers(points, 4.0)).tolist() == [900]


def test_normals_of_a_ball_point_to_who_stands_inside_or_outside():
    points = points_of(1, 4000)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    inside = normals(points, np.zeros(3))
    assert np.sum(inside * -points, axis=1).min() > 0.97
    far = points * np.float32(10)  # seen by one who walks around it
    outside = normals(points, far.astype(float))
    np.testing.assert_allclose(outside, -inside, atol=1e-6)
    assert np.isnan(normals(points[:2], np.zeros(3))).all()


def test_voxels_may_be_as_small_and_the_cloud_as_wide_as_you_like():
    points_m = np.array([[6.4e6, 0, 0], [6.4e6, 0, 1e-5], [0, 0, 0], [0, 0, 4e-7]])
    assert one_to_a_voxel(points_m, 1e-6).tolist() == [0, 1, 2]
