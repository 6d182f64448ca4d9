"""Turns cut from a stream: each point in one turn, however the stream comes and however its angles tremble."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scanwright.firmware_io.lidar.arrival_line import ArrivalLine
from scanwright.firmware_io.lidar.turn import Points, TurnCutter, TurnQueue


def points(angle_deg, first=0):
    count = len(angle_deg)
    mark = np.arange(first, first + count, dtype=np.float32)
    return Points(np.asarray(angle_deg) % 360, mark, mark, np.arange(first, first + count) * 1e6)


@given(
    pieces=st.lists(st.integers(1, 40), min_size=1, max_size=20),
    start_deg=st.floats(0, 359),
    tremble_deg=st.floats(0, 2),
    seed=st.integers(0, 99),
)
def test_every_point_is_in_one_turn_and_only_what_is_not_whole_is_left_out(pieces, start_deg, tremble_deg, seed):
    tremble = np.random.default_rng(seed).uniform(-tremble_deg, tremble_deg, sum(pieces))
    angle_deg = start_deg + 17.3 * np.arange(sum(pieces)) + tremble
    cutter, turns, at = TurnCutter(), [], 0
    for size in pieces:
        turns += cutter.add(points(angle_deg[at : at + size], at))
        at += size
    numbers = np.concatenate([turn.range_m for turn in turns]) if turns else np.empty(0)
    assert np.all(np.diff(numbers) == 1)
    for turn in turns:
        assert 15 < turn.angle_deg.size < 27
        assert turn.angle_deg[0] < 17.3 + 4 and turn.angle_deg[-1] > 360 - 17.3 - 4
        assert np.abs(np.diff(turn.angle_deg) - 17.3).max() < 2 * tremble_deg + 1e-6
    assert len(turns) >= (angle_deg[-1] - angle_deg[0]) // 360 - 2


def test_turns_that_never_came_are_counted():
    queue, line = TurnQueue(), ArrivalLine(smallest_delay_ns=0, rate_max=1e-4, grain_ns=0.0)
    kept = [k for k in range(400) if not 120 <= k < 160]  # two turns of twenty
    for k in kept:
        queue.add(points([18.0 * k + 1], k), k)
        line.add(k * 1e6, k * 1_000_000)
    begins = []
    while (turn := queue.next(line)) is not None:
        begins.append(turn[0].range_m[0])
    assert begins[0] == 20 and queue.dropped == 2
