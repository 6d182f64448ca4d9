"""Conversion of clouds to other formats, and of recordings to bags."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from scanwright.firmware_io.clouds.formats import check_target, read_clouds, write_clouds
from scanwright.firmware_io.clouds.streams.stream import stream
from scanwright.firmware_io.clouds.text import decimal_points
from scanwright.firmware_io.recording.bag_export import export_bag


@dataclass(frozen=True, slots=True)
class Converted:
    """Result of a conversion.

    Attributes:
        files: written files or folder.
        rows: of the clouds; None for a recording.
        messages: topic -> number; None for a cloud.
        notes: data that the format cannot store, one sentence each.
    """

    files: tuple[Path, ...]
    rows: int | None
    messages: dict[str, int] | None
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """Format the result."""
        rows = f"{self.rows:,} rows" if self.rows is not None else ""
        messages = ", ".join(f"{count:,} of {topic}" for topic, count in (self.messages or {}).items())
        return [
            *(f"note: {note}" for note in self.notes),
            f"wrote {rows or messages} to {', '.join(map(str, self.files))}",
        ]


def convert(source: Path, target: Path, *, organised: bool = False, decimal_comma: bool = False) -> Converted:
    """Convert a cloud to another format, or a recording to a bag.

    Large clouds without rows and columns are converted in parts, in bounded memory.

    Args:
        source: a cloud, or a recording (`.mcap`).
        target: a cloud; or a bag, `.bag` for ROS 1, otherwise a new folder for ROS 2.
        organised: keep the rows without a point of an organised cloud, also in formats that do not define them.
        decimal_comma: the source is text with decimal commas.

    Raises:
        InstallError: a format requires the extra `clouds`, which is not installed.
        RecordingError: `source` is unreadable, its format is unknown, or `target` cannot be written.
    """
    if source.suffix == ".mcap":
        exported = export_bag(source, target)
        unknown = tuple(f"dropped {topic}: this ROS has no {kind}" for topic, kind in exported.unknown.items())
        return Converted((target,), None, exported.written, unknown)
    check_target(target)
    unread: list[str] = []
    with decimal_points(source) if decimal_comma else nullcontext(source) as readable:
        wrote = None if organised else stream(readable, target)
        if wrote is None:
            clouds, unread = read_clouds(readable)
            wrote = write_clouds(target, clouds, organised=organised)
    notes = (note.replace(str(readable), str(source)) for note in (*unread, *wrote.notes))
    return Converted(wrote.paths, wrote.rows, None, tuple(notes))
