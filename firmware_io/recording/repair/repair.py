"""`scanwright repair`: all intact messages of a damaged recording, in a new file with a new index.

An MCAP file is a chain of records (https://mcap.dev/spec).

- Messages are in chunks with a checksum of their content. Opcode, lengths, sizes, times and compression name of a chunk
  may be damaged: all possible values are tried until the checksum fits.
- Topics and types are in chunks, and also in the summary at the end, which has its own checksum.
- A broken chain continues where two consecutive records can be read completely.

A file is intact only if all of that is valid, indexes are correct, and other readers read it.
Unusable input raises RecordingError.
"""

from __future__ import annotations

from bisect import bisect
from collections import Counter
from pathlib import Path

import numpy as np
from mcap import records as mcap
from mcap.reader import NonSeekingReader, SeekingReader

from scanwright.design.errors import RecordingError, made_by
from scanwright.design.files.atomic_file import atomic_write, check_place
from scanwright.firmware_io.foreign import foreign
from scanwright.firmware_io.recording.mcap_chunks import TimedChunks, read_messages
from scanwright.firmware_io.recording.repair.survey import RepairSummary, Survey


def repair(path: Path, out: Path | None = None) -> RepairSummary:
    """Write the intact messages of a damaged recording to another file; write nothing if it is intact.

    Args:
        path: of the recording, which is not changed.
        out: another file; None for `repaired_place(path)`.

    Raises:
        RecordingError: the file cannot be read, has no intact message, or `out` is the same file.
    """
    target = repaired_place(path)
    out = target if out is None else out
    check_place(out, RecordingError)
    if out.suffix != ".mcap":
        raise RecordingError(f"{out}: a recording is an MCAP file; name it {out.with_suffix('.mcap').name}")
    if out.exists() and path.samefile(out):
        raise RecordingError(f"{out}: the damaged recording itself: it stays as it is, name another file")
    size = path.stat().st_size
    data = foreign(f"{path}: cannot read", np.memmap, path, np.uint8, "r").data if size else memoryview(b"")
    result = Survey(data)
    summary = result.summary
    lost_before = 0
    for at, message in result.messages():
        topic = result.topic(message)
        if topic is None:
            summary.lost_messages += 1
            continue
        first, last = summary.times_ns
        summary.messages[topic] += 1
        if lost_before < (lost_before := bisect(result.lost_at, at)):
            summary.misses(last or result.summary_ns[0], message.log_time)
        summary.times_ns = min(first, message.log_time), max(last, message.log_time)
    if not summary.messages:
        raise RecordingError(f"{path}: no whole message in it, there is nothing to save (is it an MCAP recording?)")
    if lost_before < len(result.lost_at):
        summary.misses(summary.times_ns[1], result.summary_ns[1])
    summary.lost_messages = max(summary.lost_messages, result.announced - summary.messages.total())
    if summary.intact and not _read_alike(path, summary.messages):
        summary.repaired["what readers stumble over"] += 1
    if not summary.intact:
        with atomic_write(out, RecordingError) as part, foreign(f"{out}: cannot write", part.open, "wb") as stream:
            _write(TimedChunks(stream), result)
    return summary


def repaired_place(path: Path) -> Path:
    """Return the default path of the repaired recording, next to the damaged one."""
    if not path.is_file():
        what = "this is a folder, not a recording" if path.is_dir() else f"no such file{made_by(path)}"
        raise RecordingError(f"{path}: {what}")
    return path.with_name(f"{path.stem}.repaired.mcap")


def _read_alike(path: Path, messages: Counter[str]) -> bool:
    """Whether all readers read these messages."""
    try:
        with path.open("rb") as stream:
            for reader in (SeekingReader(stream, validate_crcs=True), NonSeekingReader(stream, validate_crcs=True)):
                stream.seek(0)
                if messages != Counter(channel.topic for _, channel, _ in reader.iter_messages(log_time_order=False)):
                    return False
            stream.seek(0)
            extras = SeekingReader(stream)
            for items in (extras.iter_metadata(), extras.iter_attachments()):
                list(items)
        return messages == Counter(topic for topic, _ in read_messages(path, messages))
    except Exception:  # readers raise many types
        return False


def _write(writer: TimedChunks, result: Survey) -> None:
    """Write all intact records, with new numbers of schemas and channels."""
    header = result.header or mcap.Header("ros2", "scanwright")
    writer.start(header.profile, header.library)
    for extra in result.extras:
        if isinstance(extra, mcap.Metadata):
            writer.add_metadata(extra.name, extra.metadata)
        else:
            writer.add_attachment(extra.create_time, extra.log_time, extra.name, extra.media_type, extra.data)
    numbers: dict[int, int] = {}
    for _, message in result.messages():
        if result.topic(message) is None:
            continue
        if message.channel_id not in numbers:
            channel = result.channels[message.channel_id]
            schema = result.schemas.get(channel.schema_id)
            number = writer.register_schema(schema.name, schema.encoding, schema.data) if schema else 0
            numbers[message.channel_id] = writer.register_channel(
                channel.topic, channel.message_encoding, number, channel.metadata
            )
        number = numbers[message.channel_id]
        writer.add_message(number, message.log_time, message.data, message.publish_time, message.sequence)
    writer.finish()  # type: ignore[no-untyped-call]
