"""Holes of a bought device, and which of them a part can be screwed to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import Field

from scanwright.design.files.record import Record

Face = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Kind = Literal["tapped", "through", "self_tapping", "case_screw", "pin", "slot"]
Size = Literal["M1.6", "M2", "M2.5", "M3", "M4", "M5", "M6", "M8"]
Point = tuple[float, float, float]

USABLE: tuple[Kind, ...] = ("tapped", "self_tapping", "through")
"""Kinds that may carry a load: never the screws that close a case, locating pins, or slots."""
OLD_LIDAR = ("mount_screw", "mount_holes_mm", "mount_thread_depth_mm")
OLD_SERVO = ("case_screw", "case_holes_mm", "case_holes_z_mm", "case_rear_holes_mm", "case_rear_holes_z_mm")
"""Fields of version 0.1 that stated the holes."""
CASE_EAR_MM = 2.0  # of a servo's case between a through hole and its nut, if no source states it


class Hole(Record):
    """One hole, in the frame of its device; mm.

    Attributes:
        at_mm: middle of its mouth, in the face that a part lies on.
        axis: out of the device, towards that part: a face, or a vector.
        kind: tapped, self_tapping, through (the nut, or the head, is on the far side), or one that carries no load.
        size: of the screw.
        depth_mm: of the thread, or of the material around a through hole.
        head_space_mm: of a through hole: free height for a nut or a head on the far side.
    """

    at_mm: Point
    axis: Face | Point
    kind: Kind
    size: Size
    depth_mm: float = Field(gt=0)
    head_space_mm: float | None = Field(default=None, gt=0)


@dataclass(frozen=True, slots=True)
class HolePattern:
    """Equal holes in one plane, for one part."""

    screw: Size  # size of the screws
    kind: Kind  # of the holes
    places: tuple[tuple[float, float], ...]  # x and y of each
    z_mm: float  # of the plane
    depth_mm: float  # of the thread, or of the material around a through hole


def mounting_holes(holes: Iterable[Hole], face: Face) -> HolePattern:
    """Return the largest set of equal, usable holes in one plane of a face; without places if there is none."""
    groups: dict[tuple[Size, Kind, float], list[Hole]] = {}
    for hole in holes:
        if hole.axis == face and hole.kind in USABLE:
            groups.setdefault((hole.size, hole.kind, hole.at_mm[2]), []).append(hole)
    if not groups:
        return HolePattern("M3", "tapped", (), 0.0, 0.0)
    (size, kind, z), chosen = max(groups.items(), key=lambda group: len(group[1]))
    places = tuple((hole.at_mm[0], hole.at_mm[1]) for hole in chosen)
    return HolePattern(size, kind, places, z, min(hole.depth_mm for hole in chosen))


def what_holds(holes: Iterable[Hole]) -> str:
    """Return the number of holes of each kind and face as text."""
    counts: dict[tuple[str, str, str], int] = {}
    for hole in holes:
        face = hole.axis if isinstance(hole.axis, str) else "an oblique face"
        key = (hole.size, hole.kind.replace("_", " "), face)
        counts[key] = counts.get(key, 0) + 1
    return ", ".join(f"{n} x {size} {kind} in {face}" for (size, kind, face), n in counts.items()) or "none"


def with_holes(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a product file with `holes` in place of the fields of version 0.1.

    A table that has `holes`, or not all of the old fields, is not changed. The holes are verified if their places and
    their size are.
    """
    old = OLD_LIDAR if table.get("kind") == "lidar" else OLD_SERVO
    entries = [table.get(field) for field in old]
    if "holes" in table or not all(isinstance(entry, dict) and "value" in entry for entry in entries):
        return dict(table)
    values = [entry["value"] for entry in entries if isinstance(entry, dict)]
    if table["kind"] == "lidar":
        screw, places, depth = values
        holes = _in_face(places, 0.0, "-z", kind="tapped", size=screw, depth_mm=depth)
    else:
        screw, front, front_z, rear, rear_z = values
        ear = {"kind": "through", "size": screw, "depth_mm": CASE_EAR_MM}
        holes = [*_in_face(front, front_z, "+z", **ear), *_in_face(rear, rear_z, "-z", **ear)]
    sources = dict.fromkeys(entry.get("source") for entry in entries if isinstance(entry, dict))
    placing = [entries[old.index(field)] for field in old if field != "mount_thread_depth_mm"]
    stated = {
        "value": holes,
        "source": "; ".join(str(source) for source in sources),
        "verified": all(entry.get("verified") is True for entry in placing if isinstance(entry, dict)),
    }
    return {field: entry for field, entry in table.items() if field not in old} | {"holes": stated}


def _in_face(places: Any, z: Any, face: Face, **alike: Any) -> list[dict[str, Any]]:
    return [{"at_mm": [*place, z], "axis": face, **alike} for place in places]
