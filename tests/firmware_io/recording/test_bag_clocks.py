"""One log for scans that were taken at rest."""

import numpy as np

from scanwright.firmware_io.recording.bag_clocks import log_at_rest
from scanwright.firmware_io.samples import JointLog


def test_a_scan_that_is_cut_short_ends_before_the_next_which_keeps_both_its_samples():
    log = JointLog(np.array([0, 500, 1000]), np.array([0.0, 0.5, 1.0]))
    held, cut = log_at_rest(log, np.array([100, 500]), np.array([600, 300]))
    np.testing.assert_array_equal(held.time_ns, [100, 499, 500, 800])
    np.testing.assert_array_equal(held.position_rad, [0.0, 0.0, 0.5, 0.5])
    assert cut == 1
    np.testing.assert_array_equal(held.angle_at(np.array([500])), [0.5])
