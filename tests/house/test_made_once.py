"""What is dear is made once in a session, and costs every test the same."""

import fcntl
import multiprocessing
from pathlib import Path
from types import SimpleNamespace

import made_once
import pytest
from made_once import MadeOnce


def ask(folder, answers, barrier):
    """What a worker does: ask for a thing at the same time as another one."""

    def make(files):
        files.mkdir()
        (files / "part.txt").write_text("made")
        with (folder / "log.txt").open("a") as log:
            log.write("made\n")
        return {"files": files}

    barrier.wait()
    answers.put(MadeOnce(folder)("a build", make)["files"])


def test_workers_that_ask_at_once_have_it_made_once(tmp_path):
    fork = multiprocessing.get_context("fork")
    answers, barrier = fork.Queue(), fork.Barrier(3)
    workers = [fork.Process(target=ask, args=(tmp_path, answers, barrier)) for _ in range(3)]
    for worker in workers:
        worker.start()
    (files,) = {answers.get(timeout=60) for _ in workers}
    for worker in workers:
        worker.join()
    assert Path(files, "part.txt").read_text() == "made"
    assert (tmp_path / "log.txt").read_text() == "made\n"


def test_while_it_is_made_nobody_else_can(tmp_path):
    def make(files):
        with (files.parent / "lock").open("w") as lock, pytest.raises(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return "made"

    assert MadeOnce(tmp_path)("a", make) == "made"


def test_one_worker_gets_the_very_same_thing_and_another_name_another_one(tmp_path):
    once = MadeOnce(tmp_path)
    first = once("a", lambda _: [1])
    assert once("a", lambda _: [2]) is first
    assert once("b", lambda _: [2]) == [2]


def test_what_could_not_be_made_is_tried_again(tmp_path):
    once = MadeOnce(tmp_path)
    with pytest.raises(ZeroDivisionError):
        once("a", lambda _: 1 / 0)
    assert once("a", lambda _: 1) == 1


@pytest.mark.parametrize("who", ["the same worker", "another worker"])
def test_who_finds_it_made_has_it_on_the_bill(tmp_path, monkeypatch, who):
    now_s = [0.0]
    monkeypatch.setattr(made_once, "os", SimpleNamespace(times=lambda: (now_s[0], 0.0, 0.0, 0.0)))
    monkeypatch.setattr(made_once, "_spared_s", 0.0)

    def make(_):
        now_s[0] += 20.0
        return "made"

    once = MadeOnce(tmp_path)
    once("a", make)
    assert made_once.busy_s() == 20.0
    (once if who == "the same worker" else MadeOnce(tmp_path))("a", make)
    assert (now_s[0], made_once.busy_s()) == (20.0, 40.0)
