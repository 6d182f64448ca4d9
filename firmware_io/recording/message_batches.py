"""Batches of messages as arrays: those that differ only in time and measurement are one block of bytes.

One message of a block is decoded; the others have the same length, and the same bytes between their numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from scanwright.design.arrays import Bytes, Floats, Times
from scanwright.firmware_io.recording.ros_messages import (
    LASER_SCAN,
    decode_joint,
    decode_message,
    decode_scan,
    encode_joint,
    scan_from_message,
    stamp_ns,
)
from scanwright.firmware_io.samples import Block, blocks

_LITTLE_ENDIAN = 1  # second byte of a message
_STAMP = slice(4, 12)  # of any message with a header
_TIME = np.dtype([("sec", "<i4"), ("nanosec", "<u4")])
_POSITION = slice(-16, -8)  # of a message of `encode_joint`, before two empty sequences


def blocks_in(messages: Sequence[bytes]) -> Iterator[Block]:
    """Yield blocks of LaserScan messages in CDR with one layout, as views; an exception for other messages."""
    for (length, order), run in groupby(messages, lambda data: (len(data), data[1])):
        listed = list(run)
        if order != _LITTLE_ENDIAN or length % 4:  # of other recorders; slower
            yield from blocks(map(decode_scan, listed))
            continue
        rows = np.frombuffer(b"".join(listed), np.uint8).reshape(len(listed), length)
        while len(rows):
            message = decode_message(listed[-len(rows)], LASER_SCAN)
            lit = slice(length - 4 * message.intensities.size, length)
            ranges = slice(lit.start - 4 - 4 * message.ranges.size, lit.start - 4)
            # before the ranges are seven numbers, whose largest bearing is redundant and whose time between scans may
            # vary, and the number of ranges
            begin = ranges.start - 32
            shared = (
                slice(_STAMP.stop, begin + 4),
                slice(begin + 8, begin + 16),
                slice(begin + 20, ranges.start),
                slice(ranges.stop, lit.start),
            )
            differs = np.any([(rows[:, place] != rows[0, place]).any(axis=1) for place in shared], axis=0)
            alike, rows = np.split(rows, [int(np.argmax(differs)) or len(rows)])
            first = scan_from_message(message, stamp_ns(message.header.stamp))
            intensity = _numbers(alike, lit, "<f4")[:, : first.intensity.size]
            yield Block(first, _times(alike), _numbers(alike, ranges, "<f4"), intensity)


def joints_in(messages: Sequence[bytes]) -> tuple[Times, Floats]:
    """Return times [ns] and positions [rad] of the spin joint, NaN if absent; an exception for other messages."""
    own = np.frombuffer(encode_joint(0, 0.0), np.uint8)
    if all(len(data) == own.size for data in messages):
        rows = np.frombuffer(b"".join(messages), np.uint8).reshape(-1, own.size)
        fixed = np.ones(own.size, bool)
        fixed[_STAMP] = fixed[_POSITION] = False
        if (rows[:, fixed] == own[fixed]).all():
            return _times(rows), _numbers(rows, _POSITION, "<f8")[:, 0]
    pairs = [decode_joint(data) for data in messages]
    return np.array([time_ns for time_ns, _ in pairs], np.int64), np.array([angle for _, angle in pairs])


def _numbers(rows: Bytes, place: slice, kind: DTypeLike) -> np.ndarray[Any, Any]:
    return rows[:, place].view(kind)


def _times(rows: Bytes) -> Times:
    stamp = _numbers(rows, _STAMP, _TIME)[:, 0]
    return stamp["sec"].astype(np.int64) * 1_000_000_000 + stamp["nanosec"]
