"""Conversion of clouds that are larger than the memory; unusable input raises RecordingError."""

from __future__ import annotations

from pathlib import Path

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.clouds.formats import Written, cloud_module
from scanwright.firmware_io.clouds.streams.parts import Again, Parts, survey
from scanwright.firmware_io.foreign import foreign_items, of_file

STREAM_BYTES = 250_000_000  # smallest file that is streamed
ROWS = 500_000  # in memory


def stream(source: Path, target: Path, *, least_bytes: int = STREAM_BYTES, rows: int = ROWS) -> Written | None:
    """Convert a large cloud in bounded memory; None if it is small, organised, or of a format that is not streamed.

    Files from `least_bytes` on are streamed, `rows` points at a time.
    """
    reader, writer = cloud_module(source), cloud_module(target)
    if not (hasattr(reader, "parts") and hasattr(writer, "write_parts")) or not source.is_file():
        return None
    if source.stat().st_size < least_bytes:
        return None
    with of_file(source):
        parts: Parts | None = reader.parts(source, rows)
    if parts is None:
        return None
    several = len(parts.clouds) > 1
    paths = [target.with_stem(f"{target.stem}_{k}") if several else target for k in range(1, len(parts.clouds) + 1)]
    total, notes = 0, list(parts.notes)
    for number, (path, again) in enumerate(zip(paths, parts.clouds, strict=True), 1):
        flat = _flat(source, again)
        known = survey(flat())
        if known is None:
            raise RecordingError(f"{target}: none of the rows of cloud {number} is a point")
        notes += writer.write_parts(path, known, flat())
        total += known.rows
    return Written(tuple(paths), total, tuple(dict.fromkeys(notes)))


def _flat(source: Path, again: Again) -> Again:
    return lambda: (part.flat() for part in foreign_items(f"{source}: damaged", again()))
