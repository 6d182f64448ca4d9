"""`repair` keeps every message whose bytes are whole, wherever the damage is, and calls nothing whole that is not."""

import json
import struct
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from quick_tests import samples

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.recording.recording import MessageWriter, open_recording
from scanwright.firmware_io.recording.repair.repair import repair, repaired_place
from scanwright.firmware_io.samples import Scan

EPOCH_NS = 1_700_000_000 * 10**9
PER_CHUNK = 6


def a_scan(stamp_ns):
    return Scan(
        stamp_ns=stamp_ns,
        angle_min_rad=-0.5,
        angle_increment_rad=0.25,
        time_increment_s=1e-4,
        scan_time_s=0.025,
        range_min_m=0.1,
        range_max_m=30.0,
        range_m=np.random.default_rng(stamp_ns % 2**32).uniform(1, 9, 5).astype(np.float32),
        intensity=np.empty(0, np.float32),
    )


def messages(path):
    """Every message, as the reader of mcap sees it: topic, time, bytes."""
    with path.open("rb") as stream:
        found = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


def chunks(data):
    """Where each chunk has its checksum, and where its packed bytes begin and end, by the page of the format alone."""
    at, found = 8, []
    while at < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == 6:
            (name,) = struct.unpack_from("<I", data, at + 9 + 28)
            found.append((at + 9 + 24, at + 9 + 32 + name + 8, at + 9 + length))
        at += 9 + length
    return found


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    """A whole recording of four chunks, the end of each chunk in the file, and its messages."""
    stream, ends = BytesIO(), []
    writer = MessageWriter(stream, Path("journal"), {"source": "test"}, {"angles.json": "{}"})
    for chunk in range(4):
        for number in range(PER_CHUNK - 1):
            writer.joint(EPOCH_NS + chunk * 100 + number, float(number))
        writer.scan(a_scan(EPOCH_NS + chunk * 100))
        writer.flush()
        ends.append(stream.tell())
    writer.finish()
    path = tmp_path_factory.mktemp("journal") / "whole.mcap"
    path.write_bytes(stream.getvalue())
    return stream.getvalue(), ends, messages(path)


def whole_after(data, sent, place):
    """What a damaged byte leaves whole; behind a damaged checksum the last four bytes of its chunk are unsure."""
    kept = []
    for number, (checksum, begin, end) in enumerate(chunks(data)):
        if not begin <= place < end:
            unsure = checksum <= place < checksum + 4
            kept += sent[PER_CHUNK * number : PER_CHUNK * (number + 1) - unsure]
    return kept


@pytest.mark.parametrize("first", samples(range(4), [0]))
def test_a_flipped_bit_costs_no_message_that_is_whole(tmp_path, journal, first):
    """Every 331st bit of header, chunks, indexes, summary and footer; all of them: 0 of 30,368 fail."""
    data, _, sent = journal
    path, out = tmp_path / "r.mcap", tmp_path / "r.repaired.mcap"
    called_whole = 0
    for bit in range(first * 83, 8 * len(data), 331):
        place = bit // 8
        damaged = data[:place] + bytes([data[place] ^ 1 << bit % 8]) + data[place + 1 :]
        path.write_bytes(damaged)
        summary = repair(path)
        if summary.intact:
            called_whole += 1
            assert messages(path) == sent, bit
            open_recording(path)
        else:
            assert messages(out) == whole_after(data, sent, place), bit
            assert repair(out, tmp_path / "again.mcap").intact
            open_recording(out)
        assert path.read_bytes() == damaged
    assert called_whole < 5  # a letter of the note, which nothing vouches for


@settings(max_examples=60, deadline=None)
@given(share=st.floats(0, 1))
def test_wherever_it_is_cut_every_whole_chunk_is_kept(tmp_path_factory, journal, share):
    data, ends, sent = journal
    path = tmp_path_factory.mktemp("cut") / "cut.mcap"
    cut = round(share * len(data))
    path.write_bytes(data[:cut])
    if cut == len(data):
        assert repair(path).intact
        return
    # the message indexes after a chunk are not needed: a chunk counts as soon as it is there itself
    whole = sum(end <= cut for end in ends)
    if not whole:
        return
    summary = repair(path)
    kept = messages(repaired_place(path))
    assert kept == sent[: len(kept)]
    assert whole * PER_CHUNK <= len(kept) == summary.messages.total() <= (whole + 1) * PER_CHUNK


@settings(max_examples=100, deadline=None)
@given(share=st.floats(0, 1), run=st.integers(1, 900), seed=st.integers(0, 99))
def test_torn_bytes_never_become_a_message(tmp_path_factory, journal, share, run, seed):
    data, _, sent = journal
    begin = round(share * len(data))
    torn = data[:begin] + np.random.default_rng(seed).bytes(run) + data[begin + run :]
    path = tmp_path_factory.mktemp("torn") / "torn.mcap"
    path.write_bytes(torn)
    try:
        summary = repair(path)
    except RecordingError as error:
        assert str(path) in str(error)
        return
    kept = messages(path if summary.intact else repaired_place(path))
    assert [message for message in sent if message in kept] == kept
    untouched = [k for k, (checksum, _, end) in enumerate(chunks(data)) if end <= begin or checksum - 33 >= begin + run]
    if len(untouched) < 4:
        assert len(kept) >= PER_CHUNK * len([k for k in untouched if begin < len(data)])
    assert len(kept) == summary.messages.total()


