"""Whether a driver reaches every screw in a straight line in the assembly step that needs it, by rays.

Also how long its blade must be, so that the hand and the handle that turn it are clear of all bodies. Bodies that turn
may be at any angle of the axis.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.scenes import StepScene, scenes_of
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.names import FIXED_CABLES, LIDAR_CABLE, ROTOR_LEADS
from scanwright.cad.screws import KEYS_MM
from scanwright.design.arrays import Array
from scanwright.design.findings import Finding
from scanwright.design.frames import Rz
from scanwright.design.scene import ray_caster

BY_HAND_MM = (3.0, 0.0)  # a screw of another size has a knob
RAYS = 12  # around the one along the screw's axis
OVER_HEAD_MM = 0.2
STEPS = 72  # angles of the axis
HANDLE_STEPS = 24  # the same, for the handle
HANDLE_MM = (
    15.0,
    20,
)  # radius and length that must be free behind the blade: torque screwdriver, or short arm; assumed
LONGEST_MM = 150  # of the blades that shops sell
PAST_MM = 1e-3  # behind a surface, so that a ray does not hit it again
NO_BLADES: Mapping[Joint, int] = MappingProxyType({})
ROUND_MM = 5  # blades are stated in multiples of it


@dataclass(frozen=True)
class Body:
    """A rigid body that may block a driver; its ray-casting scene is built when needed."""

    mesh: TriMesh

    @cached_property
    def scene(self) -> ray_caster.Scene:
        """Its triangles, ready to be hit."""
        return ray_caster.build_scene(self.mesh.vertices[self.mesh.faces] / 1000)

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Low and high corner [mm]."""
        return self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)

    def misses(self, starts: Array, directions: Array, length: float) -> bool:
        """Return whether all rays of a length are on one side of its box."""
        ends = np.stack([starts, starts + length * directions])
        low, high = self.box
        axes = tuple(range(ends.ndim - 1))
        return bool((ends.min(axis=axes) > high).any() or (ends.max(axis=axes) < low).any())

    def reach_mm(self, starts: Array, directions: Array, length: float) -> Array:
        """Return the shortest free length of each screw's rays, infinity beyond a length; shape (..., screws)."""
        if self.misses(starts, directions, length):
            return np.full(starts.shape[:-2], np.inf)
        rays = np.broadcast_to(directions, starts.shape)
        hits = ray_caster.cast(self.scene, starts.reshape(-1, 3) / 1000, rays.reshape(-1, 3))
        nearest = 1000 * hits.range_m.reshape(starts.shape[:-1]).min(axis=-1)
        return np.where(nearest < length, nearest, np.inf)

    def filled(self, starts: Array, directions: Array) -> Array:
        """Return which mm of a ray for each body are in it, or touch it; shape (..., mm), origins (..., 3)."""
        cells = np.arange(LONGEST_MM + HANDLE_MM[1])
        origins, rays = starts.reshape(-1, 3) / 1000, np.broadcast_to(directions, starts.shape).reshape(-1, 3)
        filled = np.zeros((len(rays), len(cells)), bool)
        if self.misses(starts, directions, len(cells)):
            return filled.reshape(*starts.shape[:-1], len(cells))
        at_mm, going = np.zeros(len(rays)), np.arange(len(rays))
        while going.size:
            hits = ray_caster.cast(self.scene, origins[going] + at_mm[going, None] / 1000 * rays[going], rays[going])
            hit = hits.triangle >= 0
            going, triangle, range_mm = going[hit], hits.triangle[hit], 1000 * hits.range_m[hit]
            end_mm = at_mm[going] + range_mm
            leaves = (self.scene.normals[triangle] * rays[going]).sum(axis=-1) > 0
            since_mm = np.where(leaves, at_mm[going], end_mm)[:, None]
            filled[going] |= (cells + 1 > since_mm) & (cells < end_mm[:, None])
            at_mm[going] = end_mm + PAST_MM
            going = going[end_mm < len(cells)]
        return filled.reshape(*starts.shape[:-1], len(cells))


@dataclass(frozen=True, slots=True)
class Blocked:
    """A screw that no driver reaches: its number in the joint, the blocking body, and its distance [mm]."""

    screw: int
    body: str
    after_mm: float


