"""Beams that the parts block: rays against their meshes, and a lower bound in closed form.

A beam is a bundle: its middle and BEAM_RAYS on its rim, which widens with the distance. It is hidden if any ray is: a
beam that is partly blocked also returns from the own body.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from scanwright.cad.layout.hub import CROSS_SCREWS, Hub
from scanwright.cad.layout.placement import drive_of
from scanwright.design.arrays import Array, Mask
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner
from scanwright.design.scene import ray_caster
from scanwright.design.search.with_parts import Refused
from scanwright.design.self_occlusion import AXIS_STEPS, SelfOcclusion

if TYPE_CHECKING:
    from scanwright.cad.assembly.assembly import Assembly

APERTURE_M = 0.003  # radius of the beam at its exit: assumed, undocumented
SPREAD_RAD = 0.005  # half of the divergence: assumed likewise
BEAM_RAYS = 6


@dataclass(frozen=True, slots=True)
class PartsWorkshop:
    """The `Workshop` of the search, for one set of products: `scanner.angles` are replaced by each setting."""

    scanner: Scanner
    _made: dict[str, Assembly] = field(default_factory=dict, init=False, repr=False, compare=False)

    def bound(self, setting_rad: Array) -> SelfOcclusion | Refused:
        """Return the cone that ring, bearing and cage always hide."""
        try:
            stack = _highest(at_setting(self.scanner, setting_rad))
        except BuildError as error:
            return Refused(str(error))
        bearings = self.scanner.lidar.bearings_rad()
        return SelfOcclusion(beams_in_cone(stack, bearings), None)

    def shadow(self, setting_rad: Array) -> SelfOcclusion | Refused:
        """Return the shadow of the solids of that setting."""
        scanner = at_setting(self.scanner, setting_rad)
        try:
            assembly = self.assembly(scanner)
        except BuildError as error:
            return Refused(str(error))
        return shadow_of(scanner, triangles_of(assembly), assembly.turning())

    def assembly(self, scanner: Scanner) -> Assembly:
        """Return the parts of these products at the angles of `scanner`; they are made once."""
        from scanwright.cad.assembly.make import make_parts

        angles = scanner.angles
        key = f"{angles.angles_deg} {angles.delta_rotvec_rot_deg} {angles.t_rot_laser_mm}"
        if key not in self._made:
            self._made[key] = make_parts(scanner)
        return self._made[key]


def _highest(scanner: Scanner) -> Hub:
    """Return the stack with the largest cross screws: the higher the hub, the less do ring and bearing hide."""
    try:
        return drive_of(scanner, CROSS_SCREWS[-1]).stack
    except BuildError:
        return drive_of(scanner).stack


def triangles_of(assembly: Assembly) -> dict[str, Array]:
    """Return the corners [m] of every part that blocks beams, swept if it turns about another axis, shape (t, 3, 3)."""
    clear = {name for name, body in assembly.bodies.items() if body.clear}
    return {name: mesh.vertices[mesh.faces] / 1000 for name, mesh in assembly.outlines().items() if name not in clear}


def shadow_of(scanner: Scanner, triangles_m: Mapping[str, Array], turning: Container[str]) -> SelfOcclusion:
    """Return the beams that parts hide; triangles of `triangles_of`, `turning` names the parts that turn."""
    by_motion: dict[bool, list[Array]] = {True: [], False: []}
    for name, triangles in triangles_m.items():
        by_motion[name in turning].append(triangles)
    origins, directions = bundles(scanner)
    rotor = _hidden(ray_caster.build_scene(np.concatenate(by_motion[True])), origins, directions)
    return SelfOcclusion(rotor, _stator(np.concatenate(by_motion[False]), origins, directions))


def bundles(scanner: Scanner) -> tuple[Array, Array]:
    """Return starts [m] and directions of the rays of every beam, rotation frame at gamma = 0, shape (B, rays, 3)."""
    bearings = scanner.lidar.bearings_rad()
    R = scanner.angles.R_rot_laser()
    along = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)], axis=1) @ R.T
    across = np.stack([-np.sin(bearings), np.cos(bearings), np.zeros_like(bearings)], axis=1) @ R.T
    turn = 2 * np.pi * np.arange(BEAM_RAYS) / BEAM_RAYS
    rim = np.cos(turn)[None, :, None] * across[:, None, :] + np.sin(turn)[None, :, None] * R[:, 2]
    off = np.concatenate([np.zeros((len(bearings), 1, 3)), rim], axis=1)
    directions = along[:, None, :] + math.tan(SPREAD_RAD) * off
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    return APERTURE_M * off + scanner.angles.T_rot_laser()[:3, 3], directions


def beams_in_cone(stack: Hub, bearings_rad: Array) -> Mask:
    """Return the beams whose middle is in the cone about -z that ring, bearing and cage always hide."""
    q = stack.R()[2]
    down = -(q[0] * np.cos(bearings_rad) + q[1] * np.sin(bearings_rad))
    return np.asarray(down > math.cos(stack.sure_half_angle))


def _stator(triangles_m: Array, origins: Array, directions: Array) -> Mask:
    """Return the beams that fixed parts hide, shape (B, AXIS_STEPS); only rays that can reach these are cast."""
    corners = triangles_m.reshape(-1, 3)
    reach = np.hypot(corners[:, 0], corners[:, 1])
    widest = float(np.arctan2(reach, -corners[:, 2]).max())
    nearest = float(np.linalg.norm(corners, axis=1).min())
    margin = math.asin(min(1.0, float(np.linalg.norm(origins, axis=2).max()) / nearest))
    polar = np.arccos(np.clip(-directions[:, :, 2], -1.0, 1.0)).min(axis=1)
    near = np.flatnonzero(polar < widest + margin)
    hidden = np.zeros((len(directions), AXIS_STEPS), bool)
    solid = ray_caster.build_scene(triangles_m)
    for k in range(AXIS_STEPS):
        gamma = 2 * math.pi * k / AXIS_STEPS
        c, s = math.cos(gamma), math.sin(gamma)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
        hidden[near, k] = _hidden(solid, origins[near] @ turn, directions[near] @ turn)
    return hidden


def _hidden(solid: ray_caster.Scene, origins: Array, directions: Array) -> Mask:
    """Return whether any ray of each bundle meets the solid, shape (B,)."""
    hits = ray_caster.cast(solid, origins.reshape(-1, 3), directions.reshape(-1, 3))
    return np.asarray(np.isfinite(hits.range_m).reshape(directions.shape[:2]).any(axis=1))


def at_setting(scanner: Scanner, setting_rad: Array) -> Scanner:
    """Return the scanner at other angles, rounded as for the parts."""
    names = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")
    rounded = {name: round(math.degrees(angle), 2) for name, angle in zip(names, setting_rad, strict=True)}
    angles = scanner.angles.model_copy(
        update={
            "angles_deg": scanner.angles.angles_deg.model_copy(update=rounded),
            "t_world_rot_mm": (0.0, 0.0, 0.0),
        }
    )
    return replace(scanner, angles=angles)
