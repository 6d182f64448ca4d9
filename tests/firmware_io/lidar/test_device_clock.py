"""The sensor's clock on the host's, against the true time of simulated sensors: late packets, wraps, restarts."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanwright.design.errors import DeviceError
from scanwright.firmware_io.lidar.arrival_line import QUARTZ_RATE, ArrivalLine
from scanwright.firmware_io.lidar.device_clock import (
    TICK_NS,
    DeviceClock,
    Exchange,
    StampCounter,
    TimeSync,
    synchronised,
)
from scanwright.firmware_io.lidar.tick_line import StampLine

DELAY_NS = 21_000_000


def sensor(seconds, period_ms, *, ppm=50.0, late_ms=20.0, spread="even", seed=0, begin_ms=1234.567):
    """True starts of the turns [ns], stamps, arrivals [ns] of a sensor whose clock runs `ppm` fast."""
    rng = np.random.default_rng(seed)
    count = int(seconds * 1000 / period_ms)
    shown_ms = begin_ms + period_ms * np.arange(count)
    true_ns = np.int64(7e15) + np.rint((shown_ms - begin_ms) / (1 + ppm * 1e-6) * 1e6).astype(np.int64)
    late = {"even": rng.uniform(0, late_ms, count), "tail": rng.exponential(late_ms, count)}[spread]
    arrival_ns = np.maximum.accumulate(true_ns + DELAY_NS + np.rint(late * 1e6).astype(np.int64))
    return true_ns, np.floor(shown_ms).astype(np.int64), arrival_ns


def host_times(clock, stamp_ms, arrival_ns):
    """Host times of the first beams and their uncertainty [ns], as a stream of scans gets them."""
    moments = [clock.update(ms, ns) for ms, ns in zip(stamp_ms.tolist(), arrival_ns.tolist(), strict=True)]
    return np.array([(moment.time_ns, moment.uncertainty_ns) for moment in moments]).T


def errors_ms(clock, true_ns, stamp_ms, arrival_ns):
    time_ns, uncertainty_ns = host_times(clock, stamp_ms, arrival_ns)
    return (time_ns - true_ns) / 1e6, uncertainty_ns / 1e6


def settled(true_ns, seconds=10):
    return true_ns - true_ns[0] > seconds * 1e9


# A ten-hertz sensor gives 100 packets in 10 s: its rate is known later.
@pytest.mark.parametrize(("period_ms", "after_s"), [(25.05, 10), (100.2, 30)])
def test_twenty_minutes_with_packets_up_to_20_ms_late(period_ms, after_s):
    true_ns, stamp_ms, arrival_ns = sensor(1200, period_ms)
    clock = DeviceClock(round(period_ms / 1e3, 2 if after_s > 10 else 3), smallest_delay_ns=DELAY_NS)
    error_ms, uncertainty_ms = errors_ms(clock, true_ns, stamp_ms, arrival_ns)
    late = settled(true_ns, after_s)
    assert np.median(np.abs(error_ms[late])) < 0.2
    assert np.abs(error_ms[late]).max() < 1.0
    assert np.mean(np.abs(error_ms[late]) < 2 * uncertainty_ms[late]) > 0.95


@pytest.mark.parametrize("spread", ["even", "tail"])
@pytest.mark.parametrize("ppm", [-120.0, 0.0, 120.0])
def test_other_quartzes_and_other_spreads(spread, ppm):
    true_ns, stamp_ms, arrival_ns = sensor(120, 25.05, ppm=ppm, spread=spread, seed=3)
    error_ms, _ = errors_ms(DeviceClock(0.025, smallest_delay_ns=DELAY_NS), true_ns, stamp_ms, arrival_ns)
    late = settled(true_ns)
    assert np.median(np.abs(error_ms[late])) < 0.2
    assert np.abs(error_ms[late]).max() < 1.0


def test_fine_stamps_are_taken_as_they_are_where_turns_are_uneven():
    rng = np.random.default_rng(4)
    shown_ms = 77.0 + np.cumsum(20 + rng.uniform(-1.0, 1.0, 6000))  # no line passes near such turns
    true_ns = np.int64(7e15) + np.rint((shown_ms - shown_ms[0]) / (1 + 50e-6) * 1e6).astype(np.int64)
    arrival_ns = np.maximum.accumulate(true_ns + np.rint(rng.uniform(0, 5e6, true_ns.size)).astype(np.int64))
    line = ArrivalLine(smallest_delay_ns=0, rate_max=QUARTZ_RATE, grain_ns=TICK_NS, spacing_ns=2e7)
    moments = []
    for sensor_ns, came_ns in zip((np.floor(shown_ms * 1e3) * 1e3).tolist(), arrival_ns.tolist(), strict=True):
        line.add(sensor_ns, came_ns)
        moments.append((line.host_ns(sensor_ns), line.uncertainty_ns))
    time_ns, uncertainty_ns = np.array(moments).T
    error_ns, late = time_ns - true_ns, settled(true_ns)
    assert np.abs(error_ns[late]).max() < 200_000
    assert np.mean(np.abs(error_ns[late]) < 2 * uncertainty_ns[late]) > 0.95


@pytest.mark.parametrize("beat", [0.0, 5e-6, 2e-5, 1e-4, 4e-4])  # a tick in 200, 50, 10 and 2.5 s
def test_a_slow_beat_of_turns_and_ticks_is_seen_through(beat):
    true_ns, stamp_ms, arrival_ns = sensor(240, 25.0 * (1 + beat), seed=4)
    error_ms, _ = errors_ms(DeviceClock(0.025, smallest_delay_ns=DELAY_NS), true_ns, stamp_ms, arrival_ns)
    late = settled(true_ns)
    assert np.median(np.abs(error_ms[late])) < 0.1
    assert np.abs(error_ms[late]).max() < 1.0


def wandering(period_ms, amplitude, wave_s, jitter_ms=0.0):
    """Beginnings of turns [ms] of a motor that is up to `amplitude` fast or slow, in waves, and their stamps."""
    wave = np.sin(2 * np.pi * np.arange(4000) * period_ms / 1e3 / wave_s)
    shown_ms = 77.3 + np.cumsum(period_ms * (1 + amplitude * wave))
    jitter = np.random.default_rng(1).uniform(0, jitter_ms, shown_ms.size)
    return shown_ms, np.floor(shown_ms + jitter)


@pytest.mark.parametrize(
    ("amplitude", "wave_s", "jitter_ms", "bound_ms"),
    # an even motor, one that wanders, one that is broken, a sensor that reads its own clock late
    [(0.0, 1, 0, 0.01), (1e-5, 60, 0, 0.15), (1e-4, 20, 0, 0.4), (1e-2, 30, 0, 1.5), (0.0, 1, 1.0, 0.7)],
)
def test_beginnings_of_turns_are_found_between_the_ticks(amplitude, wave_s, jitter_ms, bound_ms):
    true_ms, stamp_ms = wandering(25.05, amplitude, wave_s, jitter_ms)
    line, off_ms = StampLine(25.0), []
    for true, stamp in zip(true_ms, stamp_ms, strict=True):
        off_ms.append(line.time_ms(line.add(stamp)) - true)
    off_ms = np.array(off_ms[400:])
    assert np.abs(off_ms - off_ms.mean()).max() < bound_ms  # a constant part is the offset's


def test_turns_are_counted_over_lost_scans():
    _, stamp_ms = wandering(25.05, 1e-4, 20)
    line, kept = StampLine(25.0), np.random.default_rng(2).random(stamp_ms.size) > 0.3
    kept[1000:1400] = False
    turns = [line.add(stamp) for stamp in stamp_ms[kept]]
    np.testing.assert_array_equal(np.array(turns) - turns[-1], np.flatnonzero(kept) - np.flatnonzero(kept)[-1])


def test_a_rate_that_wanders_is_followed():
    true_ns, stamp_ms, arrival_ns = sensor(300, 25.05, seed=6)
    bend_ns = np.rint(0.02e-6 * (np.arange(true_ns.size) * 0.025) ** 2 / 2 * 1e9).astype(np.int64)  # 6 ppm in 5 min
    error_ms, _ = errors_ms(
        DeviceClock(0.025, smallest_delay_ns=DELAY_NS), true_ns + bend_ns, stamp_ms, arrival_ns + bend_ns
    )
    assert np.median(np.abs(error_ms[settled(true_ns)])) < 0.2


def test_lost_scans_and_a_stalled_host_change_nothing():
    true_ns, stamp_ms, arrival_ns = sensor(120, 25.05, seed=7)
    stall = (true_ns - true_ns[0] > 60e9) & (true_ns - true_ns[0] < 63e9)
    arrival_ns = np.where(stall, np.maximum(arrival_ns, true_ns[0] + 63 * 10**9), arrival_ns)
    arrival_ns = np.maximum.accumulate(arrival_ns)
    kept = np.random.default_rng(8).random(true_ns.size) > 0.2
    kept[true_ns.size // 4 : true_ns.size // 3] = False
    error_ms, _ = errors_ms(
        DeviceClock(0.025, smallest_delay_ns=DELAY_NS), true_ns[kept], stamp_ms[kept], arrival_ns[kept]
    )
    late = settled(true_ns[kept])
    assert np.median(np.abs(error_ms[late])) < 0.2
    assert np.abs(error_ms[late]).max() < 1.0


def test_a_time_synchronisation_holds_the_first_seconds():
    true_ns, stamp_ms, arrival_ns = sensor(10, 25.05, seed=9)
    sync = TimeSync(int(stamp_ms[0]), int(true_ns[0]) - 567_000, 50_000)
    without, _ = errors_ms(DeviceClock(0.025, smallest_delay_ns=DELAY_NS), true_ns, stamp_ms, arrival_ns)
    clock = DeviceClock(0.025, smallest_delay_ns=DELAY_NS)
    clock.synchronise(sync)
    with_it, uncertainty_ms = errors_ms(clock, true_ns, stamp_ms, arrival_ns)
    assert np.abs(without).max() > 2.0
    assert np.abs(with_it).max() < 2.0
    assert np.abs(with_it[:40]).max() < 1.1  # the quartz may have run off by 0.2 ms a second, not more
    assert uncertainty_ms[0] < 0.6


def test_few_late_packets_leave_little_to_guess():
    true_ns, stamp_ms, arrival_ns = sensor(60, 25.05, late_ms=0.5, spread="tail", seed=11)
    error_ms, _ = errors_ms(DeviceClock(0.025, smallest_delay_ns=DELAY_NS), true_ns, stamp_ms, arrival_ns)
    assert np.abs(error_ms[settled(true_ns)]).max() < 0.06
    assert np.abs(error_ms[settled(true_ns, 3)]).max() < 0.25


def test_the_first_beam_is_later_than_the_stamp_by_what_was_said():
    arrays = sensor(20, 25.05)
    plain, _ = host_times(DeviceClock(0.025, smallest_delay_ns=DELAY_NS), *arrays[1:])
    shifted, _ = host_times(DeviceClock(0.025, smallest_delay_ns=DELAY_NS, first_beam_ns=3_125_000), *arrays[1:])
    assert set(shifted - plain) == {3_125_000}


def test_a_new_life_of_the_sensors_clock_forgets_the_old_one():
    true_ns, stamp_ms, arrival_ns = sensor(40, 25.05, seed=10)
    clock = DeviceClock(0.025, smallest_delay_ns=DELAY_NS)
    host_times(clock, stamp_ms, arrival_ns)
    gap_ns = 17 * 10**9
    moments = [
        clock.update(ms - int(stamp_ms[0]), ns + gap_ns, restarts=1)
        for ms, ns in zip(stamp_ms.tolist(), arrival_ns.tolist(), strict=True)
    ]
    error_ms = (np.array([moment.time_ns for moment in moments]) - true_ns - gap_ns) / 1e6
    assert np.abs(error_ms[settled(true_ns)]).max() < 1.0


def test_memory_stays_constant():
    _, stamp_ms, arrival_ns = sensor(240, 25.05)
    clock, half = DeviceClock(0.025, smallest_delay_ns=DELAY_NS), stamp_ms.size // 2
    host_times(clock, stamp_ms[:half], arrival_ns[:half])
    tracemalloc.start()
    for k in range(half, stamp_ms.size):
        clock.update(int(stamp_ms[k]), int(arrival_ns[k]))
    grown = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert grown < 80_000  # the arrivals and the stamps of 100 seconds, once


@given(
    begin=st.integers(0, 2**24 - 1),
    steps_ms=st.lists(st.integers(1, 3 * 2**24), min_size=1, max_size=20),
    jitter_ms=st.lists(st.integers(0, 400), min_size=21, max_size=21),
)
def test_stamps_are_unwrapped_over_wraps_and_long_pauses(begin, steps_ms, jitter_ms):
    counter, true_ms = StampCounter(), begin + np.concatenate([[0], np.cumsum(steps_ms)])
    told = [
        counter.unwrap(int(ms) % 2**24, (int(ms) + late) * 10**6) for ms, late in zip(true_ms, jitter_ms, strict=False)
    ]
    np.testing.assert_array_equal(np.array(told) - told[0], true_ms - true_ms[0])
    assert counter.restarts == 0


@pytest.mark.parametrize(("ahead_ms", "restarts"), [(-1, 0), (60_000, 0), (60_001, 1)])
def test_a_stamp_may_be_a_minute_ahead_of_the_host_and_no_more(ahead_ms, restarts):
    """What waits in a buffer is late; what runs ahead of the host's clock by more is of another life."""
    counter = StampCounter()
    counter.unwrap(500_000, 10**12)
    assert counter.unwrap(501_000 + ahead_ms, 10**12 + 10**9) == 501_000 + ahead_ms
    assert counter.restarts == restarts


