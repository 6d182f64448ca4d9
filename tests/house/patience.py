"""Waiting for threads, processes and emulators, which run in real time: the one clock that no test can turn forward."""

import time

BOUND_S = 300.0  # what is waited for takes seconds, a process that starts up to twenty: more than ten times that


def until(condition, seconds=BOUND_S):
    """Wait for something to be so."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not come to that in time"
        time.sleep(0.005)