def access_checks(assembly: Assembly) -> list[Finding]:
    """Return an error for each joint with a screw that no driver reaches, or one finding that there is none."""
    bodies = _bodies(assembly)
    scenes = scenes_of(assembly)
    findings = [
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
    return findings or [Finding("driver_access", "ok", "screws", message, 0.0, 0.0)]


def blocked_screws(joint: Joint, present: Mapping[str, Body], turning: frozenset[str]) -> list[Blocked]:
    """Return the screws of a joint that no driver reaches past the present bodies; `turning` names those that turn."""
    starts, back = driver_rays(joint)
    length = _key_mm(joint)[1]
    moves = joint.part in turning
    nearest = {
        name: each.reach_mm(starts, back, length) for name, each in present.items() if (name in turning) == moves
    }
    others = {name: each for name, each in present.items() if (name in turning) != moves}
    if any(np.isfinite(each.reach_mm(starts, back, length)).any() for each in others.values()):
        turns = np.stack([Rz(2 * math.pi * k / STEPS) for k in range(STEPS)])[:, None, None]
        at_starts, at_back = ((turns @ rays[..., None])[..., 0] for rays in (starts, back))
        at = {name: each.reach_mm(at_starts, at_back, length) for name, each in others.items()}
        best = np.min(list(at.values()), axis=0).argmax(axis=0)
        nearest |= {name: reach[best, np.arange(joint.count)] for name, reach in at.items()}
    blocked = []
    for screw in range(joint.count):
        body = min(nearest, key=lambda name: float(nearest[name][screw]), default="")
        if body and math.isfinite(nearest[body][screw]):
            blocked.append(Blocked(screw + 1, body, float(nearest[body][screw])))
    return blocked


def blades_mm(assembly: Assembly) -> dict[Joint, int]:
    """Return the joints that need a longer blade than the long arm of their key, each with the length [mm]."""
    bodies, turning = _bodies(assembly), assembly.turning()
    needed = {
        joint: blade_mm(joint, {name: bodies[name] for name in (*scene.there, *scene.comes) if name in bodies}, turning)
        for scene in scenes_of(assembly)
        for joint, _ in scene.joints
    }
    return {joint: length for joint, length in needed.items() if length > _key_mm(joint)[1]}


def blade_in_words(length_mm: int) -> str:
    """Return the length of a blade that `blade_mm` has found."""
    return f"blade {length_mm} mm" if length_mm <= LONGEST_MM else f"blade over {LONGEST_MM} mm"


def blade_mm(joint: Joint, present: Mapping[str, Body], turning: frozenset[str]) -> int:
    """Return the least length of a blade for all screws of a joint, so that its handle is clear of all bodies.

    It is rounded up to `ROUND_MM`; one that is longer than `LONGEST_MM` is not found, and `LONGEST_MM + 1` returned.
    """
    starts, back = driver_rays(joint, (_key_mm(joint)[0], HANDLE_MM[0] / 2, HANDLE_MM[0]))
    moves = joint.part in turning
    together = [each for name, each in present.items() if (name in turning) == moves]
    others = [each for name, each in present.items() if (name in turning) != moves]
    turns = np.stack([Rz(2 * math.pi * k / HANDLE_STEPS) for k in range(HANDLE_STEPS)])[:, None, None]
    at_starts, at_back = ((turns @ rays[..., None])[..., 0] for rays in (starts, back))
    filled = _filled(together, starts, back) | _filled(others, at_starts, at_back)
    handle = sliding_window_view(filled.any(axis=-2), HANDLE_MM[1], axis=-1).any(axis=-1)
    blade = np.logical_or.accumulate(filled[..., : 1 + RAYS, : handle.shape[-1]].any(axis=-2), axis=-1)
    blocked = handle | blade  # angles of the axis, screws, mm
    first = np.where(blocked.all(axis=-1), LONGEST_MM, blocked.argmin(axis=-1)).min(axis=0).max()
    into = 0.0 if joint.fixing == "grub" else joint.screw.head_height
    length = ROUND_MM * math.ceil((first + into) / ROUND_MM)
    return length if length <= LONGEST_MM else LONGEST_MM + 1


def _filled(bodies: Sequence[Body], starts: Array, back: Array) -> Array:
    """Return which mm of the rays behind each screw are filled by bodies; shape (..., screws, rays, mm)."""
    none = np.zeros((*starts.shape[:-1], LONGEST_MM + HANDLE_MM[1]), bool)
    return np.any([none, *(each.filled(starts, back) for each in bodies)], axis=0)


def driver_rays(joint: Joint, radii: Sequence[float] = ()) -> tuple[Array, Array]:
    """Return starts [mm] of rays on a driver's axis and rim, shape (screws, rays, 3), and directions (screws, 1, 3).

    `radii` replace that of its rim.
    """
    over = OVER_HEAD_MM + (0.0 if joint.fixing == "grub" else joint.screw.head_height)
    starts, back = [], -np.array([axis.along for axis in joint.axes])
    for axis, along in zip(joint.axes, back, strict=True):
        rims = [circle(along, radius) for radius in radii or _key_mm(joint)[:1]]
        starts.append(axis.start + over * along + np.concatenate([np.zeros((1, 3)), *rims]))
    return np.stack(starts), back[:, None]


def _key_mm(joint: Joint) -> tuple[float, float]:
    return KEYS_MM.get(joint.screw.name, BY_HAND_MM)


def circle(axis: Array, radius: float) -> Array:
    """Return points of a circle about an axis through the origin, shape (RAYS, 3)."""
    turn = 2 * math.pi * np.arange(RAYS) / RAYS
    across = np.linalg.svd(axis[None])[2][1:]
    return radius * (np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1])


def _bodies(assembly: Assembly) -> dict[str, Body]:
    """Return all rigid bodies by name: a cable can be bent aside."""
    names = (*assembly.made, *assembly.bought)
    soft = {name for name in names if assembly.thing(name) in (ROTOR_LEADS, FIXED_CABLES)}
    soft |= {name for name in names if name.startswith(LIDAR_CABLE)}
    return {name: Body(assembly.mesh(name)) for name in names if name not in soft}


def _error(number: int, scene: StepScene, joint: Joint, blocked: Sequence[Blocked]) -> Finding:
    first = min(blocked, key=lambda each: each.after_mm)
    message = (
        f"{joint.part} on {joint.onto}: step {number} ({scene.step.title}): no straight line for the key of "
        f"{len(blocked)} of {joint.count} {joint.screw.name}: {first.body} blocks it {first.after_mm:.0f} mm away"
    )
    return Finding("driver_access", "error", joint.part, message, float(len(blocked)), 0.0)
