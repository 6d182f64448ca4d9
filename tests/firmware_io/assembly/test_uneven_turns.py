"""Turns with bearings and times of their own: the compiled de-skew places them as the plain one does."""

import numpy as np

from benchmarks.firmware_io.recordings.deskew import place
from scanwright.design.angles import AngleSet
from scanwright.firmware_io.assembly.deskew_kernel import place_block
from scanwright.firmware_io.samples import JointLog, Scan, blocks


def turn(k):
    rng = np.random.default_rng(k)
    beams = 440 + k
    range_m = rng.uniform(0.5, 9.0, beams).astype(np.float32)
    return Scan(
        stamp_ns=10**9 + k * 10**8,
        angle_min_rad=0.0,
        angle_increment_rad=-2 * np.pi / beams,
        time_increment_s=0.1 / beams,
        scan_time_s=0.1,
        range_min_m=0.02,
        range_max_m=12.0,
        range_m=range_m,
        intensity=range_m[:0],
        beam_bearing_rad=-np.cumsum(rng.uniform(0.01, 0.018, beams)),
        beam_offset_ns=np.cumsum(rng.integers(100_000, 330_000, beams)),
    )


def test_the_compiled_way_places_beams_of_their_own_as_the_plain_one_does():
    tilted = {"alpha_rot": 10, "beta_rot": -55, "alpha_laser": -80, "beta_laser": 75}
    angles = AngleSet.model_validate({"task": "t", "angles_deg": tilted, "sensor": "LD19", "servo": "MX-64R"})
    time_ns = np.arange(0, 4 * 10**9, 10**7)
    log = JointLog(time_ns, 1.3 * time_ns / 1e9)
    scans = [turn(k) for k in range(4)]
    found = list(blocks(scans))
    assert [block.range_m.shape for block in found] == [(1, 440 + k) for k in range(4)]
    for block, placed in zip(found, place(scans, log, angles), strict=True):
        np.testing.assert_allclose(place_block(block, log, angles).points_m[0], placed.points_m, atol=2e-6)
        even_rad = block.first.angle_increment_rad * np.arange(block.range_m.shape[1])
        assert np.abs(block.first.bearing_rad - even_rad).max() > 0.01
