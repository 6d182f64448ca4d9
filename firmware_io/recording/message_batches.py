"""Batches of messages as arrays: those that differ only in time and measurement are one block of bytes.

The layout (byte order, lengths, shared numbers) is read from the first message and compared in the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from scanwright.design.arrays import Bytes, Floats, Ints, Times
from scanwright.firmware_io.recording.ros_messages import JointPlaces, ScanPlaces, decode_joint, decode_scan
from scanwright.firmware_io.samples import Block, Scan

_STAMP = 4  # seconds and nanoseconds, after the encapsulation


class ScanOutline(NamedTuple):
    """A batch of LaserScan messages without their measurements."""

    stamp_ns: Times
    beams: int  # of each
    has_intensity: bool


def outlines_in(messages: Sequence[bytes]) -> Iterator[ScanOutline]:
    """As `blocks_in`, without ranges."""
    for scan, places, rows in _alike_scans(messages):
        yield ScanOutline(_stamps(rows, places.order), scan.range_m.size, bool(scan.intensity.size))


def blocks_in(messages: Sequence[bytes]) -> Iterator[Block]:
    """Yield blocks of LaserScan messages in CDR with one layout; ValueError for other messages."""
    for scan, places, rows in _alike_scans(messages):
        yield Block(
            first=scan,
            stamp_ns=_stamps(rows, places.order),
            range_m=_numbers(rows, places.ranges, f"{places.order}f4").astype(np.float32, copy=False),
            intensity=_numbers(rows, places.intensities, f"{places.order}f4").astype(np.float32, copy=False),
        )


def _alike_scans(messages: Sequence[bytes]) -> Iterator[tuple[Scan, ScanPlaces, Bytes]]:
    """Yield the first scan, its layout and the bytes of each scan (rows) of batches with one layout."""
    for same_length in _runs(_lengths(messages)):
        rows = _rows(messages[same_length])
        done = 0
        while done < len(rows):
            first = messages[same_length.start + done]
            places = ScanPlaces.of(first)
            alike = _alike(rows[done:], places.shared)
            yield decode_scan(first), places, rows[done : done + alike]
            done += alike


def joints_in(messages: Sequence[bytes]) -> tuple[Times, Floats]:
    """Return times [ns] and positions [rad] of the spin joint, NaN if absent; ValueError for other messages."""
    lengths = _lengths(messages)
    time_ns, position_rad = np.empty(lengths.size, np.int64), np.empty(lengths.size)
    for length in set(lengths.tolist()):
        which = np.flatnonzero(lengths == length).tolist()
        rows, places = _rows([messages[i] for i in which]), JointPlaces.of(messages[which[0]])
        if places is not None and _alike(rows, places.shared) == len(rows):
            time_ns[which] = _stamps(rows, places.order)
            position_rad[which] = _numbers(rows, places.position, f"{places.order}f8")[:, 0]
        else:  # messages of several publishers with the same length
            for i in which:
                time_ns[i], position_rad[i] = decode_joint(messages[i])
    return time_ns, position_rad


def _rows(messages: Sequence[bytes]) -> Bytes:
    return np.frombuffer(b"".join(messages), np.uint8).reshape(len(messages), -1)


def _lengths(messages: Sequence[bytes]) -> Ints:
    return np.array([len(message) for message in messages], np.int64)


def _runs(values: Ints) -> Iterator[slice]:
    """Yield the slices of equal consecutive values."""
    ends = [*(np.flatnonzero(np.diff(values)) + 1).tolist(), values.size]
    yield from (slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True) if a < b)


def _alike(rows: Bytes, shared: Sequence[slice]) -> int:
    """Return the number of first rows with equal bytes in some places."""
    differs = np.zeros(len(rows), bool)
    for place in shared:
        differs |= (rows[:, place] != rows[0, place]).any(axis=1)
    return int(np.argmax(differs)) or len(rows)


def _numbers(rows: Bytes, place: slice, kind: str) -> np.ndarray:
    return np.ascontiguousarray(rows[:, place]).view(kind)


def _stamps(rows: Bytes, order: str) -> Times:
    seconds = _numbers(rows, slice(_STAMP, _STAMP + 4), f"{order}i4")[:, 0].astype(np.int64)
    return seconds * 1_000_000_000 + _numbers(rows, slice(_STAMP + 4, _STAMP + 8), f"{order}u4")[:, 0]
