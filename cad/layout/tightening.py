"""Strength, tightening torque and loosening of the screws of a joint. No kernel.

Forces in N, stresses in MPa, lengths in mm, torques in N m. Screws are stainless steel A2-70 (ISO 3506-1), with nuts as
strong. Friction is neglected.
"""

import math
from dataclasses import dataclass

from scanwright.cad.layout.joints import Joint
from scanwright.cad.screws import INSERT_LENGTH, Screw

PROOF_MPA = 450.0  # 0.2 % proof stress of A2-70, ISO 3506-1
SHEARED = 0.577  # of a tension, von Mises
PRELOAD = 0.5  # of the proof load, between metals
NUT_FACTOR = 0.2  # torque over preload and diameter, dry: the usual estimate
FLANKS = 0.5  # of the cylinder at the nominal diameter that a thread shears off: makers' tables state 0.5 to 0.8
INSERT_N = 300.0  # pull-out of a heat-set insert: half of sellers' measurements for M3 in PLA, assumed
FRICTION = 0.15  # of plastic on metal or plastic, dry: the low end of measured values
SHOCK_G = 5.0  # bumps and transport: assumed
HELD_G = 2.0  # bumps that must not turn the mount: assumed
LEAST_MARGIN = 2.0  # over strengths that are makers' or assumed


@dataclass(frozen=True, slots=True)
class Material:
    """Material below a head or around a thread."""

    name: str  # for messages
    strength_mpa: float  # in tension, and under a head or behind a shank, during a shock
    pressure_mpa: float  # under a head, continuous
    plastic: bool  # whether it creeps
    source: str  # of both numbers


PRINTED = Material(
    "printed plastic", 40.0, 20.0, True, "PLA and PETG, makers' 45 to 60 MPa; after creep, warm; assumed"
)
ALUMINIUM = Material("aluminium 6082-T6", 290.0, 200.0, False, "EN 755-2; pressure under heads, VDI 2230")
STEEL = Material("steel", 360.0, 235.0, False, "S235, EN 10025-2")
BOUGHT = Material("metal of a bought device", 180.0, 120.0, False, "cast aluminium, the softest of its kind; assumed")

MOULDED = Material(
    "plastic of a bought device", 40.0, 20.0, True, "PBT and PA of servo cases, taken as printed; assumed"
)


@dataclass(frozen=True, slots=True)
class Hold:
    """Tightening and strength of one screw of a joint."""

    engaged_mm: float  # engaged thread
    needed_mm: float  # thread that carries 1.5 times its preload; 0 for a nut or an insert
    preload_n: float  # of the tightened screw
    torque_nm: float  # for this preload
    pull_n: float  # strength along its axis
    pull_by: str  # part that yields first
    push_n: float  # strength across its axis
    push_by: str  # part that yields first
    loosens: str  # cause of loosening, and remedy


def hold_of(joint: Joint, under: Material, into: Material) -> Hold | None:
    """Return the strength of one of a joint's screws; None for grub screws, which hold by friction.

    `under` is the material below its heads, `into` that of its threads, or of the body that carries nuts or inserts.
    """
    if joint.fixing == "grub":
        return None
    screw, hole = joint.screw, joint.screw.nominal + 0.4
    proof = PROOF_MPA * stress_area_mm2(screw)
    head, nut = _under_head_mm2(joint, hole), math.inf
    in_nut = joint.fixing in ("nut", "trap", "deck")
    engaged = screw.nut_height if in_nut else joint.length_mm - joint.grip_mm
    if in_nut and joint.protrudes_mm is not None:
        engaged = min(engaged, joint.protrudes_mm - joint.thread_mm)
    pulls = {"the screw": proof, f"{under.name} under the head": head * under.strength_mpa}
    if joint.inserts:
        engaged = min(engaged, INSERT_LENGTH)
        pulls["the insert"] = INSERT_N
    elif in_nut:
        nut = math.pi / 4 * (screw.nut_across**2 - hole**2)
        pulls[f"{into.name} under the nut"] = nut * into.strength_mpa
        floor = math.pi * screw.nut_across * joint.thread_mm
        pulls[f"{into.name} around the nut"] = SHEARED * floor * into.strength_mpa
    else:
        pulls[f"the thread in {into.name}"] = _strips(screw, engaged, into)
    lasting = min(head * under.pressure_mpa, nut * into.pressure_mpa)
    preload = min(PRELOAD * proof, lasting, min(pulls.values()) / 1.5)
    needed = 0.0 if in_nut or joint.inserts else 1.5 * preload / _strips(screw, 1.0, into)
    behind = screw.nominal * joint.grip_mm * under.strength_mpa
    pushes = {"the screw's shank": SHEARED * proof, f"{under.name} behind the shank": behind}
    pull_by, push_by = min(pulls, key=pulls.__getitem__), min(pushes, key=pushes.__getitem__)
    return Hold(
        engaged_mm=engaged,
        needed_mm=needed,
        preload_n=preload,
        torque_nm=float(f"{NUT_FACTOR * preload * screw.nominal / 1000:.2g}"),
        pull_n=pulls[pull_by],
        pull_by=pull_by,
        push_n=pushes[push_by],
        push_by=push_by,
        loosens=_loosens(joint, under, into),
    )


def _under_head_mm2(joint: Joint, hole: float) -> float:
    """Return the contact area of a head or washer, less the hole or the slot."""
    head = joint.washer_mm or joint.screw.head_diameter
    disc = math.pi / 4 * head**2
    if joint.slot_mm is None:
        return disc - math.pi / 4 * hole**2
    width = joint.slot_mm[0]
    return disc - width / 2 * math.sqrt(head**2 - width**2) - head**2 / 2 * math.asin(width / head)


def stress_area_mm2(screw: Screw) -> float:
    """Return the stress area of a coarse thread (ISO 898-1)."""
    return math.pi / 4 * (screw.nominal - 0.9382 * (screw.nominal - screw.core)) ** 2


def _strips(screw: Screw, engaged: float, into: Material) -> float:
    """Return the pull that strips the thread."""
    return FLANKS * math.pi * screw.nominal * engaged * SHEARED * into.strength_mpa


def _loosens(joint: Joint, under: Material, into: Material) -> str:
    if joint.protrudes_mm is not None:
        return f"it is only tightened by hand: check the {joint.part} before each use"
    creeps = "the plastic creeps: tighten once more after a day" if under.plastic or into.plastic else "vibration"
    if joint.inserts:
        return f"{creeps}; no threadlocker, it attacks plastics"
    if joint.fixing in ("nut", "trap", "deck"):
        return f"{creeps}; a drop of medium threadlocker in the nut"
    if into.plastic:
        return f"{creeps}; no threadlocker, it attacks plastics"
    return f"{creeps}; a drop of medium threadlocker in the thread of the metal"
