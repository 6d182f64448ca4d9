"""Which beams end on the scanner: what was looked at reaches to the next beam and not beyond."""

import numpy as np

from scanwright.firmware_io.assembly.own_body import OwnBody

STEP_RAD = 0.01


def test_a_mask_reaches_one_step_beyond_its_beams_and_no_farther():
    known_rad = np.arange(5) * STEP_RAD
    body = OwnBody(known_rad, np.ones(5, bool), np.ones((5, 4), bool))
    beyond_rad = np.array([0.0, 0.99, 1.01, 1.99]) * STEP_RAD
    asked_rad = np.concatenate([known_rad[-1] + beyond_rad, -beyond_rad])
    np.testing.assert_array_equal(body.hides(asked_rad, np.zeros(8)), [True, True, False, False] * 2)
    np.testing.assert_array_equal(body.tables(asked_rad)[1][:, 0], [True, True, False, False] * 2)
    assert body.unknown(asked_rad) == 4
