"""Survey of the intact and lost parts of a damaged recording."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import Any

from mcap import records as mcap
from mcap.writer import MCAP0_MAGIC

from scanwright.firmware_io.recording.repair.salvage import (
    RECORD_HEAD,
    IntactChunk,
    chunk_at,
    fits,
    index_at_the_end,
    inside_of,
    next_record,
    record_at,
    sealed,
    unpacked_at,
)

_LEAST_GAP_NS = 50_000_000  # shorter ones are rounded to 0.0 s
_MOST_LISTED = 8  # gaps


@dataclass(slots=True)
class RepairSummary:
    """Content and damage of a recording.

    Attributes:
        messages: intact ones by topic.
        lost_messages: damaged ones, if the file has their number.
        damaged_chunks: with a wrong checksum.
        lost_bytes: of unreadable records, damaged chunks included.
        repaired: other damage that a repair corrects.
        times_ns: log times of the first and the last message.
        missing_ns: known log times before and after lost messages.
    """

    messages: Counter[str] = field(default_factory=Counter)
    lost_messages: int = 0
    damaged_chunks: int = 0
    lost_bytes: int = 0
    repaired: Counter[str] = field(default_factory=Counter)
    times_ns: tuple[int, int] = (2**64, 0)
    missing_ns: list[tuple[int, int]] = field(default_factory=list)

    def misses(self, before_ns: int, after_ns: int) -> None:
        """Add a gap between messages of these times; 0 if one is unknown."""
        if before_ns and after_ns - before_ns >= _LEAST_GAP_NS:
            self.missing_ns.append((before_ns, after_ns))

    @property
    def intact(self) -> bool:
        """Whether there is no damage."""
        return not (self.lost_bytes or self.lost_messages or self.repaired)

    def lines(self, path: Path, out: Path) -> list[str]:
        """Format the content of `path` and the repair to `out`."""
        first_ns, last_ns = self.times_ns
        counts = " and ".join(f"{count:,} messages of {topic}" for topic, count in sorted(self.messages.items()))
        result = [f"{path}: {counts}, {(last_ns - first_ns) / 1e9:.1f} s"]
        if self.intact:
            return [*result, "it is whole: nothing to repair, nothing written"]
        if self.lost_bytes or self.lost_messages:
            chunks = f"{self.damaged_chunks} damaged chunks, {self.lost_messages:,} messages known to be lost"
            result.append(f"left out {self.lost_bytes:,} bytes that are not whole ({chunks})")
            result += self._missing()
        else:
            result.append("every message is whole")
        if self.repaired:
            result.append(
                f"made anew: {', '.join(f'{what} ({count})' for what, count in sorted(self.repaired.items()))}"
            )
        return [*result, f"wrote {out}"]

    def _missing(self) -> list[str]:
        """Format the gaps, with times since the first message."""
        if not self.missing_ns:
            return []
        begin_ns = min(self.times_ns[0], self.missing_ns[0][0])
        gaps = [
            f"{(after_ns - before_ns) / 1e9:.1f} s missing at {(before_ns - begin_ns) / 1e9:.1f} s"
            for before_ns, after_ns in self.missing_ns[:_MOST_LISTED]
        ]
        if len(self.missing_ns) > _MOST_LISTED:
            all_s = sum(after_ns - before_ns for before_ns, after_ns in self.missing_ns) / 1e9
            gaps.append(f"and so on: {len(self.missing_ns)} gaps, {all_s:.1f} s in all")
        return [", ".join(gaps)]


class Survey:
    """Intact records of a file, and their places; after damage, the next readable record is searched."""

    def __init__(self, data: memoryview) -> None:
        self.summary = RepairSummary()
        self.header: mcap.Header | None = None
        self.schemas: dict[int, mcap.Schema] = {}
        self.channels: dict[int, mcap.Channel] = {}
        self.extras: list[mcap.Metadata | mcap.Attachment] = []
        self.announced = 0  # number of messages by the index at the end
        self.summary_ns = 0, 0  # log times of the first and the last message by the index at the end
        self.lost_at: list[int] = []  # places of lost bytes, increasing
        self._data = data
        self._chunks: list[IntactChunk] = []
        self._loose: list[tuple[int, int]] = []  # begin and end of messages outside of chunks
        self._repaired = self.summary.repaired
        self._closed = False
        self._due: Counter[tuple[int, int, int]] | None = None  # expected message indexes of the last chunk
        index, self._end = index_at_the_end(data)
        self._noted = {record.chunk_start_offset: record for record in index if isinstance(record, mcap.ChunkIndex)}
        for record in index:
            if isinstance(record, mcap.Statistics):
                self.announced = record.message_count
                self.summary_ns = (record.message_start_time, record.message_end_time)
        self._learn(index)
        unsure: list[Any] = []
        at = len(MCAP0_MAGIC)
        while at < self._end:
            at = self._take(at, unsure)
        self._learn(unsure)
        if self._chunks or self.summary.damaged_chunks:  # in a file with chunks, loose messages are unverified
            self.summary.lost_bytes += sum(end - at for at, end in self._loose)
            self._loose.clear()
        self._repaired["the index at the end"] += not index
        ends = data[: len(MCAP0_MAGIC)].tobytes(), data[-len(MCAP0_MAGIC) :].tobytes()
        self._repaired["the first or last bytes"] += ends != (MCAP0_MAGIC, MCAP0_MAGIC)
        self._repaired["the end of the data"] += bool(index) and not self._closed
        self._repaired["the header"] += self.header is None
        self.summary.repaired = +self._repaired

    def topic(self, message: mcap.Message) -> str | None:
        """Return the topic of a message, if its topic and type are known."""
        channel = self.channels.get(message.channel_id)
        return channel.topic if channel and (not channel.schema_id or channel.schema_id in self.schemas) else None

    def messages(self) -> Iterator[tuple[int, mcap.Message]]:
        """Yield the place of the chunk of each intact message, and the message, in the order of the file."""
        places: list[tuple[int, IntactChunk | None]] = [(chunk.begin, chunk) for chunk in self._chunks]
        places += [(at, None) for at, _ in self._loose]
        for at, chunk in sorted(places, key=itemgetter(0)):
            if chunk is None:
                yield at, record_at(self._data, at)[0]
                continue
            unpacked, _ = unpacked_at(self._data, chunk.begin, chunk.end, chunk.packing)
            sure = len(unpacked) - 4 * chunk.doubtful
            for place, item in inside_of(unpacked):
                if isinstance(item, mcap.Message) and place + RECORD_HEAD.size + 22 + len(item.data) <= sure:
                    yield at, item

    def _learn(self, records: Iterable[Any]) -> None:
        """Add schemas and channels, the first of each number."""
        for record in records:
            if isinstance(record, mcap.Schema):
                self.schemas.setdefault(record.id, record)
            elif isinstance(record, mcap.Channel):
                self.channels.setdefault(record.id, record)

    def _take(self, at: int, unsure: list[Any]) -> int:
        """Process the record at a place; return the place of the next one."""
        record, end = record_at(self._data, at)
        noted = self._noted.get(at)
        chunk = chunk_at(self._data, at, end, noted) if record is None or isinstance(record, mcap.Chunk) else None
        if self._due is not None and not isinstance(record, mcap.MessageIndex):
            self._repaired["indexes of chunks"] += self._due.total() != 0
            self._due = None
        if chunk is not None:
            self._chunk(chunk, record, noted)
            return chunk.end
        if record is None:
            end = min(next_record(self._data, at, end, noted), self._end)
            self._lose(at, end, chunk=noted is not None)
        elif isinstance(record, mcap.Chunk):
            self._lose(at, end, chunk=True)
        elif isinstance(record, mcap.MessageIndex):
            self._message_index(record)
        elif isinstance(record, mcap.Message):
            # a message has no checksum: after one of a damaged length no record begins, but others begin inside it
            known = record_at(self._data, end)[0] is not None
            begins = end if known else next_record(self._data, at, at, None)
            if begins < end:
                self._lose(at, begins)
                return begins
            self._loose.append((at, end))
        elif isinstance(record, mcap.Attachment) and not sealed(self._data, at, end):
            self.summary.lost_bytes += end - at
        elif isinstance(record, mcap.Attachment | mcap.Metadata):
            self.extras.append(record)
        elif isinstance(record, mcap.Header) and self.header is None:
            self.header = record
        else:
            if isinstance(record, mcap.DataEnd):
                self._closed = record.data_section_crc in (0, zlib.crc32(self._data[:at]))
            unsure.append(record)
        return end

    def _lose(self, at: int, end: int, *, chunk: bool = False) -> None:
        self.summary.damaged_chunks += chunk
        self.summary.lost_bytes += end - at
        self.lost_at.append(at)

    def _chunk(self, chunk: IntactChunk, record: Any, noted: mcap.ChunkIndex | None) -> None:
        inside = list(inside_of(unpacked_at(self._data, chunk.begin, chunk.end, chunk.packing)[0]))
        self._learn(item for _, item in inside)
        self._chunks.append(chunk)
        records = Counter(
            (item.channel_id, item.log_time, place) for place, item in inside if isinstance(item, mcap.Message)
        )
        self._due = records if noted is None or noted.message_index_offsets else None
        self._repaired["heads of chunks"] += chunk.doubtful or not fits(record, noted, records)

    def _message_index(self, record: mcap.MessageIndex) -> None:
        if self._due is None:
            self.summary.lost_messages += len(record.records)
            return
        indexed = Counter((record.channel_id, time_ns, place) for time_ns, place in record.records)
        self._repaired["indexes of chunks"] += bool(indexed - self._due)
        self._due -= indexed
