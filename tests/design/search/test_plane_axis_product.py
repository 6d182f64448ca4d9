"""The lowest of all products, tile by tile, against all of them at once."""

import numpy as np
import pytest

from scanwright.design.objective.named_objectives import Moment, Objective
from scanwright.design.search.constraints import AtMost, NoHole
from scanwright.design.search.plane_axis_product import PART, PIECE, both_orientations, lowest

PLANES, AXES, NODES = PIECE + 37, PART + 211, 7


@pytest.fixture(scope="module")
def sides():
    """Random g, weights and fans, and which classes the grid holds either way round."""
    rng = np.random.default_rng(5)
    g, weights = rng.random((PLANES, NODES)), rng.random((AXES, NODES))
    weights[PART:] *= 0.6  # so that some of the lowest are in the last tile
    has_plane, has_axis = (rng.random((2, count)) < 0.8 for count in (PLANES, AXES))
    fan, region = (np.sort(rng.uniform(0, np.pi, (count, 2)), axis=1) for count in (PLANES, AXES))
    region = region.mean(axis=1, keepdims=True) + 0.1 * (region - region.mean(axis=1, keepdims=True))
    return g, weights, has_plane, has_axis, NoHole(fan, region), AtMost(g, weights, 1.5, turns=True)


def test_the_lowest_of_every_plane_and_axis(sides):
    g, weights, has_plane, has_axis, hole, most = sides
    moment = Moment(None, np.asarray)
    objective = Objective("none", None, (moment,), lambda moments: np.asarray(moments[0]))
    plain, kept = lowest(objective, [both_orientations(moment, g, weights)], has_plane, has_axis, [hole, most])
    straight, turned = g @ weights.T, g[:, ::-1] @ weights.T
    in_hole = (
        (hole.fan_rad[:, 0, None] > hole.region_rad[:, 0]) | (hole.fan_rad[:, 1, None] < hole.region_rad[:, 1]),
        (np.pi - hole.fan_rad[:, 1, None] > hole.region_rad[:, 0])
        | (np.pi - hole.fan_rad[:, 0, None] < hole.region_rad[:, 1]),
    )
    for found, kept_only in ((plain, False), (kept, True)):
        every = np.full((2, 2, PLANES, AXES), np.inf)  # flip of the plane, flip of the axis
        for plane_flip in (0, 1):
            for axis_flip in (0, 1):
                way = plane_flip ^ axis_flip  # both flipped come the same way round as neither
                J = (straight, turned)[way]
                open_ = has_plane[plane_flip][:, None] & has_axis[axis_flip][None]
                if kept_only:
                    open_ &= ~in_hole[way] & (J <= most.most)
                every[plane_flip, axis_flip] = np.where(open_, J, np.inf)
        np.testing.assert_allclose(found.by_plane, every.min(axis=(1, 3)), rtol=1e-5)
        np.testing.assert_allclose(found.by_axis, every.min(axis=(0, 2)), rtol=1e-5)
        flip, plane = np.nonzero(np.isfinite(found.by_plane))
        its = every[flip, found.its_flip[flip, plane], plane, found.its_class[flip, plane]]
        np.testing.assert_allclose(its, found.by_plane[flip, plane], rtol=1e-5)
        assert np.isfinite(found.by_plane).mean() > 0.5 and found.its_class.max() >= PART
