"""Progress of a build: shares of its steps, and the time left that they give."""

import pytest

from benchmarks.scanwright.build_steps import growth, times_left_s
from scanwright.pipeline.build_steps import measured_builds, share_done

SHARES = {"planes x axes": 0.1, "meshing and writing shaft": 0.5, "meshing and writing mount": 0.6, "report": 0.9}


def test_a_step_has_the_share_that_was_measured_whatever_its_numbers():
    assert share_done(SHARES, "343 planes x 1,261 axes") == 0.1
    assert share_done(SHARES, "343 planes x 1,261 axes", 0.25) == pytest.approx(0.2)
    assert share_done(SHARES, "report", 0.5) == pytest.approx(0.95)
    assert share_done(SHARES, "meshing and writing sleeve") == 0.5
    assert share_done(SHARES, "a check failed") is None


def test_the_time_left_of_the_measured_builds_never_grows_by_more_than_a_fifth():
    builds = measured_builds()
    assert len(builds) >= 3
    for task, begins in builds.items():
        lefts = times_left_s(begins)
        assert len(lefts) > 10 and growth(lefts) <= 0.2, task
    assert growth([(0.0, 10.0), (1.0, 8.0), (2.0, 12.0)]) == pytest.approx(0.5)
