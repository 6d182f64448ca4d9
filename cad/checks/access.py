"""Whether a driver reaches every screw in a straight line in the step of assembly that closes its joint: by rays.

A test of solids cannot see it: the driver is no part. What turns may stand at any angle of the axis.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.scenes import StepScene, scenes_of
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.names import FIXED_CABLES, LIDAR_CABLE, ROTOR_LEADS
from scanwright.design.arrays import Array
from scanwright.design.findings import Finding
from scanwright.design.frames import Rz
from scanwright.design.scene import ray_caster

# of a hexagon key: radius over its corners with some play, and length of its long arm (ISO 2936)
KEYS_MM = {
    "M1.6": (1.2, 46.5),
    "M2": (1.2, 46.5),
    "M2.5": (1.4, 52.0),
    "M3": (1.6, 58.5),
    "M4": (1.9, 66.0),
    "M5": (2.4, 74.0),
    "M6": (3.0, 85.0),
}
BY_HAND_MM = (3.0, 0.0)  # a screw of another size has a knob
RAYS = 12  # around the one along the screw's axis
OVER_HEAD_MM = 0.2
STEPS = 72  # angles of the axis


@dataclass(frozen=True, slots=True)
class Blocked:
    """A screw that no driver reaches: its number in the joint, the body in the way, and how far that is off [mm]."""

    screw: int
    body: str
    after_mm: float


def access_checks(assembly: Assembly) -> list[Finding]:
    """Return an error for each joint with a screw that no driver reaches, or one finding that there is none."""
    bodies = _bodies(assembly)
    scenes = scenes_of(assembly, assembly.layout.joints)
    found = [
        _error(number, scene, joint, blocked)
        for number, scene in enumerate(scenes, start=1)
        for joint, _ in scene.joints
        if (
            blocked := blocked_screws(
                joint,
                {name: bodies[name] for name in (*scene.there, *scene.comes) if name in bodies},
                assembly.turning(),
            )
        )
    ]
    count = sum(joint.count for scene in scenes for joint, _ in scene.joints)
    message = f"screws: a driver reaches all {count} of them in a straight line, in the step that needs it"
    return found or [Finding("driver_access", "ok", "screws", message, 0.0, 0.0)]


def blocked_screws(joint: Joint, present: Mapping[str, ray_caster.Scene], turning: frozenset[str]) -> list[Blocked]:
    """Return the screws of a joint that no driver reaches.

    Args:
        joint: its screws are driven from their heads' side.
        present: bodies that are there, by name.
        turning: names of those that turn about the axis.
    """
    starts, back = driver_rays(joint)
    length = KEYS_MM.get(joint.screw.name, BY_HAND_MM)[1]
    moves = joint.part in turning
    nearest = {name: _reach_mm(scene, starts, back) for name, scene in present.items() if (name in turning) == moves}
    others = {name: scene for name, scene in present.items() if (name in turning) != moves}
    if any((_reach_mm(scene, starts, back) < length).any() for scene in others.values()):
        turns = np.stack([Rz(2 * math.pi * k / STEPS) for k in range(STEPS)])[:, None, None]
        rays = np.broadcast_to(back, starts.shape)[..., None]
        at = {
            name: _reach_mm(scene, (turns @ starts[..., None])[..., 0], (turns @ rays)[..., 0])
            for name, scene in others.items()
        }
        best = np.min(list(at.values()), axis=0).argmax(axis=0)
        nearest |= {name: reach[best, np.arange(joint.count)] for name, reach in at.items()}
    blocked = []
    for screw in range(joint.count):
        body = min(nearest, key=lambda name: float(nearest[name][screw]), default="")
        if body and nearest[body][screw] < length:
            blocked.append(Blocked(screw + 1, body, float(nearest[body][screw])))
    return blocked


def driver_rays(joint: Joint) -> tuple[Array, Array]:
    """Return starts [mm] of rays on a driver's axis and rim, shape (screws, rays, 3), and directions (screws, 1, 3)."""
    radius = KEYS_MM.get(joint.screw.name, BY_HAND_MM)[0]
    over = OVER_HEAD_MM + (0.0 if joint.fixing == "grub" else joint.screw.head_height)
    turn = 2 * math.pi * np.arange(RAYS) / RAYS
    starts, back = [], -np.array([axis.along for axis in joint.axes])
    for axis, along in zip(joint.axes, back, strict=True):
        across = np.linalg.svd(along[None])[2][1:]
        rim = radius * (np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1])
        starts.append(axis.start + over * along + np.concatenate([np.zeros((1, 3)), rim]))
    return np.stack(starts), back[:, None]


def _reach_mm(scene: ray_caster.Scene, starts: Array, directions: Array) -> Array:
    """Return how far the nearest ray of each screw gets, shape of starts without the last two axes."""
    rays = np.broadcast_to(directions, starts.shape)
    hits = ray_caster.cast(scene, starts.reshape(-1, 3) / 1000, rays.reshape(-1, 3))
    return 1000 * hits.range_m.reshape(starts.shape[:-1]).min(axis=-1)


def _bodies(assembly: Assembly) -> dict[str, ray_caster.Scene]:
    """Return everything that is stiff and closed, by name: a cable can be held aside."""
    soft = {ROTOR_LEADS, FIXED_CABLES}
    stiff = [name for name in (*assembly.made, *assembly.bought) if assembly.thing(name) not in soft]
    return {
        name: ray_caster.build_scene(assembly.mesh(name).vertices[assembly.mesh(name).faces] / 1000)
        for name in stiff
        if not name.startswith(LIDAR_CABLE)
    }


def _error(number: int, scene: StepScene, joint: Joint, blocked: Sequence[Blocked]) -> Finding:
    first = min(blocked, key=lambda each: each.after_mm)
    message = (
        f"{joint.part} on {joint.onto}: step {number} ({scene.step.title}): no straight line for the key of "
        f"{len(blocked)} of {joint.count} {joint.screw.name}: {first.body} is in the way, {first.after_mm:.0f} mm away"
    )
    return Finding("driver_access", "error", joint.part, message, float(len(blocked)), 0.0)
