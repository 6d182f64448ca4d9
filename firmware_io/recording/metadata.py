"""Metadata of a recording: a metadata record of MCAP, or a latched text message of JSON in a bag.

Unusable input raises RecordingError.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Final

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.foreign import foreign
from scanwright.firmware_io.recording.mcap_chunks import read_note

if TYPE_CHECKING:
    from scanwright.firmware_io.recording.bags import Bag

NOTE: Final = "scanwright"
NOTE_TOPIC: Final = "/scanwright/note"
NOTE_TYPE: Final = "std_msgs/msg/String"


def rests_in_scans(note: dict[str, str]) -> bool:
    """Whether the motor rested during each scan."""
    return note.get("hold") == "true"


def note_in(bag: Bag) -> dict[str, str]:
    """Return the note of a recording, or of a bag exported from one; empty for others."""
    if bag.path.suffix == ".mcap" and bag.path.is_file() and (note := read_note(bag.path, NOTE)):
        return note
    if bag.topics.get(NOTE_TOPIC) != NOTE_TYPE:
        return {}
    what = f"{bag.path}: {NOTE_TOPIC}: not the note of a recording"
    for message in bag.messages({NOTE_TOPIC}):
        note = foreign(what, json.loads, message.body.data)
        if not isinstance(note, dict):
            raise RecordingError(f"{what}: {message.body.data[:40]}")
        return note
    return {}
