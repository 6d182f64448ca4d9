"""Turns cut from a stream: each point in one turn, however the stream comes and however its angles tremble."""

import numpy as np
from hypothesis import given, settings
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


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 999), missing=st.integers(0, 100))
def test_missing_turns_are_counted_although_the_speed_wanders_by_a_per_cent(seed, missing):
    """A pause of 100 turns is off by one turn if it is divided by the length of a single turn."""
    rng = np.random.default_rng(seed)
    begins = rng.uniform(-1.0, 1.0) + np.arange(202)  # of turns: the speed goes up and down within ten turns
    begins = begins + 0.01 * 10 / (2 * np.pi) * np.sin(2 * np.pi * begins / 10)
    number = np.arange(200 * 50)  # fifty points a turn, evenly in angle
    time_ns = (np.interp(number / 50, np.arange(202), begins) - begins[0]) * 1e8
    angle_deg = number % 50 * 7.2 + 3.6
    queue, line = TurnQueue(), ArrivalLine(smallest_delay_ns=0, rate_max=1e-4, grain_ns=0.0)
    before, after = number[: 80 * 50], number[(81 + missing) * 50 :]
    for part in [*np.array_split(before, 160), None, *np.array_split(after, 160)]:
        if part is None:
            queue.cut()
            continue
        none = np.zeros(part.size, np.float32)
        queue.add(Points(angle_deg[part], none, none, time_ns[part]), int(time_ns[part[-1]]))
        line.add(float(time_ns[part[-1]]), int(time_ns[part[-1]]))
    while queue.next(line) is not None:
        pass
    assert queue.dropped == missing + 3  # one is left out, and the turns at both ends of the pause are incomplete


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
