"""`scanwright repair`: a recording that was cut off becomes a whole one with every message that is whole.

An MCAP file is a chain of records; a live recording is one chunk of messages after another, and its index comes last.
So the records are read from the front, what stands in chunks whose checksum holds is copied, and a new index is made.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Channel, Chunk, Footer, Header, McapRecord, Message, MessageIndex, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import Writer

from design.atomic_file import whole_file
from design.errors import RecordingError
from firmware_io.foreign import foreign


@dataclass(slots=True)
class RepairSummary:
    """What is left of a recording; `repair` fills it while it reads.

    Attributes:
        messages: topic -> whole messages.
        lost_messages: messages in damaged chunks, where the file still tells how many.
        damaged_chunks: chunks whose checksum does not hold.
        lost_bytes: size of the damaged chunks and of the cut-off end.
        times_ns: log times of the first and of the last message.
        closed: the file ends as it should.
    """

    messages: Counter[str] = field(default_factory=Counter)
    lost_messages: int = 0
    damaged_chunks: int = 0
    lost_bytes: int = 0
    times_ns: tuple[int, int] = (2**63, 0)
    closed: bool = False

    @property
    def whole(self) -> bool:
        """There is nothing to repair."""
        return self.closed and not self.lost_bytes

    def lines(self, path: Path, out: Path) -> list[str]:
        """What was found in the recording `path` and written to `out`, in words."""
        first_ns, last_ns = self.times_ns
        kept = " and ".join(f"{count:,} messages of {topic}" for topic, count in sorted(self.messages.items()))
        found = f"{path}: {kept}, {(last_ns - first_ns) / 1e9:.1f} s"
        if self.whole:
            return [found, "it is whole: nothing to repair, nothing written"]
        chunks = f"{self.damaged_chunks} damaged chunks, {self.lost_messages:,} messages known to be lost"
        return [found, f"left out {self.lost_bytes:,} bytes that are not whole ({chunks})", f"wrote {out}"]


def repair(path: Path, out: Path) -> RepairSummary:
    """Write all that is whole in the recording `path` to `out`, which may be the same file; a whole one is left alone.

    Raises:
        RecordingError: the file cannot be read, is no MCAP file, or holds not one whole message.
    """
    if not path.is_file():
        raise RecordingError(f"{path}: {'this is a folder, not a recording' if path.is_dir() else 'no such file'}")
    if out != path and out.suffix != ".mcap":
        raise RecordingError(f"{out}: a recording is an MCAP file; name it {out.with_suffix('.mcap').name}")
    summary = RepairSummary()
    for _ in _whole_records(path, summary):
        pass
    if not summary.messages:
        raise RecordingError(f"{path}: no whole message in it, there is nothing to save (is it an MCAP recording?)")
    if not summary.whole:
        with whole_file(out, RecordingError) as part, foreign(f"{out}: cannot write", part.open, "wb") as stream:
            copy = _Copy(Writer(stream))
            for record in _whole_records(path, RepairSummary()):
                copy.add(record)
            copy.finish()
    return summary


def _whole_records(path: Path, summary: RepairSummary) -> Iterator[McapRecord]:
    """The records that carry content, from the front to the first that cannot be read."""
    size = path.stat().st_size
    channels: dict[int, str] = {}
    good_bytes, damaged = 0, False
    with foreign(f"{path}: cannot read", path.open, "rb") as stream:
        try:
            for record in StreamReader(stream, emit_chunks=True, record_size_limit=size).records:
                inside = _inside(record)
                if isinstance(record, MessageIndex):
                    summary.lost_messages += len(record.records) if damaged else 0
                else:
                    damaged = False
                if isinstance(record, Chunk) and not inside:
                    damaged = True
                    summary.damaged_chunks += 1
                    summary.lost_bytes += len(record.data)
                for item in inside:
                    if isinstance(item, Channel):
                        channels[item.id] = item.topic
                    if isinstance(item, Message):
                        if item.channel_id not in channels:  # its channel stood in a damaged chunk
                            summary.lost_messages += 1
                            continue
                        first, last = summary.times_ns
                        summary.messages[channels[item.channel_id]] += 1
                        summary.times_ns = min(first, item.log_time), max(last, item.log_time)
                    yield item
                summary.closed = isinstance(record, Footer)
                good_bytes = stream.tell()
        except Exception:  # a cut-off record fails in a dozen ways: whatever it is, the whole part ends here
            summary.lost_bytes += size - good_bytes


def _inside(record: McapRecord) -> list[McapRecord]:
    if not isinstance(record, Chunk):
        return [record]
    try:
        return breakup_chunk(record, validate_crc=True)
    except Exception:  # bytes that are not what was written, in whatever way
        return []


class _Copy:
    """Content records written anew, schemas and channels under ids of their own."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}

    def add(self, record: McapRecord) -> None:
        match record:
            case Header():
                self._writer.start(record.profile, record.library)
            case Metadata():
                self._writer.add_metadata(record.name, record.metadata)
            case Attachment():
                self._writer.add_attachment(
                    record.create_time, record.log_time, record.name, record.media_type, record.data
                )
            case Schema() if record.id not in self._schemas:
                self._schemas[record.id] = self._writer.register_schema(record.name, record.encoding, record.data)
            case Channel() if record.id not in self._channels:
                schema = self._schemas[record.schema_id]
                self._channels[record.id] = self._writer.register_channel(
                    record.topic, record.message_encoding, schema, record.metadata
                )
            case Message():
                channel = self._channels[record.channel_id]
                self._writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)

    def finish(self) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
