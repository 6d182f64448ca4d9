"""What moved goes and what stands stays: a person who walks through a simulated room, and laws of looking through."""

import numpy as np
import pytest

from benchmarks.firmware_io.mapping.walking_person import Session, shares
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.mapping.seen_through import Stand, seen_through

PLACES = ((0.0, 0.0, 0.0), (0.8, 0.5, 0.05), (-0.6, 0.3, 0.0), (0.2, -0.6, 0.0), (1.2, -0.2, 0.0))


def test_a_person_who_walks_goes_and_the_room_stays():
    stands, his = Session("UTM-30LX", (0.0, -50.0, 35.0), 4.0, PLACES, 0.01, every=3).stands()
    assert sum(int(one.sum()) for one in his) > 3000
    moved, still = shares(seen_through(stands), his)
    assert moved > 0.95
    assert still < 0.001


def wall(x=4.0, step=0.05):
    """A wall across the x axis, shape (n, 3)."""
    y, z = np.meshgrid(np.arange(-2, 2, step), np.arange(-1, 1, step))
    return np.stack([np.full(y.size, x), y.ravel(), z.ravel()], axis=1)


def ball(centre, radius=0.3, count=300):
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    return centre + radius * np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1)


def test_only_who_was_seen_through_by_more_than_the_bound_goes():
    empty = Stand(wall(), np.zeros(3))
    for gap, goes in {0.5: True, 0.11: True, 0.09: False, 0.0: False, -0.5: False}.items():
        # a plate before the wall, on it, or behind it, where nobody could see it
        plate = wall(4.0 - gap, 0.02)
        plate = plate[(np.abs(plate[:, 1:]) < 0.3).all(axis=1)]
        first, second = seen_through([Stand(plate, np.array([0.2, 0.1, 0.0])), empty], 0.1)
        assert first.all() == first.any() == goes, gap
        assert second.any() == (gap < -0.1)  # no wall stood there when the plate behind it was seen


def test_where_nobody_looked_nothing_goes():
    person = ball([2.0, 0.0, 0.0])
    aside = Stand(wall()[:800] * [-1, 1, 1], np.zeros(3))  # saw the other way
    unknown = Stand(wall(), np.full(3, np.nan))
    few = Stand(wall()[:5], np.zeros(3))
    gone = seen_through([Stand(person, np.zeros(3)), aside, unknown, few])
    assert not np.concatenate(gone).any()
    at_the_eye = Stand(np.vstack([np.zeros(3), person]), np.zeros(3))
    assert seen_through([at_the_eye, Stand(wall(), np.zeros(3))])[0].tolist() == [False, *[True] * len(person)]


def test_the_order_and_the_frame_do_not_matter():
    rng = np.random.default_rng(3)
    stands = [
        Stand(np.vstack([wall(), ball(at)]) + rng.normal(0, 0.01, (len(wall()) + 300, 3)), np.array(eye))
        for at, eye in [([2, 0, 0], [0, 0, 0.1]), ([3.2, 0.8, 0], [0.3, 0.1, 0]), ([3, -0.8, 0.2], [0, -0.2, 0])]
    ]
    gone = seen_through(stands)
    assert [int(one[: len(wall())].sum()) for one in gone] == [0, 0, 0]
    assert all(one[len(wall()) :].all() for one in gone)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    moved = [Stand(stand.points_m @ R.T + 7.0, R @ stand.eye_m + 7.0) for stand in stands]
    for one, other in zip(gone, seen_through(moved[::-1])[::-1], strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("beyond_m", [0.0, -1.0, np.inf, np.nan])
def test_a_bound_that_is_none_is_refused(beyond_m):
    with pytest.raises(RecordingError, match=rf"seen_through_m = {beyond_m}: must be above 0"):
        seen_through([Stand(wall(), np.zeros(3))] * 2, beyond_m)


def test_one_cloud_tells_nothing_of_what_moved():
    with pytest.raises(RecordingError, match="1 clouds with a known scanner position, minimum 2"):
        seen_through([Stand(wall(), np.zeros(3)), Stand(wall(), np.full(3, np.nan))])
