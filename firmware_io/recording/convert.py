"""Files of one kind into files of another: clouds among each other, recordings into other people's bags."""

from __future__ import annotations

from pathlib import Path

from scanwright.firmware_io.clouds.formats import check_target, read_clouds, write_clouds
from scanwright.firmware_io.clouds.streams.stream import stream
from scanwright.firmware_io.recording.bag_export import export_bag


def convert(source: Path, target: Path, *, organised: bool = False) -> list[str]:
    """Turn a cloud into another format, or a recording into a bag; return what was done, in words.

    Large clouds without rows and columns are converted in parts, in bounded memory.

    Args:
        source: a cloud, or a recording (`.mcap`).
        target: a cloud; or a bag, `.bag` for ROS 1, else a new folder for ROS 2.
        organised: keep the rows without a point of an organised cloud, in formats that do not define them too.

    Raises:
        InstallError: a format needs the extra `clouds`, which is not installed.
        RecordingError: `source` is unreadable, its form is not known, or `target` cannot be written.
    """
    if source.suffix == ".mcap":
        exported = export_bag(source, target)
        unknown = [f"note: left out {topic}: this ROS has no {kind}" for topic, kind in exported.unknown.items()]
        written = ", ".join(f"{count:,} of {topic}" for topic, count in exported.written.items())
        return [*unknown, f"wrote {written} to {target}"]
    check_target(target)
    unread: list[str] = []
    wrote = None if organised else stream(source, target)
    if wrote is None:
        clouds, unread = read_clouds(source)
        wrote = write_clouds(target, clouds, organised=organised)
    notes = [f"note: {line}" for line in (*unread, *wrote.notes)]
    return [*notes, f"wrote {wrote.rows:,} rows to {', '.join(str(path) for path in wrote.paths)}"]
