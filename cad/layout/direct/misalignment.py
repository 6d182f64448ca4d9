"""Misalignment of bearing and servo axis, and its moment on the horn. No kernel.

Horn and bearing support the same shaft: misalignment bends its waist. Each tolerance is stated as the distance between
the sleeve's middle and the bearing's; the worst case is their sum, added to the weight. Not counted: play of the seat,
since the cage is tightened while the shaft is in the bearing; growth along the axis, since the sleeve slides in the
inner ring. Runout of horn, flange and shaft is one number, trued at the shaft's upper end.
"""

from dataclasses import dataclass, replace

from scanwright.cad.layout.direct.cage import BearingCage, stiffness_n_per_m
from scanwright.cad.layout.direct.loads import ALUMINIUM, STEEL, ShaftMetal, heaviest, supported
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.drive import Ears
from scanwright.cad.layout.loads import UNRATED_NM, Weight, rated_moment_nm
from scanwright.design.scanner import Scanner

TRUED_MM = 0.03  # on the indicator over a turn: the flange is tapped within the clearance of its screws
SLEEVE_MM = 0.04  # largest runout of the sleeve on the shaft: clearance of H7 on h6, and its own
INNER_RING_MM = 0.013  # Kia of a bearing of the normal class, 18 to 30 mm, ISO 492
SLEEVE_FIT_MM = 0.02  # largest clearance of g6 in the inner ring, on the diameter: ISO 286, ISO 492
BEARING_CLEARANCE_MM = 0.02  # most radial clearance of the normal group, 24 to 30 mm, ISO 5753-1
CAGE_SET_MM = 0.02  # that the cage springs off the sleeve's middle when its screws are tightened: assumed
WARMER_K = 20.0  # than when it was set
PLASTIC_GROWS_PER_K = 70e-6  # PLA and PETG; the case is taken not to grow
SHARE = 0.5  # of the horn's rating that the worst case may use
SURELY = 0.92  # of the allowed moment, while the mass of the rotor is an estimate
# the shaft's waist, each in the order of preference
WAIST_LENGTHS = (20.0, 24.0, 28.0, 32.0, 36.0, 40.0)
WAIST_DIAMETERS = tuple(tenths / 10 for tenths in range(70, 44, -1))


@dataclass(frozen=True, slots=True)
class Contribution:
    """One cause of a moment on the horn, at its worst."""

    what: str  # its name
    off_mm: float | None  # distance between sleeve and bearing; None for the weight
    moment_nm: float  # on the horn


def offsets_mm(ears: Ears) -> dict[str, float]:
    """Return the distance between the middles of sleeve and bearing by each tolerance."""
    from_axis = abs(sum(y for _, y in ears.holes)) / len(ears.holes)
    return {
        f"shaft trued to {TRUED_MM:g} over a turn": TRUED_MM / 2,
        "sleeve on the shaft": SLEEVE_MM / 2,
        "runout of the inner ring": INNER_RING_MM / 2,
        "sleeve in the inner ring": SLEEVE_FIT_MM / 2,
        "clearance of the bearing": BEARING_CLEARANCE_MM / 2,
        "cage as it is set": CAGE_SET_MM,
        f"cage {WARMER_K:g} K warmer": PLASTIC_GROWS_PER_K * WARMER_K * from_axis,
    }


def contributions(cage: BearingCage, weight: Weight, metal: ShaftMetal = ALUMINIUM) -> list[Contribution]:
    """Return moments on the horn of a scanner with a bearing, the weight first."""
    stack = cage.stack
    shared = supported(weight, stack, stiffness_n_per_m(stack, cage.ears), metal)
    off = offsets_mm(cage.ears)
    return [
        Contribution("weight", None, shared.horn_moment_nm),
        *(Contribution(what, mm, mm / 1000 * shared.misaligned_nm_per_m) for what, mm in off.items()),
    ]


def worst_moment_nm(cage: BearingCage, weight: Weight) -> dict[str, float]:
    """Return the sum of all contributions by metal."""
    return {
        metal.name: sum(each.moment_nm for each in contributions(cage, weight, metal)) for metal in (ALUMINIUM, STEEL)
    }


def with_waist(scanner: Scanner, stack: DirectStack, ears: Ears) -> DirectStack:
    """Return the stack with a waist that the horn bears in every metal and that a stalled servo does not twist off.

    Of every length the thickest sufficient diameter, of the lengths the shortest: a low cage is stiff. If none is
    sufficient, the longest strong one is used, and the check `tilt_moment` fails.
    """
    rated = rated_moment_nm(scanner)
    bears = SURELY * (UNRATED_NM if rated is None else SHARE * rated)
    stall, metals = scanner.servo.stall_torque_nm, (ALUMINIUM, STEEL)
    strong = [one for one in WAIST_DIAMETERS if all(stall <= metal.twisted_off_nm(one) for metal in metals)]
    strong = strong or [WAIST_DIAMETERS[0]]
    off_m = sum(offsets_mm(ears).values()) / 1000
    for length in WAIST_LENGTHS:
        one = replace(stack, waist_length=length)
        weight, stiffness = heaviest(scanner, one), stiffness_n_per_m(one, ears)
        for diameter in strong:
            thick = replace(one, waist_diameter=diameter)
            shared = [supported(weight, thick, stiffness, metal) for metal in metals]
            if max(each.horn_moment_nm + off_m * each.misaligned_nm_per_m for each in shared) <= bears:
                return thick
    return replace(stack, waist_length=WAIST_LENGTHS[-1], waist_diameter=strong[-1])
