"""Processes beside this one: the same results and errors as without it, and nothing left running."""

import contextlib
import os
import signal
import threading
import time
from pathlib import Path

import pytest

from scanwright.design.angles import load_angles
from scanwright.design.concurrency import processes as beside
from scanwright.design.concurrency.processes import Packed, in_turn, sigint_deferred, worker_processes
from scanwright.design.errors import BuildError, TaskError


@pytest.mark.parametrize("cores", [1, 2])
def test_work_and_its_errors_are_the_same_with_one_core_and_two(cores, monkeypatch):
    monkeypatch.setattr(beside, "cores", lambda: cores)
    with worker_processes() as begin:
        where, joined, wrong = begin(os.getpid), begin("-".join, ["a", "b"]), begin(load_angles, Path("none.json"))
        assert (where() == os.getpid()) == (cores == 1)
        assert joined() == "a-b"
        with pytest.raises(TaskError, match=r"none\.json"):
            wrong()


def test_processes_come_from_one_mould_and_are_deaf_to_ctrl_c(monkeypatch):
    monkeypatch.setattr(beside, "cores", lambda: 2)
    with worker_processes(2) as begin:
        slow, moulds = begin(time.sleep, 0.1), [begin(os.getppid) for _ in range(2)]
        assert signal.SIGINT in begin(signal.pthread_sigmask, signal.SIG_BLOCK, ())()
        slow()
        assert moulds[0]() == moulds[1]() != os.getpid()


def test_what_is_packed_comes_out_as_a_copy():
    words = ["a"]
    assert Packed.of(words).open() == words
    assert Packed.of(words).open() is not words


def test_what_is_given_is_as_it_was_when_work_began():
    words = ["a"]
    later = in_turn(len, words)
    words.append("b")
    assert later() == 1


def test_ctrl_c_ends_it_at_once_and_its_death_is_told_in_one_line(monkeypatch, tmp_path):
    monkeypatch.setattr(beside, "cores", lambda: 2)
    began, at_work = time.monotonic(), tmp_path / "at_work"
    with contextlib.suppress(KeyboardInterrupt), worker_processes() as begin:
        process, mould = begin(os.getpid)(), begin(os.getppid)()
        begin(exec, f"import pathlib, time; pathlib.Path({str(at_work)!r}).touch(); time.sleep(900)")
        while not at_work.exists():  # a second, where the computer is not busy
            assert time.monotonic() - began < 300
            time.sleep(0.01)
        raise KeyboardInterrupt
    assert time.monotonic() - began < 600
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    with pytest.raises(BuildError, match="was killed"), worker_processes() as begin:
        assert begin(os.getppid)() != mould  # nor is that left, still loading, with the terminal in its hands
        begin(os._exit, 1)()


def test_ctrl_c_waits_for_the_end_of_the_block_by_whichever_thread_it_comes():
    go, done = threading.Event(), []

    def press():
        go.wait()
        signal.raise_signal(signal.SIGINT)

    other = threading.Thread(target=press)  # it was there before, and nothing is blocked in it
    other.start()
    with pytest.raises(KeyboardInterrupt), sigint_deferred():
        go.set()
        other.join()
        done.append("all")
    assert done == ["all"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
