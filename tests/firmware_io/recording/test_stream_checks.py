"""Scans and angles that come live get the checks of the import, once each, and good ones no warning."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.firmware_io.recordings.import_mutations import FAULTS, good
from scanwright.firmware_io.recording.import_checks import stream
from scanwright.firmware_io.recording.import_checks.stream import StreamChecks
from scanwright.firmware_io.samples import Scan

EXPECTED = {
    "none": set(),
    "late transport": set(),
    "a stall of the network": set(),
    "angles lost": set(),
    "scan_time not given": set(),
    "time_increment off": {"time_increment_off"},
    "time_increment 0": {"time_increment_zero"},
    "time_increment changes": {"time_increment_changes"},
    "stamp of the last beam": {"scan_stamp_not_first_beam"},
    "no return is far": {"longest_range_repeats"},
    "angle 0 now and then": {"angle_outliers"},
    "angle of 32768 counts": {"angle_outliers"},
    "angle outliers": {"angle_outliers"},
    "angle frozen": {"angle_jumps"},
}


def scans_of(one):
    for k in range(one.scan_ns.size):
        yield Scan(
            stamp_ns=int(one.scan_ns[k]),
            angle_min_rad=one.angle_min,
            angle_increment_rad=one.increment,
            time_increment_s=float(one.time_increment[k]),
            scan_time_s=one.scan_time,
            range_min_m=0.1,
            range_max_m=one.range_max,
            range_m=one.ranges[k].astype(np.float32),
            intensity=np.empty(0, np.float32),
        )


def findings(one, **more):
    """All findings of a stream, in the order of receipt."""
    checks = StreamChecks(at_rest=False, **more)
    rows = [(when, checks.joint, one.angle_ns[k], one.angle_rad[k]) for k, when in enumerate(one.angle_receive_ns)]
    rows += [(when, checks.scan, scan, when) for when, scan in zip(one.scan_receive_ns, scans_of(one), strict=True)]
    found = []
    for _, take, *arguments in sorted(rows, key=lambda row: row[0]):
        found += take(*arguments) or []
    return found + checks.check()


@pytest.mark.parametrize("fault", EXPECTED)
def test_the_checks_of_the_import_run_on_a_stream(fault):
    for seed in range(4):
        rng = np.random.default_rng(seed)
        codes = {finding.code for finding in findings(FAULTS[fault](good(rng), rng))}
        if fault == "time_increment off" and not codes:  # a small one is harmless
            continue
        assert codes - {"angle_jumps"} == EXPECTED[fault] - {"angle_jumps"}, (seed, codes)
        assert "angle_jumps" in codes or fault != "angle frozen"


def test_a_fault_is_reported_once_as_soon_as_the_window_shows_it(monkeypatch):
    monkeypatch.setattr(stream, "EVERY_S", 0.5)
    one = good(np.random.default_rng(1))
    checks, reports = StreamChecks(at_rest=True), []
    for when, angle in zip(one.angle_ns, one.angle_rad, strict=True):
        checks.joint(int(when), float(angle))
    for number, scan in enumerate(scans_of(replace(one, time_increment=0 * one.time_increment))):
        reports += [(number, finding.code) for finding in checks.scan(scan)]
    ((number, code),) = reports
    assert code == "time_increment_zero"
    assert number < 60
    assert checks.check() == []


def test_the_window_forgets(monkeypatch):
    monkeypatch.setattr(stream, "WINDOW_S", 1.0)
    one = good(np.random.default_rng(2))
    checks = StreamChecks(at_rest=False)
    for scan in scans_of(one):
        checks.scan(scan)
    for when in one.angle_ns.tolist():
        checks.joint(when, 0.0)
    assert np.ptp([row[0] for row in checks._headers]) <= 1e9
    assert np.ptp([when for when, _ in checks._angles]) <= 1e9
    assert len(checks._received_ns) == len(checks._headers)
