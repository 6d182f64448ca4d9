"""Studies on a cluster: units that die, hang and fail, processes that are killed, and errors in one line."""

import time
from types import SimpleNamespace

import pytest

from benchmarks.scanwright.study.invented import die, invented_judge, invented_search, invented_study
from benchmarks.scanwright.study.kills import disturbed
from design.errors import BuildError
from scanwright.study import session as sessions
from scanwright.study.answer.write import write_answer
from scanwright.study.crossing import Crossing
from scanwright.study.runner import cluster as clusters
from scanwright.study.runner.cluster import _compare, cluster
from scanwright.study.runner.engine import Finished, run
from scanwright.study.runner.identity import address, identity, tools
from scanwright.study.runner.store import open_store
from scanwright.study.runner.work import Unit
from scanwright.study.session import Session

UNITS, SECONDS = 12, 0.1


def unit(name, function, *arguments):
    return Unit(address("test", name), name, function, arguments)


def one_after_the_other(_client, units, store, _limit_s, _ticked):
    """The engine without a cluster."""
    for asked in units:
        result = asked.function(*asked.arguments)
        store.put(asked.address, result)
        yield Finished(asked, result, "", 0.0, 0.0)


def tables(folder):
    return [(folder / name).read_bytes() for name in ("study.csv", "study.parquet")]


def test_killed_processes_change_nothing_and_are_told_in_one_line(tmp_path, monkeypatch):
    # a worker and the scheduler are started by Dask's own commands and talk over TCP
    kills = [("worker", 0.05), ("scheduler", 0.05), ("client", 0.05)]
    starts, twice = disturbed(kills, UNITS, SECONDS, tmp_path, workers=1)
    assert (starts, twice) == (3, 0)
    (told,) = (tmp_path / "client.log").read_text().splitlines()  # of three clients, and nothing of Dask's
    assert told.startswith("study: the scheduler at tcp://127.0.0.1:") and "run the study again" in told
    monkeypatch.setattr(sessions, "run", one_after_the_other)
    alone = Session(Crossing(invented_study(UNITS)), open_store(tmp_path / "alone"), invented_judge, invented_search)
    alone.run(None, lambda _: None)
    write_answer(alone, tmp_path / "alone")
    assert tables(tmp_path) == tables(tmp_path / "alone")


def test_units_that_raise_die_or_hang_cost_a_row_and_nothing_else(tmp_path):
    import dask
    import distributed  # noqa: F401  its defaults come first: what is set before them is taken away with them

    units = [unit(f"good {i}", dict, {"status": "built", "i": i}) for i in range(8)]
    bad = {
        "raises": (unit("raises", int, "x"), "ValueError: invalid literal"),
        "killed": (unit("killed", die, 0.5), "every worker that tried died"),
        "hangs": (unit("hangs", time.sleep, 3600), "longer than time_limit_s = 2"),
    }
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}), cluster(None, 2) as client:
        store = open_store(tmp_path)
        asked = [*units[:4], *(found for found, _ in bad.values()), *units[4:], units[0]]
        ended = list(run(client, asked, store, limit_s=2.0))
    failures = {done.unit.name: done.failure for done in ended if done.failure}
    assert failures.keys() == {found.name for found, _ in bad.values()}
    for found, says in bad.values():
        assert says in failures[found.name]
        assert not store.has(found.address)
    good = [done for done in ended if not done.failure]
    assert len(good) == 9
    assert all(store.get(done.unit.address) == done.result for done in good)
    assert sum(done.seconds is not None for done in good) <= 8  # the same record again was not computed again


def test_a_worker_of_another_version_or_without_us_is_refused():
    def workers(found):
        return SimpleNamespace(run=lambda *_, **__: {"tcp://a": tools(), "tcp://b": found})

    _compare(workers(tools()))
    with pytest.raises(BuildError, match=r"tcp://b has numpy 1\.0, this computer .* install the same versions"):
        _compare(workers(tools() | {"numpy": "1.0"}))
    with pytest.raises(BuildError, match=r"tcp://b cannot take part .*No module named 'design'"):
        _compare(workers(ModuleNotFoundError("No module named 'design'")))
    assert {"scanwright", "code", "python", "cadquery"} <= identity().keys()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "tcp://"])
def test_a_scheduler_that_is_not_there_gets_one_line(command, monkeypatch, tmp_path, address):
    monkeypatch.setattr(clusters, "CONNECT_S", 0.3)
    code, _, complaint = command("study", "fleet", "--out", tmp_path, "--scheduler", address)
    assert code == 2
    assert len(complaint) == 1
    assert address in complaint[0]


def test_the_plan_says_what_is_left_to_do(command, tmp_path):
    code, printed, complaint = command("study", "fleet", "--plan", "--out", tmp_path / "none")
    assert (code, complaint) == (0, [])
    assert "36 candidates, 12 of them refused" in printed
    assert "9 different searches, 0 in the results folder" in printed
    assert "core-hours" in printed
    assert "GB of memory per worker" in printed
    assert not (tmp_path / "none").exists()
