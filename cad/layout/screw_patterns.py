"""Hole patterns of bought devices and of the deck that the joints use, as seen on the device. Millimetres."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.names import DECK, LIDAR_BODY, RING_STATOR, SERVO_CASE, SERVO_HORN, SERVO_OUTPUT
from scanwright.cad.screws import Screw
from scanwright.design.arrays import Array

DEVICES = (LIDAR_BODY, SERVO_HORN, SERVO_OUTPUT, SERVO_CASE, RING_STATOR, DECK)


@dataclass(frozen=True, slots=True)
class ScrewPattern:
    """Equal screws in one face of a device."""

    device: str  # body that has the holes
    part: str  # that is screwed to it
    screw: Screw  # the size
    places: tuple[tuple[float, float], ...]  # middle of each hole for a viewer who looks at the face, about the origin
    origin: str  # description of (0, 0)


def screw_patterns(joints: Sequence[Joint], R_rot_lidar: Array) -> list[ScrewPattern]:
    """Return the patterns in the order of `DEVICES`, each once; R_rot_lidar has shape (3, 3)."""
    patterns: dict[ScrewPattern, None] = {}
    for device in DEVICES:
        for joint in joints:
            if device not in (joint.part, joint.onto) or joint.fixing == "grub":
                continue
            for along in dict.fromkeys(axis.along for axis in joint.axes):  # a face each
                in_face = replace(joint, axes=tuple(axis for axis in joint.axes if axis.along == along))
                patterns[_pattern(in_face, device, R_rot_lidar if device == LIDAR_BODY else np.eye(3))] = None
    return list(patterns)


def _pattern(joint: Joint, device: str, axes: Array) -> ScrewPattern:
    towards = -np.array(joint.axes[0].along)  # the viewer looks along the screws
    right = next(axis - (axis @ towards) * towards for axis in axes.T if abs(axis @ towards) < 0.9)
    right /= np.linalg.norm(right)
    places = np.array([axis.start for axis in joint.axes]) @ np.stack([right, np.cross(towards, right)], axis=1)
    on_axis = device in (LIDAR_BODY, SERVO_HORN) and abs(abs(axes[:, 2] @ towards) - 1) < 1e-6
    if not on_axis:
        places -= (places.min(axis=0) + places.max(axis=0)) / 2
    origin = {LIDAR_BODY: "the optical axis", SERVO_HORN: "the axis of the horn"}[device] if on_axis else "the middle"
    rounded = tuple((float(x), float(y)) for x, y in np.round(places, 3) + 0.0)
    other = joint.part if device == joint.onto else joint.onto
    return ScrewPattern(device, other, joint.screw, rounded, origin)
