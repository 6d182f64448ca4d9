"""The lag of the angles: found where the axis turns there and back, refused where nothing can be known."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.calibration.lag import lag_curve
from scanwright.firmware_io.recording.importer import import_bag
from scanwright.firmware_io.recording.recording import open_recording
from scanwright.firmware_io.samples import JointLog, Scan

DATA = os.environ.get("SCANWRIGHT_DATA")
needs_data = pytest.mark.skipif(DATA is None, reason="SCANWRIGHT_DATA names no folder with the real recordings")
START = 1_700_000_000_000_000_000
BEAMS = 16
LAGS = np.linspace(-0.5, 0.5, 21)


def true_angle(seconds):
    """There in 5 s, back in 5 s, one radian."""
    return 0.2 * (5 - np.abs(seconds - 5))


def simulated(log_late_s, noise_m=0.01, seed=0):
    """Scans of a wavy room, 20 a second, and a joint log whose stamps are late."""
    rng = np.random.default_rng(seed)
    scans = []
    for k in range(200):
        seconds = k * 0.05 + np.arange(BEAMS) * 1e-3
        bearing = 0.1 * np.arange(BEAMS)
        distance = 3 + np.sin(5 * true_angle(seconds) + bearing) + rng.normal(0, noise_m, BEAMS)
        distance[rng.random(BEAMS) < 0.05] = np.nan
        scans.append(
            Scan(
                stamp_ns=START + k * 50_000_000,
                angle_min_rad=0.0,
                angle_increment_rad=0.1,
                time_increment_s=1e-3,
                scan_time_s=0.05,
                range_min_m=0.1,
                range_max_m=9.0,
                range_m=distance.astype(np.float32),
                intensity=np.empty(0, np.float32),
            )
        )
    seconds = np.arange(0, 10.001, 0.01)
    logged_ns = START + np.rint((seconds + log_late_s) * 1e9).astype(np.int64)
    return scans, JointLog(logged_ns, true_angle(seconds))


@pytest.mark.parametrize("late_s", [-0.2, -0.03, 0.0, 0.024, 0.31])
def test_a_known_lag_is_found_with_its_sign(late_s):
    scans, log = simulated(late_s)
    curve = lag_curve(scans, log, LAGS)
    assert curve.best_s == pytest.approx(late_s, abs=0.01)
    assert curve.cost_m.shape == LAGS.shape
    assert abs(curve.best_s - late_s) < 3 * curve.sd_s < 0.03


def test_a_minimum_at_the_end_is_not_refined():
    scans, log = simulated(0.8)
    assert lag_curve(scans, log, LAGS).best_s == LAGS[-1]


@pytest.mark.parametrize("position", [lambda t: 0.2 * t, lambda t: 0 * t + 1.0, lambda t: 0.001 * np.sin(t)])
def test_an_axis_that_does_not_come_back_tells_no_lag(position):
    scans, log = simulated(0.0)
    one_way = JointLog(log.time_ns, position((log.time_ns - START) / 1e9))
    with pytest.raises(RecordingError, match="does not turn there and back"):
        lag_curve(scans, one_way, LAGS)


def test_scans_from_another_time_tell_no_lag():
    scans, log = simulated(0.0)
    elsewhere = JointLog(log.time_ns + 10**12, log.position_rad)
    with pytest.raises(RecordingError, match="no angle in common"):
        lag_curve(scans, elsewhere, LAGS)


def test_ragged_scans_are_refused():
    scans, log = simulated(0.0)
    short = replace(scans[0], range_m=np.ones(3, np.float32))
    with pytest.raises(RecordingError, match="same number of beams"):
        lag_curve([*scans, short], log, LAGS)


@needs_data
def test_the_real_scanner_has_no_lag(tmp_path):
    bag = Path(DATA) / "tilting/first_scan.bag"
    source = {"scan": "/slice:laserScan", "angle": "/slice:stepAngle"}
    summary = import_bag(bag, tmp_path / "r.mcap", **source, angle_unit="deg", hold=True)
    assert (summary.scans, summary.beams) == (1604, 1604 * 512)
    recording = open_recording(tmp_path / "r.mcap")
    curve = lag_curve(recording.scans(), recording.joint_log, np.linspace(-1, 1, 21))
    assert abs(curve.best_s) < 0.1
    assert abs(curve.lag_s[np.argmin(curve.cost_m)]) < 0.15
    assert curve.cost_m.min() < 0.6 * min(curve.cost_m[0], curve.cost_m[-1])
