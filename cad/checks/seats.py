"""Whether the head of every screw has a hole under it and material around that hole, by rays on the parts' meshes.

A joint is a record and the cuts of its part are another: this check finds where they do not agree.
"""

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.checks.access import Body, circle
from scanwright.cad.checks.table import SEATED_SHARE, SLOT_SHARE
from scanwright.cad.layout.joints import Joint
from scanwright.cad.screws import passing_hole
from scanwright.design.arrays import Array
from scanwright.design.findings import Finding
from scanwright.design.scene.ray_caster import cast

BAND_MM = 1.0  # above and below the place of a head: seats of washers, and round ones


def seat_checks(assembly: Assembly) -> list[Finding]:
    """Return an error for each joint with a screw without hole or seat in its part; if there is none, one finding."""
    findings = []
    for joint in assembly.layout.joints:
        if joint.part not in assembly.made or joint.fixing == "grub":
            continue
        hole_mm = passing_hole(joint.screw, assembly.layout.scanner.printer)
        shares = seat_shares(joint, Body(assembly.mesh(joint.part)), hole_mm)
        without = np.flatnonzero(shares < (SEATED_SHARE if joint.slot_mm is None else SLOT_SHARE))
        if len(without):
            found = f"{shares.min():.0%} of the seat of its head" if shares.min() > 0 else "no hole, or no seat"
            message = f"{joint.part} on {joint.onto}: {len(without)} of {joint.count} {joint.screw.name}: {found}"
            findings.append(Finding("screw_seat", "error", joint.part, message, float(len(without)), 0.0))
    message = "screws: every head has a hole in its part, and material around it"
    return findings or [Finding("screw_seat", "ok", "screws", message, 0.0, 0.0)]


def seat_shares(joint: Joint, body: Body, hole_mm: float) -> Array:
    """Return for each screw of a joint the share of its head that bears on a body; 0 if the body closes the hole.

    Args:
        joint: the screws.
        body: that the heads bear on.
        hole_mm: diameter of the holes.
    """
    radius = (hole_mm + joint.screw.head_diameter) / 4  # the middle of what bears
    shares = []
    for axis in joint.axes:
        along = np.array(axis.along)
        starts = axis.start - BAND_MM * along + np.concatenate([np.zeros((1, 3)), circle(along, radius)])
        hits_mm = 1000 * cast(body.scene, starts / 1000, np.broadcast_to(along, starts.shape)).range_m
        closed = hits_mm[0] < BAND_MM + joint.grip_mm
        shares.append(0.0 if closed else np.mean(hits_mm[1:] < 2 * BAND_MM))
    return np.array(shares)
