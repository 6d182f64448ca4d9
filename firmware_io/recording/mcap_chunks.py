"""Messages of an MCAP file (https://mcap.dev/spec), read and written a chunk at a time.

The `mcap` package reads the summary and unpacks chunks; records inside a chunk are split here, because its reader is
slow. Unusable input raises RecordingError.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Collection, Iterator, Mapping
from contextlib import closing, suppress
from functools import lru_cache
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import Any, BinaryIO, Final

from mcap.data_stream import ReadDataStream
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.records import Chunk, ChunkIndex
from mcap.stream_reader import get_chunk_data_stream
from mcap.summary import Summary
from mcap.writer import Writer

from scanwright.design.concurrency.ahead import ahead
from scanwright.design.errors import RecordingError, made_by
from scanwright.firmware_io.foreign import foreign

NOTE: Final = "scanwright"  # name of the metadata record with the origin of a recording
CHUNK_S = 0.25  # duration of a chunk, the largest loss of one damage
_RUN_BYTES = 1_000_000  # unpacked; smaller chunks are unpacked together
_MAGIC = b"\x89MCAP"
_MESSAGE = 0x05  # opcode of a message (MCAP specification, Message)
_RECORD = struct.Struct("<BQ")  # opcode, length
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time

_Timed = tuple[int, int, str, bytes]  # log time [ns], place of the chunk, topic, bytes


class TimedChunks(Writer):
    """Writer that ends a chunk if a message is `CHUNK_S` before or after the first one of its topic."""

    def __init__(self, stream: Any) -> None:
        super().__init__(stream)
        self._first_ns: dict[int, int] = {}  # of each channel in the chunk

    def add_message(self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0) -> None:
        """As `Writer`."""
        if abs(log_time - self._first_ns.get(channel_id, log_time)) >= CHUNK_S * 1e9:
            self.flush()  # type: ignore[no-untyped-call]
            self._first_ns.clear()
        self._first_ns.setdefault(channel_id, log_time)
        super().add_message(channel_id, log_time, data, publish_time, sequence)


def read_topics(path: Path) -> dict[str, str]:
    """Return the message type of each topic in a file."""
    with _opened(path) as stream:
        summary = _summary(path, stream)
    return {channel.topic: summary.schemas[channel.schema_id].name for channel in summary.channels.values()}


def read_note(path: Path) -> dict[str, str]:
    """Return the note of a recording, its metadata record `scanwright`; empty for other files."""
    with _opened(path) as stream:
        records = foreign(f"{path}: damaged", lambda: list(SeekingReader(stream).iter_metadata()))
    return next((record.metadata for record in records if record.name == NOTE), {})


def rests_in_scans(note: Mapping[str, str]) -> bool:
    """Whether the motor rested during each scan of a recording."""
    return note.get("hold") == "true"


def read_messages(path: Path, topics: Collection[str], *, summed: bool = True) -> Iterator[tuple[str, bytes]]:
    """Yield topic and bytes of each message in the order of log times.

    Only chunks that overlap in time are in memory; the next ones are unpacked meanwhile. `summed`: verify checksums.
    """
    with _opened(path) as stream:
        summary = _summary(path, stream)
        selected = {key: channel.topic for key, channel in summary.channels.items() if channel.topic in topics}
        chunks = sorted(
            (chunk for chunk in summary.chunk_indexes if not selected.keys().isdisjoint(chunk.message_index_offsets)),
            key=lambda chunk: (chunk.message_start_time, chunk.chunk_start_offset),
        )
        waiting = [] if summary.chunk_indexes else foreign(f"{path}: damaged", _unchunked, stream, topics)

        def unpack(run: list[ChunkIndex]) -> list[list[_Timed]]:
            return [foreign(f"{path}: damaged", _chunk, stream, chunk, selected, summed) for chunk in run]

        with closing(ahead(unpack, _runs(chunks))) as unpacked:
            for chunk, messages in zip(chunks, chain.from_iterable(unpacked), strict=True):
                ready = [message for message in waiting if message[0] < chunk.message_start_time]
                yield from (message[2:] for message in ready)
                waiting = waiting[len(ready) :] + messages
                waiting.sort(key=itemgetter(0, 1))  # stable: keeps the order in a chunk
        yield from (message[2:] for message in waiting)


def _opened(path: Path) -> BinaryIO:
    if not path.is_file():
        what = "this is a folder, not a recording" if path.is_dir() else f"no such file{made_by(path)}"
        raise RecordingError(f"{path}: {what}")
    stream = foreign(f"{path}: cannot read", path.open, "rb")
    magic = stream.read(len(_MAGIC))
    if magic != _MAGIC:
        stream.close()
        raise RecordingError(f"{path}: {'not an MCAP file; `scanwright import` converts bags' if magic else 'empty'}")
    stream.seek(0)
    return stream


def _summary(path: Path, stream: BinaryIO) -> Summary:
    status = os.fstat(stream.fileno())
    return _summary_of(path, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=1)  # 2,400 chunks in ten minutes, and opening a recording needs them four times
def _summary_of(path: Path, _size: int, _changed_ns: int) -> Summary:
    what = f"{path}: the recording was cut off (`scanwright repair` mends it)"
    with _opened(path) as stream:
        summary = foreign(what, lambda: SeekingReader(stream).get_summary())
    if summary is None:
        raise RecordingError(what)
    for channel in summary.channels.values():
        if channel.schema_id not in summary.schemas:
            raise RecordingError(f"{path}: {channel.topic} has no type in the index: `scanwright repair` mends it")
    return summary


def _runs(chunks: list[ChunkIndex]) -> Iterator[list[ChunkIndex]]:
    """Group small chunks, since passing one to another thread takes as long as unpacking it."""
    run: list[ChunkIndex] = []
    for chunk in chunks:
        run.append(chunk)
        if sum(each.uncompressed_size for each in run) >= _RUN_BYTES:
            yield run
            run = []
    if run:
        yield run


def _chunk(stream: BinaryIO, index: ChunkIndex, selected: dict[int, str], summed: bool) -> list[_Timed]:
    stream.seek(index.chunk_start_offset + _RECORD.size)
    unpacked, size = get_chunk_data_stream(Chunk.read(ReadDataStream(stream)), validate_crc=summed)
    data = unpacked.read(size)
    messages = []
    at = 0
    while at < size:
        opcode, length = _RECORD.unpack_from(data, at)
        at += _RECORD.size
        if opcode == _MESSAGE:
            channel, _, log_ns, _ = _MESSAGE_HEAD.unpack_from(data, at)
            if channel in selected:
                body = data[at + _MESSAGE_HEAD.size : at + length]
                messages.append((log_ns, index.chunk_start_offset, selected[channel], body))
        at += length
    return messages


def _unchunked(stream: BinaryIO, topics: Collection[str]) -> list[_Timed]:
    """Read all messages of a file without chunks, which has no index."""
    stream.seek(0)
    messages = NonSeekingReader(stream).iter_messages(topics=list(topics), log_time_order=True)
    return [(message.log_time, 0, channel.topic, message.data) for _, channel, message in messages]


def unchunked_messages(path: Path, topics: Collection[str]) -> list[tuple[int, str, bytes]] | None:
    """Return times [ns], topics and data of the messages of a file without chunks, by time; None if it has chunks."""
    with _opened(path) as stream:
        if _summary(path, stream).chunk_indexes:
            return None
        messages = foreign(f"{path}: damaged", _unchunked, stream, topics)
    return [(log_ns, topic, data) for log_ns, _, topic, data in messages]


def profile_of(path: Path) -> str:
    """Return the profile in the header of an MCAP file, such as ros2; empty if it has none or cannot be read."""
    with path.open("rb") as stream, suppress(Exception):
        return str(NonSeekingReader(stream).get_header().profile)
    return ""
