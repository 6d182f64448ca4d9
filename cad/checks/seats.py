"""Whether every screw has a hole through its part with material under the head, and one with material in what it holds.

A joint is a record and the cuts of the parts are others: this check finds where they do not agree. By rays on meshes.
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

HEAD_MM, THREAD_MM = 1.0, 2.0  # above and below a face: seats of washers, and round shafts with a flat
WALL_MM = 0.6  # from a thread's hole to the circle on which its face is looked for
FREE_MM = 2.0  # least depth of such a hole


def seat_checks(assembly: Assembly) -> list[Finding]:
    """Return an error for each joint with a screw without hole or face in a part; if there is none, one finding."""
    findings = []
    for joint in assembly.layout.joints:
        if joint.fixing == "grub":
            continue
        enough = SEATED_SHARE if joint.slot_mm is None else SLOT_SHARE
        hole_mm = passing_hole(joint.screw, assembly.layout.scanner.printer)
        head_mm = (hole_mm + joint.screw.head_diameter) / 2  # the middle of what bears
        thread_mm = (joint.screw.core if joint.thread is None else joint.thread.hole) + 2 * WALL_MM
        for part, circle_mm, at_mm, band_mm, free_mm, least in (
            (joint.part, head_mm, 0.0, HEAD_MM, joint.grip_mm, enough),
            (joint.onto, thread_mm, joint.grip_mm, THREAD_MM, min(FREE_MM, joint.thread_mm), SEATED_SHARE),
        ):
            if part in assembly.made:
                shares = face_shares(joint, Body(assembly.mesh(part)), circle_mm, at_mm, band_mm, free_mm)
                if (missing := int((shares < least).sum())) > 0:
                    found = (
                        f"{shares.min():.0%} of a face around its hole"
                        if shares.min() > 0
                        else "no hole, or no face around it,"
                    )
                    which = f"{missing} of {joint.count} {joint.screw.name}"
                    message = f"{joint.part} on {joint.onto}: {which}: {found} in {part}"
                    findings.append(Finding("screw_seat", "error", part, message, float(missing), 0.0))
    message = "screws: every one has its holes, and material around them"
    return findings or [Finding("screw_seat", "ok", "screws", message, 0.0, 0.0)]


def face_shares(joint: Joint, body: Body, circle_mm: float, at_mm: float, band_mm: float, free_mm: float) -> Array:
    """Return for each screw of a joint the share of a circle around it that is on a face; 0 if its hole is closed.

    Args:
        joint: the screws.
        body: with the face.
        circle_mm: diameter of the circle.
        at_mm: distance of the face from the place of the head.
        band_mm: by which the face may be higher or lower.
        free_mm: least depth of the hole below the face.
    """
    shares = []
    for axis in joint.axes:
        along = np.array(axis.along)
        around = np.concatenate([np.zeros((1, 3)), circle(along, circle_mm / 2)])
        starts = axis.start + (at_mm - band_mm) * along + around
        hits_mm = 1000 * cast(body.scene, starts / 1000, np.broadcast_to(along, starts.shape)).range_m
        closed = hits_mm[0] < band_mm + free_mm
        shares.append(0.0 if closed else np.mean(hits_mm[1:] < 2 * band_mm))
    return np.array(shares)
