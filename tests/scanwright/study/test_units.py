"""Who does the work of a study: units that die, hang and fail, processes that are killed, and errors in one line."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from benchmarks.scanwright.study.invented import die, invented_judge, invented_search, invented_study
from benchmarks.scanwright.study.kills import TABLES, disturbed, site
from scanwright.design.errors import BuildError
from scanwright.design.progress import no_progress
from scanwright.study import workers
from scanwright.study.crossing import Crossing
from scanwright.study.results import Results, address, open_results, program
from scanwright.study.run import StudyRun
from scanwright.study.table import write_answer
from scanwright.study.units import Crew, Unit, do, finished
from scanwright.study.workers import crew_of

UNITS, SECONDS = 8, 0.1


def unit(name, function, *arguments):
    return Unit(address("test", name), function, arguments)


@pytest.mark.parametrize("over_dask", [False, True])
def test_killed_processes_change_nothing_and_are_told_in_one_line(tmp_path, over_dask):
    # the scheduler and its worker are started by Dask's own commands and talk over TCP
    kills = [("worker", 0.05), ("scheduler", 0.05)] if over_dask else [("client", 0.05)]
    starts, twice = disturbed(kills, UNITS, SECONDS, tmp_path, workers=int(over_dask))
    assert starts == 2 and twice <= len(kills)  # at most what was at work when it was killed
    told = (tmp_path / "client.log").read_text()
    if over_dask:  # of all clients, and nothing of Dask's
        assert told.count("\n") == 1
        # it is gone while its client works, or before a slow client has found it
        assert re.match(r"study: (the scheduler at |--scheduler = ')tcp://127\.0\.0\.1:", told)
        assert "run the study again" in told or "no scheduler answers there" in told
    assert "Traceback" not in told
    crossing = Crossing(invented_study(UNITS))
    alone = StudyRun(crossing, open_results(tmp_path / "alone" / "results"), invented_judge, invented_search)
    alone.work(Crew(ThreadPoolExecutor(1), lambda: 1), no_progress)
    write_answer(crossing.loaded.study, alone.rows(), tmp_path / "alone")
    for name in TABLES:
        assert (tmp_path / name).read_bytes() == (tmp_path / "alone" / name).read_bytes()


def runs(pid):
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


def until(what, most_s=60.0):
    end = time.monotonic() + most_s
    while not (found := what()):
        assert time.monotonic() < end
        time.sleep(0.05)
    return found


def test_a_killed_client_leaves_no_process_behind(tmp_path):
    with site(tmp_path, ["--units", "2", "--seconds", "60"], workers=0) as there:
        pids = until(there.worker_pids)
        there.client.kill()
        until(lambda: not any(map(runs, pids)))


def test_ctrl_c_ends_a_study_with_its_line(tmp_path, cheapest_task):
    (tmp_path / "ahead.toml").write_text(cheapest_task)
    periods = list(range(10, 40))  # so many that it is not over before Ctrl-C comes, however busy the computer is
    (tmp_path / "many.toml").write_text(
        f'name = "many"\ntasks = ["ahead.toml"]\nperiods_s = {periods}\nfront = ["J"]\nwinners = 0\n'
    )
    command = [sys.executable, "-m", "scanwright", "study", "many.toml", "--processes", "1"]
    with (tmp_path / "said").open("wb") as said:
        client = subprocess.Popen(command, cwd=tmp_path, stdout=said, stderr=said, start_new_session=True)
    children = Path(f"/proc/{client.pid}/task/{client.pid}/children")
    until(lambda: len(children.read_text().split()) > 1)  # a worker, and what multiprocessing keeps beside it
    os.killpg(client.pid, signal.SIGINT)  # as a terminal does, while the worker still loads
    assert client.wait(60) == 130
    *progress, last = (tmp_path / "said").read_text().splitlines()
    assert last == "note: stopped; run the same command to continue"
    assert all(line.startswith("  .. ") for line in progress)
    with pytest.raises(ProcessLookupError):
        until(lambda: os.killpg(client.pid, 0))


def test_units_that_raise_die_or_hang_cost_a_row_and_nothing_else(tmp_path):
    units = {f"good {i}": unit(f"good {i}", dict, {"status": "built", "i": i}) for i in range(8)}
    bad = {
        "raises": (unit("raises", int, "x"), "ValueError: invalid literal"),
        "killed": (unit("killed", die, 0.5), "every worker that tried died"),
        "hangs": (unit("hangs", time.sleep, 3600), "longer than time_limit_s = 1"),
    }
    results = open_results(tmp_path)
    asked = [*list(units.values())[:4], *(found for found, _ in bad.values()), *list(units.values())[4:]]
    with crew_of(None, 2) as crew:
        ended = {of.unit.address: of for of in finished(crew, asked, results, limit_s=1.0)}
        again = list(finished(crew, units.values(), results, limit_s=1.0))
    assert len(ended) == len(asked)
    for found, says in bad.values():
        assert says in ended[found.address].failure
        assert not results.has(found.address)
    for found in units.values():
        assert results.get(found.address) == ended[found.address].done.result
    assert all(of.done.seconds is None for of in again)  # looked up


class Broken(Executor):
    """Whose futures all end with one error."""

    def __init__(self, error):
        self.error = error

    def submit(self, *_):
        future = Future()
        future.set_exception(self.error)
        return future


def test_a_worker_of_another_version_or_without_us_is_refused(tmp_path):
    results = open_results(tmp_path)
    with pytest.raises(BuildError, match=r"worker has numpy .*, this computer 1\.0.*install the same versions"):
        do(unit("any", dict), results, program() | {"numpy": "1.0"}, 1.0)
    missing = Crew(Broken(ModuleNotFoundError("No module named 'design'")), lambda: 1)
    with pytest.raises(BuildError, match=r"lacks a package .*No module named 'design'"):
        list(finished(missing, [unit("any", dict)], results, 1.0))
    assert {"scanwright", "code", "python", "cadquery"} <= program().keys()


def test_a_worker_keeps_results_only_in_the_folder_of_its_client(tmp_path):
    results = open_results(tmp_path / "results")
    asked = unit("one", dict, {"status": "built"})
    done = do(asked, results, program(), 10.0)
    assert done.stored and done.seconds is not None
    assert results.get(asked.address) == {"status": "built"}
    assert do(asked, results, program(), 10.0).seconds is None  # looked up
    for elsewhere in (Results(results.folder, "another mark"), Results(tmp_path / "elsewhere", results.mark)):
        assert not do(asked, elsewhere, program(), 10.0).stored
    cut_off = results.folder / "cd" / f"{'cd' * 32}.json"
    cut_off.parent.mkdir()
    cut_off.write_text('{"status": "bu')  # by a file system that lost its end
    assert results.get("cd" * 32) is None


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "tcp://"])
def test_a_scheduler_that_is_not_there_gets_one_line(command, monkeypatch, tmp_path, address):
    monkeypatch.setattr(workers, "CONNECT_S", 0.3)
    code, _, complaint = command("study", "fleet", "--out", tmp_path, "--scheduler", address)
    assert code == 2
    assert len(complaint) == 1
    assert address in complaint[0]


def test_only_a_scheduler_needs_dask(command, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, _, complaint = command("study", "fleet", "--out", tmp_path, "--scheduler", "tcp://127.0.0.1:8786")
    assert code == 2
    assert len(complaint) == 1
    assert "pip install 'scanwright[cluster]'" in complaint[0]


def test_the_plan_says_what_is_left_to_do(command, tmp_path):
    code, printed, complaint = command("study", "fleet", "--plan", "--out", tmp_path / "none")
    assert (code, complaint) == (0, [])
    assert "36 candidates, 12 of them refused" in printed
    assert "9 different searches, 0 in the results folder" in printed
    assert "core-hours" in printed
    assert "GB of memory per worker" in printed
    _, as_json, _ = command("study", "fleet", "--plan", "--out", tmp_path / "none", "--json")
    assert json.loads(as_json)["lines"] == printed.splitlines()
    assert not (tmp_path / "none").exists()
