"""Heads of screws, and their ends with nuts, as bodies: what turns past them must stay clear."""

import math
from collections.abc import Iterator

import manifold3d
import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.geometry.mesh import TriMesh, of_manifold
from scanwright.cad.layout.joints import Joint
from scanwright.design.arrays import Array

SIDES = 24


def screw_ends(assembly: Assembly, *, turning: bool) -> dict[str, TriMesh]:
    """Return heads and nuts of the joints whose part turns about the axis, or of the others, by joint; mm."""
    turns = assembly.turning()
    return {
        f"screws of {joint.part} in {joint.onto}": of_manifold(manifold3d.Manifold.compose(list(_ends(joint))))
        for joint in assembly.layout.joints
        if joint.fixing != "grub" and (joint.part in turns) == turning
    }


def _ends(joint: Joint) -> Iterator[manifold3d.Manifold]:
    """Yield a cylinder for each head, and for each nut with the end of its screw."""
    screw, under_nut = joint.screw, joint.grip_mm + joint.thread_mm
    for axis in joint.axes:
        start, along = np.array(axis.start), np.array(axis.along)
        yield _cylinder(start - screw.head_height * along, along, screw.head_height, screw.head_diameter / 2)
        if joint.fixing == "nut":
            over_corners = screw.nut_across / math.sqrt(3)
            yield _cylinder(start + under_nut * along, along, joint.length_mm - under_nut, over_corners)


def _cylinder(start: Array, along: Array, length: float, radius: float) -> manifold3d.Manifold:
    across = np.linalg.svd(along[None])[2][1:]
    if np.linalg.det([*across, along]) < 0:
        across = across[::-1]
    placed = np.column_stack([*across, along, start])
    return manifold3d.Manifold.cylinder(length, radius / math.cos(math.pi / SIDES), -1.0, SIDES).transform(placed)
