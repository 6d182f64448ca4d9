"""The posture of the robot of a URDF; apart from its geometry, so that a task is read without scipy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

SUFFIX = ".urdf"


@dataclass(frozen=True, slots=True)
class Posture:
    """The posture of a robot."""

    joint_deg: Mapping[str, float] = field(default_factory=dict)  # joint that turns -> its angle; 0 for the others
    joint_mm: Mapping[str, float] = field(default_factory=dict)  # joint that slides -> its length; 0 for the others
    frame: str = ""  # link in whose frame the triangles are; empty for the root
    omit: tuple[str, ...] = ()  # links without geometry, such as the scanner's own


AS_IT_IS = Posture()
