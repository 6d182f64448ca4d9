"""Live recordings: what was written is there after every kind of end, and `repair` keeps all that is whole."""

import resource
import signal
import subprocess
import sys
import time
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from design.errors import RecordingError
from firmware_io.recording.recording import MessageWriter, open_recording
from firmware_io.recording.repair import repair
from firmware_io.samples import Scan
from firmware_io.scan.recorder import CHUNK_S, Recorder

EPOCH_NS = 1_700_000_000 * 10**9


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


def messages(path):
    """Every message, as the reader of mcap sees it: topic, time, bytes."""
    with path.open("rb") as stream:
        found = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


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
    assert repair(path, path).whole


def test_a_recording_is_never_written_over(tmp_path):
    path = tmp_path / "live.mcap"
    path.write_text("old")
    with pytest.raises(RecordingError, match="File exists"), Recorder(path, {}, {}):
        pass
    assert path.read_text() == "old"


RECORD = """
import sys, time
from pathlib import Path
from firmware_io.scan.recorder import Recorder
sys.path.insert(0, sys.argv[2])
from test_recorder import a_scan
with Recorder(Path(sys.argv[1]), {}, {}) as recorder:
    while True:
        recorder.joint(time.monotonic_ns(), 0.0)
        recorder.scan(a_scan(time.monotonic_ns(), 1081))
        time.sleep(0.01)
"""


def wait_until(true, deadline_s=20):
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
    summary = repair(path, path)
    assert not summary.whole
    assert killed_ns - summary.times_ns[1] < 10**9
    assert sum(1 for _ in open_recording(path).scans()) == summary.messages["/scan"] > 20


def test_a_full_disk_keeps_what_was_there_and_says_what_to_do(tmp_path):
    path = tmp_path / "live.mcap"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (600_000, hard))  # like a full disk, it cuts a write in the middle
    written, deadline = 0, time.monotonic() + 20
    try:
        with pytest.raises(RecordingError, match=r"cannot write: .*; what came before is safe") as caught:  # noqa: SIM117
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
    summary = repair(path, path)
    assert failed_ns - summary.times_ns[1] < 10**9
    assert 0 < summary.messages["/scan"] < written
    assert summary.lost_bytes == 0  # the write that did not fit was taken back


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    """A whole recording of twelve chunks, the end of each chunk in the file, and its messages."""
    stream = BytesIO()
    writer = MessageWriter(stream, Path("journal"), {"source": "test"}, {"angles.json": "{}"})
    ends = []
    for chunk in range(12):
        for number in range(7):
            writer.joint(EPOCH_NS + chunk * 100 + number, float(number))
        writer.scan(a_scan(EPOCH_NS + chunk * 100))
        writer.flush()
        ends.append(stream.tell())
    writer.finish()
    path = tmp_path_factory.mktemp("journal") / "whole.mcap"
    path.write_bytes(stream.getvalue())
    return stream.getvalue(), ends, messages(path)


@settings(max_examples=60, deadline=None)
@given(share=st.floats(0, 1))
def test_wherever_it_is_cut_every_whole_chunk_is_kept(tmp_path_factory, journal, share):
    data, ends, sent = journal
    path = tmp_path_factory.mktemp("cut") / "cut.mcap"
    cut = round(share * len(data))
    path.write_bytes(data[:cut])
    if cut == len(data):
        assert repair(path, path).whole
        return
    # the message indexes after a chunk are not needed: a chunk counts as soon as it is there itself
    whole = sum(end <= cut for end in ends)
    if not whole:
        return
    summary = repair(path, path)
    kept = messages(path)
    assert kept == sent[: len(kept)]
    assert whole * 8 <= len(kept) == summary.messages.total() <= (whole + 1) * 8
    assert repair(path, path).whole


@settings(max_examples=100, deadline=None)
@given(share=st.floats(0, 1), flip=st.integers(1, 255))
def test_a_flipped_byte_never_becomes_a_message(tmp_path_factory, journal, share, flip):
    data, _, sent = journal
    place = min(round(share * len(data)), len(data) - 1)
    path = tmp_path_factory.mktemp("flip") / "flip.mcap"
    path.write_bytes(data[:place] + bytes([data[place] ^ flip]) + data[place + 1 :])
    try:
        summary = repair(path, path)
    except RecordingError as error:
        assert str(path) in str(error)
        return
    if not summary.whole:
        kept = messages(path)
        assert [message for message in sent if message in kept] == kept
        assert len(kept) == summary.messages.total()


def test_a_damaged_chunk_is_counted(tmp_path, journal):
    data, ends, sent = journal
    place = data.index(b"\x28\xb5\x2f\xfd", ends[4]) + 60  # inside the sixth zstd frame
    path = tmp_path / "r.mcap"
    path.write_bytes(data[:place] + bytes([data[place] ^ 0xFF]) + data[place + 1 :])
    summary = repair(path, path)
    assert (summary.damaged_chunks, summary.lost_messages) == (1, 8)
    assert messages(path) == sent[:40] + sent[48:]


def test_the_command_says_what_it_kept(tmp_path, journal, command):
    data, ends, _ = journal
    path, out = tmp_path / "r.mcap", tmp_path / "mended.mcap"
    path.write_bytes(data[: ends[2] + 10])
    code, said, complaints = command("repair", path, "-o", out)
    assert (code, complaints) == (0, [])
    assert said.splitlines()[0] == f"{path}: 21 messages of /joint_states and 3 messages of /scan, 0.0 s"
    assert "left out 10 bytes" in said
    assert path.read_bytes() == data[: ends[2] + 10]
    assert "nothing to repair" in command("repair", out)[1]
    code, _, complaints = command("repair", path, "-o", tmp_path / "mended.bag")
    assert (code, complaints) == (
        2,
        [f"scanwright: {tmp_path / 'mended.bag'}: a recording is an MCAP file; name it mended.mcap"],
    )


@pytest.mark.parametrize("content", [b"", b"no recording" * 99, None])
def test_what_is_no_recording_is_one_line(tmp_path, command, content):
    path = tmp_path / "r.mcap"
    if content is not None:
        path.write_bytes(content)
    code, _, complaints = command("repair", path)
    assert code == 2
    assert len(complaints) == 1
    assert str(path) in complaints[0]


def test_a_chunk_is_well_below_the_second_that_may_be_lost():
    assert CHUNK_S <= 0.5
