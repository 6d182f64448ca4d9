"""Reading of intact records in a damaged MCAP file (https://mcap.dev/spec)."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import lz4.frame
import numpy as np
import zstandard
from mcap import records as mcap
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

RECORD_HEAD = struct.Struct("<BQ")  # opcode, length
_CHUNK_HEAD = struct.Struct("<QQQII")  # first and last time, size, checksum, length of the compression's name
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, begin of the summary, of its offsets, checksum
_BLOCK = 1 << 20  # bytes searched together
_SIP = 1 << 12  # packed bytes per step, which unpack to at most 32,768 times as many
_MOST_UNPACKED = 1 << 30  # bytes; chunks of recorders have some MB
_PACKED = {"zstd": b"\x28\xb5\x2f\xfd", "lz4": b"\x04\x22\x4d\x18", "": b""}  # compression -> first bytes
_READ: dict[int, Callable[[Any], Any]] = {
    Opcode.HEADER: mcap.Header.read,
    Opcode.FOOTER: mcap.Footer.read,
    Opcode.SCHEMA: mcap.Schema.read,
    Opcode.CHANNEL: mcap.Channel.read,
    Opcode.CHUNK: mcap.Chunk.read,
    Opcode.MESSAGE_INDEX: mcap.MessageIndex.read,
    Opcode.CHUNK_INDEX: mcap.ChunkIndex.read,
    Opcode.ATTACHMENT: mcap.Attachment.read,
    Opcode.ATTACHMENT_INDEX: mcap.AttachmentIndex.read,
    Opcode.STATISTICS: mcap.Statistics.read,
    Opcode.METADATA: mcap.Metadata.read,
    Opcode.METADATA_INDEX: mcap.MetadataIndex.read,
    Opcode.SUMMARY_OFFSET: mcap.SummaryOffset.read,
    Opcode.DATA_END: mcap.DataEnd.read,
}


@dataclass(frozen=True, slots=True)
class IntactChunk:
    """Packed bytes in the file whose checksum is valid."""

    begin: int
    end: int
    packing: str
    doubtful: bool  # whether one bit is wrong, of the checksum or of the last four bytes


def record_at(data: memoryview, at: int) -> tuple[Any, int]:
    """Return the record at a place, None if it cannot be read completely; and its end, by its length."""
    if at + RECORD_HEAD.size > len(data):
        return None, len(data)
    opcode, length = RECORD_HEAD.unpack_from(data, at)
    begin, end = at + RECORD_HEAD.size, at + RECORD_HEAD.size + length
    if end > len(data) or (opcode not in _READ and opcode != Opcode.MESSAGE):
        return None, end
    stream = _Exact(BytesIO(data[begin:end].tobytes()))
    try:
        record = mcap.Message.read(stream, max(length, 22)) if opcode == Opcode.MESSAGE else _READ[opcode](stream)
    except Exception:  # invalid bytes raise many types
        return None, end
    # the reader of attachments skips their checksum only if there is one
    return (record if stream.count == length else None), end


class _Exact(ReadDataStream):
    """Stream that raises EOFError instead of returning fewer bytes than requested."""

    def read(self, length: int) -> bytes:
        data = super().read(length)
        if len(data) != length:
            raise EOFError
        return data


def index_at_the_end(data: memoryview) -> tuple[list[Any], int]:
    """Return records and start of a valid summary; otherwise none, and the end of the file."""
    at = len(data) - len(MCAP0_MAGIC) - _FOOTER.size
    if at < 0:
        return [], len(data)
    opcode, _, begin, _, checksum = _FOOTER.unpack_from(data, at)
    if opcode != Opcode.FOOTER or not 0 < begin <= at:
        return [], len(data)
    if checksum and zlib.crc32(data[begin : at + _FOOTER.size - 4]) != checksum:
        return [], len(data)
    records, place = [], begin
    while place < at:
        record, place = record_at(data, place)
        if record is None:
            return [], len(data)
        records.append(record)
    return (records, begin) if place == at else ([], len(data))


def chunk_at(data: memoryview, at: int, end: int, noted: mcap.ChunkIndex | None) -> IntactChunk | None:
    """Return the chunk at a place if its checksum is valid, even with a damaged head."""
    if at + RECORD_HEAD.size + _CHUNK_HEAD.size > len(data):
        return None
    checksum = _CHUNK_HEAD.unpack_from(data, at + RECORD_HEAD.size)[3]
    for packing in _PACKED:
        begin = at + RECORD_HEAD.size + _CHUNK_HEAD.size + len(packing) + 8
        ends = [end, begin + int.from_bytes(data[begin - 8 : begin].tobytes(), "little")]
        ends += [at + noted.chunk_length] if noted else []
        for until in sorted(
            {until for until in ends if begin <= until <= len(data)} | ({len(data)} if packing else set())
        ):
            unpacked, stop = unpacked_at(data, begin, until, packing)
            off = (zlib.crc32(unpacked) ^ checksum).bit_count() if checksum else 0
            if stop and off <= 1 and (checksum or all(record is not None for _, record in inside_of(unpacked))):
                return IntactChunk(begin, stop, packing, doubtful=bool(off))
    return None


def unpacked_at(data: memoryview, begin: int, end: int, packing: str) -> tuple[bytes, int]:
    """Return the unpacked bytes, and the end of the packed ones in the file; no bytes and 0 if damaged."""
    if data[begin : begin + len(_PACKED[packing])].tobytes() != _PACKED[packing]:
        return b"", 0
    if not packing:
        return data[begin:end].tobytes(), end
    reader = zstandard.ZstdDecompressor().decompressobj() if packing == "zstd" else lz4.frame.LZ4FrameDecompressor()
    chunks, size, at = [], 0, begin
    try:
        while at < end and not reader.eof and size <= _MOST_UNPACKED:
            chunks.append(reader.decompress(data[at : min(at + _SIP, end)].tobytes()))
            size, at = size + len(chunks[-1]), min(at + _SIP, end)
    except Exception:  # damaged bytes raise many types
        return b"", 0
    return (b"".join(chunks), at - len(reader.unused_data or b"")) if reader.eof else (b"", 0)


def inside_of(unpacked: bytes) -> Iterator[tuple[int, Any]]:
    """Yield the records of a chunk (None for unreadable ones), and their places in it."""
    data, at = memoryview(unpacked), 0
    while at < len(data):
        record, end = record_at(data, at)
        yield at, record
        at = end


def fits(record: Any, noted: mcap.ChunkIndex | None, messages: Counter[tuple[int, int, int]]) -> bool:
    """Whether the head of a chunk agrees with its content."""
    if not isinstance(record, mcap.Chunk):
        return False
    times = [time_ns for _, time_ns, _ in messages] or [0]
    span_ns = (record.message_start_time, record.message_end_time)
    return span_ns == (min(times), max(times)) and (
        noted is None or noted.uncompressed_size == record.uncompressed_size
    )


def next_record(data: memoryview, at: int, expected_end: int, noted: mcap.ChunkIndex | None) -> int:
    """Return the place of the next readable record; the end of the file without one."""
    if noted:
        return min(at + noted.chunk_length, len(data))
    if _begins(data, expected_end):
        return expected_end
    octets = np.frombuffer(data, np.uint8)
    for block in range(at + 1, len(data) - RECORD_HEAD.size, _BLOCK):
        part = octets[block : block + _BLOCK + RECORD_HEAD.size - 1]
        count = len(part) - RECORD_HEAD.size + 1
        could = (part[:count] > 0) & (part[:count] <= Opcode.DATA_END)
        for byte in range(5, RECORD_HEAD.size):  # records are below 4 GB
            could &= part[byte : byte + count] == 0
        for place in np.flatnonzero(could):
            if _begins(data, block + int(place)):
                return block + int(place)
    return len(data)


def _begins(data: memoryview, at: int) -> bool:
    """Whether two consecutive records can be read here, or one and the end of the file."""
    record, end = record_at(data, at)
    if record is None:
        return at == len(data)
    return end in (len(data), len(data) - len(MCAP0_MAGIC)) or record_at(data, end)[0] is not None


def sealed(data: memoryview, at: int, end: int) -> bool:
    """Whether the checksum of an attachment is valid or absent."""
    checksum = int.from_bytes(data[end - 4 : end].tobytes(), "little")
    return checksum in (0, zlib.crc32(data[at + RECORD_HEAD.size : end - 4]))
