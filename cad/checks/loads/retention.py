"""Strength of every joint between lidar and deck. SI units.

Each joint is removed in turn: the bodies that then have no path to the deck load it with SHOCK_G times their weight, in
the worst direction for each screw; friction and preload are neglected. The bearing of a cage takes a share of the
rotor's load across the axis off the joints of shaft and servo, and loads those of the cage with it. Screws share a
force equally and carry a moment as a group of equal springs; radial screws of a hub or a boss carry no moment, their
fit does; a single screw keeps a foot from tipping over its edge. A joint that yields fails; a margin below LEAST_MARGIN
is a warning.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scanwright.cad.assembly.assembly import Assembly, lidar_body
from scanwright.cad.checks.table import at_least, tidy
from scanwright.cad.geometry import inertia
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.direct.cage import BearingCage, share_weight
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.loads import Weight
from scanwright.cad.layout.names import (
    BEARING_CAGE,
    DECK,
    LIDAR,
    LIDAR_BODY,
    SERVO_CASE,
    SERVO_HORN,
    SERVO_OUTPUT,
    TRIPOD,
)
from scanwright.cad.layout.tightening import (
    ALUMINIUM,
    BOUGHT,
    LEAST_MARGIN,
    MOULDED,
    PRINTED,
    SHOCK_G,
    STEEL,
    Hold,
    Material,
    hold_of,
)
from scanwright.design.arrays import Array
from scanwright.design.findings import Finding
from scanwright.design.frames import STANDARD_GRAVITY_M_S2, cross_matrix

ROUNDING_MM = 1e-6  # a thread that limits the preload engages by just the required length
AXIAL_COS = 0.9  # to the rotation axis, above which a screw does not point at it


def retention_checks(assembly: Assembly) -> list[Finding]:
    """Check margin and thread engagement of each joint."""
    return [check for joint in assembly.layout.joints for check in _of_joint(assembly, joint)]


def material_of(assembly: Assembly, body: str) -> Material:
    """Return the material of a made part or a bought body."""
    if body not in assembly.parts:
        scanner = assembly.layout.scanner
        servo = scanner.servo
        kinds = {
            SERVO_CASE: {servo.front.kind, servo.rear.kind},
            LIDAR_BODY: {held.kind for held in scanner.lidar.held.values()},
        }
        kinds |= {horn: {servo.horn_kind or "tapped"} for horn in (SERVO_HORN, SERVO_OUTPUT)}
        return MOULDED if "self_tapping" in kinds.get(body, ()) else BOUGHT
    process = assembly.parts[body].process
    if process == "printed":
        return PRINTED
    return STEEL if process == "sawn" else ALUMINIUM


def hanging_on(assembly: Assembly, joint: Joint) -> frozenset[str]:
    """Return the parts and products whose only path to the deck is a joint."""
    layout = assembly.layout
    links = [(assembly.thing(other.part), assembly.thing(other.onto)) for other in layout.joints if other != joint]
    links += layout.drive.borne
    everything = {name for link in links for name in link} | {assembly.thing(joint.part), assembly.thing(joint.onto)}
    reached, fresh = {DECK, TRIPOD}, {DECK, TRIPOD}
    while fresh:
        fresh = {b for link in links for a, b in (link, link[::-1]) if a in fresh} - reached
        reached |= fresh
    return frozenset(everything - reached)


def _of_joint(assembly: Assembly, joint: Joint) -> Iterator[Finding]:
    both, hanging = f"{joint.part} on {joint.onto}", hanging_on(assembly, joint)
    subject = f"{joint.part} and {joint.onto}"  # as the pictures of a report name them
    hold = hold_of(joint, material_of(assembly, joint.part), material_of(assembly, joint.onto))
    carries = LIDAR in hanging
    if hold is None:
        message = f"{both}: {joint.count} x {joint.number} hold by friction: they only keep it in place"
        yield Finding("retention", "error" if carries else "note", subject, message)
        return
    bare = joint.fixing == "thread" and not joint.inserts and material_of(assembly, joint.onto).plastic
    if bare and carries and joint.onto in assembly.parts:
        message = f"{both}: the lidar hangs on threads in bare plastic, which creeps"
        yield Finding("retention", "error", subject, message)
    yield _margin(assembly, joint, hold, hanging)
    yield _screws(joint, hold, subject)


def _margin(assembly: Assembly, joint: Joint, hold: Hold, hanging: frozenset[str]) -> Finding:
    body = together_of(assembly, hanging)
    force = SHOCK_G * STANDARD_GRAVITY_M_S2 * body.mass_kg
    shaft, cage = assembly.layout.drive.shaft, assembly.layout.drive.of(BearingCage)
    brace, bears = None, ""
    if cage is not None and (shaft in hanging) != (BEARING_CAGE in hanging):
        at, carried_kg = _borne(assembly, cage)
        share = carried_kg / body.mass_kg
        brace = at, -share if shaft in hanging else share
        bears = f", the bearing {'takes' if shaft in hanging else 'adds'} {share * force:.0f} N at its own height"
    pull, push = worst_shares(joint, body.centre_m, brace)
    margins = {hold.pull_by: hold.pull_n / (force * pull), hold.push_by: hold.push_n / (force * push)}
    first = min(margins, key=margins.__getitem__)
    nut = {"trap": " and nuts in it", "nut": " and nuts", "deck": " and nuts"}.get(joint.fixing, "")
    what = (
        f"{joint.count} x {joint.screw.name} into {joint.onto}{nut} carry {body.mass_kg:.2f} kg at {SHOCK_G:g} g "
        f"({force:.0f} N{bears}, worst direction, no friction); first yields {first}: margin"
    )
    check = at_least("retention", margins[first], LEAST_MARGIN, "times", joint.part, what)
    return replace(check, severity="warning") if 1 <= margins[first] < LEAST_MARGIN else check


def _screws(joint: Joint, hold: Hold, subject: str) -> Finding:
    tightened = f"tightened with {hold.torque_nm:g} N m ({hold.preload_n:.0f} N)"
    message = (
        f"{joint.part} on {joint.onto}: {joint.count} x {joint.number}: {hold.engaged_mm:.1f} mm of "
        f"{'thread' if hold.needed_mm else 'nut or insert'} (at least {hold.needed_mm:.1f}), "
        f"{'not tightened' if joint.loose else tightened}; cause of loosening: {hold.loosens}"
    )
    engaged = hold.engaged_mm >= hold.needed_mm - ROUNDING_MM
    value, limit = tidy(hold.engaged_mm), tidy(hold.needed_mm)
    return Finding("screw", "ok" if engaged else "error", subject, message, value, limit, "mm")


def together_of(assembly: Assembly, names: frozenset[str]) -> Inertial:
    """Return parts and products as one body; a product of which half turns counts in full on either side."""
    bodies = [assembly.inertial(name) for name in sorted(names & assembly.made.keys())]
    for each, mass_g, box in assembly.layout.drive.masses:
        if each.name in names or (each.turning > 0 and assembly.layout.drive.shaft in names):
            bodies.append(inertia.of_box(mass_g, *box))
    if LIDAR in names:
        bodies.append(lidar_body(assembly.layout.scanner.lidar).moved(assembly.layout.scanner.angles.T_rot_laser()))
    return inertia.together(bodies)


def _borne(assembly: Assembly, cage: BearingCage) -> tuple[Array, float]:
    """Return the middle of the bearing [m], shape (3,), and the mass [kg] that it carries across the axis."""
    stack = cage.stack
    horn = next(each for each in assembly.layout.joints if (each.part, each.onto) == (stack.shaft, SERVO_HORN))
    rotor = together_of(assembly, hanging_on(assembly, horn))
    across = Weight(rotor.mass_kg, 0.0, float(rotor.centre_m[2]) - stack.horn / 1000, 0.0)
    carried = share_weight(assembly.layout.scanner, stack, cage, across).bearing_force_n
    return np.array([0.0, 0.0, stack.bearing_middle / 1000]), carried


def worst_shares(joint: Joint, centre_m: Array, brace: tuple[Array, float] | None = None) -> tuple[float, float]:
    """Return the largest pull along and push across one screw by 1 N at a point, shape (3,), in any direction.

    `brace` is another point, at which a share of the newton's part across the axis acts in addition.
    """
    start = np.array([axis.start for axis in joint.axes]) / 1000
    along = np.array([axis.along for axis in joint.axes])
    middle = start.mean(axis=0)
    force, moment = np.eye(3), cross_matrix(centre_m - middle)
    if brace is not None:
        more = brace[1] * np.diag([1.0, 1.0, 0.0])
        force, moment = force + more, moment + cross_matrix(brace[0] - middle) @ more
    shares = np.broadcast_to(force / joint.count, (joint.count, 3, 3)).copy()
    if joint.heel_mm is not None and joint.count == 1:
        arm, heel = centre_m - start[0], joint.heel_mm / 1000
        aside = float(np.linalg.norm(arm - (arm @ along[0]) * along[0]))
        return float(np.hypot(1 + aside / heel, arm @ along[0] / heel)), 1.0
    if abs(along[0, 2]) > AXIAL_COS or not _radial(joint):
        arms = start - middle
        stiffness = sum((arm @ arm * np.eye(3) - np.outer(arm, arm) for arm in arms), np.zeros((3, 3)))
        turned = np.linalg.pinv(stiffness, rcond=1e-9) @ moment
        shares += np.array([-cross_matrix(arm) @ turned for arm in arms])
    pulls = np.linalg.norm(np.einsum("ni,nij->nj", along, shares), axis=1)
    if joint.heel_mm is not None:  # a pair: the edge and both screws carry the moment about its line
        line = start[1] - start[0]
        turning = line / np.linalg.norm(line) @ moment
        pulls = pulls + float(np.linalg.norm(turning)) / (2 * joint.heel_mm / 1000)
    across = shares - np.einsum("ni,nj,njk->nik", along, along, shares)
    return float(pulls.max()), float(np.linalg.norm(across, ord=2, axis=(1, 2)).max())


def _radial(joint: Joint) -> bool:
    """Return whether the screws point at the rotation axis, from around it."""
    return all(
        abs(axis.along[2]) < 1e-6 and abs(axis.start[0] * axis.along[1] - axis.start[1] * axis.along[0]) < 1e-6
        for axis in joint.axes
    )