@pytest.mark.parametrize("packing", list(CompressionType))
def test_every_packing_survives_a_damaged_head(tmp_path, packing):
    """Opcode, length, sizes, checksum, name of the packing and its length; each byte of them turned over."""
    stream = BytesIO()
    writer = Writer(stream, chunk_size=200, compression=packing)
    writer.start("", "test")
    channel = writer.register_channel("/a", "json", writer.register_schema("a", "jsonschema", b"{}"))
    for number in range(30):
        writer.add_message(channel, number, bytes(range(20)), number)
    writer.finish()
    data = stream.getvalue()
    path = tmp_path / "r.mcap"
    path.write_bytes(data)
    sent = messages(path)
    assert repair(path).intact
    assert len(chunks(data)) > 2
    checksum, begin, _ = chunks(data)[1]
    for place in [place for place in range(checksum - 33, begin) if not checksum <= place < checksum + 4]:
        path.write_bytes(data[:place] + bytes([data[place] ^ 0xFF]) + data[place + 1 :])
        assert not repair(path).intact
        assert messages(repaired_place(path)) == sent, place


def test_a_file_without_chunks_loses_what_is_damaged_and_no_more(tmp_path):
    stream = BytesIO()
    writer = Writer(stream, use_chunking=False)
    writer.start("", "test")
    channel = writer.register_channel("/a", "json", writer.register_schema("a", "jsonschema", b"{}"))
    for number in range(9):
        writer.add_message(channel, number, bytes([number]) * 50, number)
    writer.finish()
    data = stream.getvalue()
    path = tmp_path / "r.mcap"
    path.write_bytes(data)
    sent = messages(path)
    place = data.index(bytes([4]) * 50) - 30  # the length of the fifth
    path.write_bytes(data[:place] + b"\xff" + data[place + 1 :])
    summary = repair(path)
    assert (summary.lost_messages, summary.intact) == (1, False)
    assert messages(repaired_place(path)) == sent[:4] + sent[5:]


def test_a_damaged_chunk_is_counted(tmp_path, journal):
    data, _, sent = journal
    _, begin, end = chunks(data)[2]
    path = tmp_path / "r.mcap"
    path.write_bytes(data[: begin + 60] + bytes([data[begin + 60] ^ 0xFF]) + data[begin + 61 :])
    summary = repair(path)
    assert (summary.damaged_chunks, summary.lost_messages) == (1, PER_CHUNK)
    assert summary.lost_bytes > end - begin
    assert messages(repaired_place(path)) == sent[:12] + sent[18:]


def test_the_command_writes_beside_the_file_and_says_what_it_kept(tmp_path, journal, command):
    data, ends, _ = journal
    path, out = tmp_path / "r.mcap", tmp_path / "r.repaired.mcap"
    path.write_bytes(data[: ends[2] + 10])
    code, said, complaints = command("repair", path)
    assert (code, complaints) == (0, [])
    assert said.splitlines() == [
        f"{path}: 15 messages of /joint_states and 3 messages of /scan, 0.0 s",
        "left out 10 bytes that are not whole (0 damaged chunks, 0 messages known to be lost)",
        "made anew: the first or last bytes (1), the index at the end (1)",
        f"wrote {out}",
    ]
    assert path.read_bytes() == data[: ends[2] + 10]
    _, as_json, _ = command("repair", path, "--json")
    assert json.loads(as_json)["lost_bytes"] == 10
    assert "nothing to repair" in command("repair", out)[1]
    path.write_bytes(data[:-1] + b"x")
    assert "every message is whole" in command("repair", path, "-o", tmp_path / "mended.mcap")[1]
    for other, says in (
        ("mended.bag", "a recording is an MCAP file; name it mended.mcap"),
        ("r.mcap", "the damaged recording itself: it stays as it is, name another file"),
    ):
        code, _, complaints = command("repair", path, "-o", tmp_path / other)
        assert (code, complaints) == (2, [f"error: {tmp_path / other}: {says}"])


def a_minute(path, lost_s):
    """A recording of 60 s, 4 scans a second in chunks of a second or more, damaged where a list of times is."""
    stream, ends = BytesIO(), [0]
    writer = MessageWriter(stream, Path("minute"), {}, {}, Writer)
    for number in range(240):
        writer.scan(a_scan(EPOCH_NS + number * 250_000_000))
        if number % 4 == 3:
            writer.flush()
            ends.append(stream.tell())
    writer.finish()
    data = bytearray(stream.getvalue())
    for second in lost_s:
        data[ends[second] + 70] ^= 0xFF
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("lost_s", "says"),
    [
        ([12], "1.2 s missing at 11.8 s"),
        ([12, 13, 40], "2.2 s missing at 11.8 s, 1.2 s missing at 39.8 s"),
        ([1], "1.2 s missing at 0.8 s"),
        ([59], "1.0 s missing at 58.8 s"),
        (range(2, 30, 2), "1.2 s missing at 15.8 s, and so on: 14 gaps, 17.5 s in all"),
    ],
)
def test_what_is_missing_is_said_with_its_place(tmp_path, lost_s, says):
    path = tmp_path / "r.mcap"
    a_minute(path, lost_s)
    lines = repair(path).lines(path, repaired_place(path))
    assert lines[2].endswith(says), lines
    again = repaired_place(path)
    with again.open("rb") as stream:
        spans = [
            index.message_end_time - index.message_start_time
            for index in make_reader(stream).get_summary().chunk_indexes
        ]
    assert max(spans) < 250_000_000


@pytest.mark.parametrize("content", [b"", b"no recording" * 99, None])
def test_what_is_no_recording_is_one_line(tmp_path, command, content):
    path = tmp_path / "r.mcap"
    if content is not None:
        path.write_bytes(content)
    code, _, complaints = command("repair", path)
    assert code == 2
    assert len(complaints) == 1
    assert str(path) in complaints[0]
