"""Times of scans and angles on one clock, and one log for scans that were taken at rest."""

import numpy as np
import pytest

from scanwright.firmware_io.recording.bag_clocks import Stamps, log_at_rest, one_clock
from scanwright.firmware_io.samples import JointLog


def test_a_scan_that_is_cut_short_ends_before_the_next_which_keeps_both_its_samples():
    log = JointLog(np.array([0, 500, 1000]), np.array([0.0, 0.5, 1.0]))
    held, cut = log_at_rest(log, np.array([100, 500]), np.array([600, 300]))
    np.testing.assert_array_equal(held.time_ns, [100, 499, 500, 800])
    np.testing.assert_array_equal(held.position_rad, [0.0, 0.0, 0.5, 0.5])
    assert cut == 1
    np.testing.assert_array_equal(held.angle_at(np.array([500])), [0.5])


@pytest.mark.parametrize("ahead_s", [0.0, 0.12, 0.5])
def test_stamps_of_one_clock_that_is_ahead_of_the_receiver_stay(ahead_s):
    stamp_ns, arc_ns = np.arange(10**10, 2 * 10**10, 10**8), np.full(100, 6 * 10**7)
    received = stamp_ns - round(1e9 * ahead_s)
    scans, angles = Stamps(stamp_ns, received + arc_ns + 10**6), Stamps(stamp_ns, received + 10**6)
    chosen = one_clock(scans, angles, arc_ns)
    assert chosen.note == "" and np.array_equal(chosen.scan_ns, stamp_ns) and np.array_equal(chosen.angle_ns, stamp_ns)


def test_of_clocks_that_differ_the_receipt_of_the_first_beam_decides():
    stamp_ns, arc_ns = np.arange(10**10, 2 * 10**10, 10**8), np.full(100, 6 * 10**7)
    scans, angles = Stamps(stamp_ns + 4 * 10**8, stamp_ns + arc_ns), Stamps(stamp_ns, stamp_ns)
    chosen = one_clock(scans, angles, arc_ns)
    assert "another clock" in chosen.note and np.array_equal(chosen.scan_ns, stamp_ns)
