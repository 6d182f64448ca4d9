"""The list of slow tests names tests that are there, and whoever measures them counts what they need."""

import ast
from contextlib import suppress
from types import SimpleNamespace

import quick_tests
from imports import ROOT


def test_every_slow_test_is_one():
    named = quick_tests.slow_tests()
    there = set()
    for file in {name.partition("::")[0] for name in named}:
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        there |= {f"{file}::{node.name}" for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert named - there == set()


def test_what_is_not_listed_is_quick(monkeypatch, tmp_path):
    monkeypatch.setattr(quick_tests, "SLOW", tmp_path / "slow.txt")
    quick_tests.SLOW.write_text("a.py::test_slow\n")
    marked = []
    names = ["a.py::test_slow[1]", "a.py::test_slower", "b.py::test_slow"]
    quick_tests.mark(
        [SimpleNamespace(nodeid=name, add_marker=lambda _, name=name: marked.append(name)) for name in names]
    )
    assert marked == names[1:]


def test_a_test_costs_what_its_fixtures_cost_whoever_came_first(monkeypatch, tmp_path):
    monkeypatch.setattr(quick_tests, "SLOW", tmp_path / "slow.txt")
    now = [0.0]
    monkeypatch.setattr(quick_tests, "_taken", lambda: (0.0, now[0]))
    watch = quick_tests.Stopwatch(is_worker=False)

    def run(step, seconds, *words):
        running = step(*words)
        next(running)
        now[0] += seconds
        with suppress(StopIteration):
            running.send(None)

    run(watch.pytest_fixture_setup, 0.7, SimpleNamespace(scope="module", argname="made", baseid="a.py"))
    run(watch.pytest_fixture_setup, 0.2, SimpleNamespace(scope="function", argname="tmp_path", baseid=""))
    tests = {"a.py::first": ["made"], "a.py::second[x]": ["made"], "b.py::other": ["made"], "a.py::free": []}
    for nodeid, fixtures in tests.items():
        item = SimpleNamespace(nodeid=nodeid, fixturenames=fixtures, user_properties=[])
        run(watch.pytest_runtest_call, 0.4, item)
        watch.pytest_runtest_logreport(SimpleNamespace(when="call", **vars(item)))
    watch.pytest_sessionfinish()
    assert quick_tests.slow_tests() == {"a.py::first", "a.py::second"}


def test_a_sample_that_is_not_daily_waits_until_every_one_is_asked_for():
    seeds, pairs = quick_tests.samples(range(3), range(1)), quick_tests.samples([(1, 2), (3, 4)], [(3, 4)])
    assert seeds[0] == 0 and pairs[1] == (3, 4)
    assert [one.values for one in (*seeds[1:], pairs[0])] == [(1,), (2,), (1, 2)]
    marked = seeds[1].marks[0].name
    items = [SimpleNamespace(get_closest_marker=lambda name, has=has: has == name) for has in ("quick", marked)]
    told = []
    config = SimpleNamespace(hook=SimpleNamespace(pytest_deselected=lambda items: told.extend(items)))
    left = items.copy()
    quick_tests.leave_out_samples(config, left)
    assert (left, told) == (items[:1], items[1:])
