"""Live recordings: what was written is there after every kind of end, and `repair` keeps all that is whole."""

import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from scanwright.design.errors import DeviceError, RecordingError
from scanwright.firmware_io.recording.mcap_chunks import CHUNK_S
from scanwright.firmware_io.recording.recording import MessageWriter, open_recording
from scanwright.firmware_io.recording.repair.repair import repair, repaired_place
from scanwright.firmware_io.samples import Scan
from scanwright.firmware_io.scan.recorder import Recorder


def a_scan(stamp_ns, beams=5):
    return Scan(
        stamp_ns=stamp_ns,
        angle_min_rad=-0.5,
        angle_increment_rad=0.25,
        time_increment_s=1e-4,
        scan_time_s=0.025,
        range_min_m=0.1,
        range_max_m=30.0,
        range_m=np.random.default_rng(stamp_ns % 2**32).uniform(1, 9, beams).astype(np.float32),
        intensity=np.empty(0, np.float32),
    )


def test_a_recording_keeps_both_clocks_and_what_explains_it(tmp_path):
    path = tmp_path / "live.mcap"
    began_ns, wall_ns = time.monotonic_ns(), time.time_ns()
    with Recorder(path, {"source": "test"}, {"angles.json": "{}", "task.toml": "name = 'x'"}) as recorder:
        recorder.joint(began_ns, 1.0)
        recorder.scan(a_scan(began_ns + 5))
        recorder.joint(began_ns + 10, 2.0)
    recording = open_recording(path)
    with path.open("rb") as stream:
        reader = make_reader(stream)
        attached = {item.name: item.data for item in reader.iter_attachments()}
        note = {item.name: item.metadata for item in reader.iter_metadata()}["scanwright"]
    assert attached == {"angles.json": b"{}", "task.toml": b"name = 'x'"}
    assert note["source"] == "test"
    scan = next(recording.scans())
    assert scan.stamp_ns - int(note["wall_minus_monotonic_ns"]) == began_ns + 5
    assert abs(scan.stamp_ns - wall_ns) < 10**9
    np.testing.assert_array_equal(scan.range_m, a_scan(began_ns + 5).range_m)
    assert recording.joint_log.position_rad.tolist() == [1.0, 2.0]


def test_a_recording_is_whole_after_an_exception(tmp_path):
    path = tmp_path / "live.mcap"
    with pytest.raises(KeyboardInterrupt), Recorder(path, {}, {}) as recorder:
        recorder.joint(1, 1.0)
        recorder.scan(a_scan(1))
        raise KeyboardInterrupt
    assert repair(path).intact


def test_a_recording_is_never_written_over(tmp_path):
    path = tmp_path / "live.mcap"
    path.write_text("old")
    with pytest.raises(RecordingError, match="File exists"), Recorder(path, {}, {}):
        pass
    assert path.read_text() == "old"


RECORD = """
import sys, time
from pathlib import Path
from scanwright.firmware_io.scan.recorder import Recorder
sys.path.insert(0, sys.argv[2])
from test_recorder import a_scan
with Recorder(Path(sys.argv[1]), {}, {}) as recorder:
    while True:
        recorder.joint(time.monotonic_ns(), 0.0)
        recorder.scan(a_scan(time.monotonic_ns(), 1081))
        time.sleep(0.01)
"""


def wait_until(true, deadline_s=200):  # it takes two seconds, and a busy computer ten times that
    deadline = time.monotonic() + deadline_s
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_kill_9_costs_less_than_a_second(tmp_path):
    path = tmp_path / "live.mcap"
    words = [sys.executable, "-c", RECORD, path, Path(__file__).parent]
    with subprocess.Popen(words, cwd=Path(__file__).parents[3]) as program:
        wait_until(lambda: path.exists() and path.stat().st_size > 200_000)
        killed_ns = time.time_ns()
        program.send_signal(signal.SIGKILL)
    with pytest.raises(RecordingError, match="cut off \\(`scanwright repair` mends it"):
        open_recording(path)
    summary = repair(path)
    assert not summary.intact
    assert killed_ns - summary.times_ns[1] < 10 * 10**9  # a second, and ten on a busy computer
    assert sum(1 for _ in open_recording(repaired_place(path)).scans()) == summary.messages["/scan"] > 20


def test_a_full_disk_keeps_what_was_there_and_says_what_to_do(tmp_path):
    path = tmp_path / "live.mcap"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (600_000, hard))  # like a full disk, it cuts a write in the middle
    written, deadline = 0, time.monotonic() + 200
    try:
        with pytest.raises(DeviceError, match=r"cannot write: .*; earlier data are on the disk") as caught:  # noqa: SIM117
            with Recorder(path, {}, {}) as recorder:
                while time.monotonic() < deadline:
                    recorder.joint(time.monotonic_ns(), 0.0)
                    recorder.scan(a_scan(time.monotonic_ns(), 1081))
                    written += 1
                    time.sleep(0.005)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    failed_ns = time.time_ns()
    assert "`scanwright repair" in str(caught.value)
    summary = repair(path)
    assert failed_ns - summary.times_ns[1] < 10 * 10**9
    assert 0 < summary.messages["/scan"] < written
    assert summary.lost_bytes == 0  # the write that did not fit was taken back


def test_a_fault_of_our_own_while_it_waits_for_the_disk_ends_the_scan(tmp_path, monkeypatch):
    def broken(_messages):
        raise AttributeError("no such thing in this release")

    monkeypatch.setattr(MessageWriter, "flush", broken)
    with pytest.raises(AttributeError, match="no such thing"), Recorder(tmp_path / "live.mcap", {}, {}) as recorder:
        wait_until(lambda: recorder.joint(1, 1.0))


def test_a_chunk_is_well_below_the_second_that_may_be_lost():
    assert CHUNK_S <= 0.5
