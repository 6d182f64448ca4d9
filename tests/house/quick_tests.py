"""Which tests are quick: all but those of `slow.txt`, which `pytest -n auto --measure-slow` writes from what it sees.

A test is slow if it takes more than a tenth of a second of processor, processes that it starts and all fixtures that
it needs included, or waits for more than a second. What is parametrised is slow if one of its cases is.
Samples are more cases of a law than a change needs: they run with `--every-sample`, as `benchmarks/promises.toml` asks.
"""

import time
from pathlib import Path

import pytest
from made_once import busy_s

SLOW = Path(__file__).parent / "slow.txt"
MOST_S, MOST_WAIT_S = 0.1, 1.0


def slow_tests():
    """Names of the tests that are slow, as `tests/house/test_rooms.py::test_no_class_stands_for_two_things`."""
    return set(SLOW.read_text(encoding="utf-8").split())


def name_of(nodeid):
    """The name of a test without the case that it is of."""
    return nodeid.partition("[")[0]


def mark(items):
    """Mark what is not known to be slow."""
    slow = slow_tests()
    for item in items:
        if name_of(item.nodeid) not in slow:
            item.add_marker(pytest.mark.quick)


def samples(every, daily):
    """Parameters of a test: `daily`, which differ in kind, always; the others only if every sample is asked for.

    A tuple holds the values of several parameters.
    """
    daily = list(daily)
    return [one if one in daily else _sample(*(one if isinstance(one, tuple) else (one,))) for one in every]


def _sample(*values):
    return pytest.param(*values, marks=pytest.mark.sample)


def leave_out_samples(config, items):
    """Take the samples that are not daily out of the tests."""
    config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("sample")])
    items[:] = [item for item in items if not item.get_closest_marker("sample")]


class Stopwatch:
    """What every test takes, by itself and in fixtures that others need too; the list of the slow ones at the end."""

    def __init__(self, is_worker):
        self.is_worker = is_worker
        self.shared = {}  # of each fixture that outlives a test
        self.own = 0.0
        self.slow = set()

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef):
        began = _taken()
        result = yield
        took = _cost(began)
        if fixturedef.scope == "function":
            self.own += took
        else:
            self.shared[fixturedef.argname, fixturedef.baseid] = took
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        began = _taken()
        try:
            return (yield)
        finally:
            needed = [cost for (name, place), cost in self.shared.items() if _is_used(item, name, place)]
            item.user_properties.append(("cost", self.own + _cost(began) + sum(needed)))
            self.own = 0.0

    def pytest_runtest_logreport(self, report):
        if report.when == "call" and dict(report.user_properties)["cost"] > 1:
            self.slow.add(name_of(report.nodeid))

    def pytest_sessionfinish(self):
        if not self.is_worker:
            SLOW.write_text("\n".join(sorted(self.slow)) + "\n", encoding="utf-8")


def _is_used(item, name, place):
    return name in item.fixturenames and item.nodeid.startswith(place)


def _taken():
    return busy_s(), time.monotonic()


def _cost(began):
    """What was taken since then, as a share of what a quick test may take."""
    worked, waited = (now - then for now, then in zip(_taken(), began, strict=True))
    return max(worked / MOST_S, waited / MOST_WAIT_S)