def test_a_stamp_that_cannot_be_is_a_new_life():
    counter = StampCounter()
    assert counter.unwrap(500_000, 10**12) == 500_000
    assert counter.unwrap(40, 10**12 + 10**9) == 40
    assert counter.restarts == 1
    counter.restart()
    counter.restart()
    assert counter.unwrap(7, 10**12 + 2 * 10**9) == 7
    assert counter.restarts == 2


@given(
    phase_ns=st.integers(0, 999_999),
    ways_ns=st.lists(st.tuples(st.integers(10_000, 900_000), st.integers(10_000, 900_000)), min_size=5, max_size=80),
)
@settings(max_examples=100)
def test_the_true_offset_lies_within_the_synchronisation(phase_ns, ways_ns):
    exchanges, now_ns = [], 5 * 10**15
    for there_ns, back_ns in ways_ns:
        stamp_ms = (now_ns + there_ns + phase_ns) // 1_000_000 - 4_000_000_000
        exchanges.append(Exchange(now_ns, stamp_ms, now_ns + there_ns + back_ns))
        now_ns += there_ns + back_ns + 137_000
    sync = synchronised(exchanges)
    true_ns = (sync.stamp_ms + 4_000_000_000) * 1_000_000 - phase_ns
    assert abs(sync.host_ns - true_ns) <= sync.half_width_ns + 1
    assert sync.half_width_ns < 1_500_000


def test_answers_that_contradict_each_other_are_refused():
    with pytest.raises(DeviceError, match="restarted"):
        synchronised([Exchange(0, 900, 10**6), Exchange(2 * 10**6, 3, 3 * 10**6)])


def test_a_synchronisation_is_as_narrow_as_its_ways_its_ticks_and_its_drift():
    """Asked every 10 ms, 2 ms there and back: half of 2 ms and a tick, and 200 ppm of half a second."""
    sent_ns = 10**12 + np.arange(50) * 10_000_000
    exchanges = [Exchange(int(ns), int(ns + 10**6) // 10**6, int(ns) + 2 * 10**6) for ns in sent_ns]
    assert 1_590_000 < synchronised(exchanges).half_width_ns < 1_600_000
