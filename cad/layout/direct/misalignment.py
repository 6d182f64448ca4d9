"""What puts the bearing out of the servo's axis, and what that costs the horn. No kernel: plain numpy.

Horn and bearing hold the same shaft: what one is out of the other's line bends the waist between them. Each tolerance
is stated as the distance that it may put the sleeve's middle off the bearing's; the worst case is their plain sum, on
top of the weight. What needs no account: the bearing is bonded into its seat while the shaft stands in it, so that the
seat's play and roundness are filled; the sleeve slides in the inner ring, so that shaft and cage may grow apart along
the axis; a runout of horn, flange and shaft is one number, since it is trued at the shaft's upper end, where the sleeve
will be: with the ring over the flange no key reaches its screws.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from scanwright.cad.layout.direct.cage import BearingCage, Ears, stiffness_n_per_m
from scanwright.cad.layout.direct.loads import ALUMINIUM, STEEL, ShaftMetal, heaviest, supported
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.loads import UNRATED_NM, Weight, rated_moment_nm
from scanwright.design.scanner import Scanner

TRUED_MM = 0.03  # on the indicator over a turn: the flange is tapped within the play of its screws
SLEEVE_BOND_MM = 0.04  # most runout of the sleeve against the shaft: play of its bore, and its own
INNER_RING_MM = 0.013  # Kia of a bearing of the normal class, 18 to 30 mm, ISO 492
SLEEVE_FIT_MM = 0.02  # most play of g6 in the inner ring, on the diameter: ISO 286, ISO 492
BEARING_CLEARANCE_MM = 0.02  # most radial clearance of the normal group, 24 to 30 mm, ISO 5753-1
CAGE_SET_MM = 0.02  # that the cage springs off the sleeve's middle when its screws are tightened: assumed
WARMER_K = 20.0  # than when it was set
PLASTIC_GROWS_PER_K = 70e-6  # PLA and PETG; the case is taken not to grow
SHARE = 0.5  # of the horn's rating that the worst case may use
SURELY = 0.92  # of what is allowed, as long as the rotor is not weighed: balanced, it may lean a little more
# the shaft's waist, each in the order of preference
WAIST_LENGTHS = (20.0, 24.0, 28.0, 32.0, 36.0, 40.0)
WAIST_DIAMETERS = tuple(tenths / 10 for tenths in range(70, 44, -1))


@dataclass(frozen=True, slots=True)
class Contribution:
    """One cause of a moment on the horn, at its worst.

    Attributes:
        what: in words.
        off_mm: how far it puts the sleeve off the bearing's middle; None for the weight.
        moment_nm: on the horn.
    """

    what: str
    off_mm: float | None
    moment_nm: float


def offsets_mm(ears: Ears) -> dict[str, float]:
    """Every tolerance by its words: how far it puts the sleeve's middle off the bearing's."""
    from_axis = abs(sum(y for _, y in ears.holes)) / len(ears.holes)
    return {
        f"shaft trued to {TRUED_MM:g} over a turn": TRUED_MM / 2,
        "sleeve bonded to the shaft": SLEEVE_BOND_MM / 2,
        "runout of the inner ring": INNER_RING_MM / 2,
        "sleeve in the inner ring": SLEEVE_FIT_MM / 2,
        "clearance of the bearing": BEARING_CLEARANCE_MM / 2,
        "cage as it is set": CAGE_SET_MM,
        f"cage {WARMER_K:g} K warmer": PLASTIC_GROWS_PER_K * WARMER_K * from_axis,
    }


def contributions(cage: BearingCage, weight: Weight, metal: ShaftMetal = ALUMINIUM) -> list[Contribution]:
    """Moments on the horn of a scanner with a bearing, the weight first."""
    stack = cage.stack
    shared = supported(weight, stack, stiffness_n_per_m(stack, cage.ears), metal)
    off = offsets_mm(cage.ears)
    return [
        Contribution("weight", None, shared.horn_moment_nm),
        *(Contribution(what, mm, mm / 1000 * shared.misaligned_nm_per_m) for what, mm in off.items()),
    ]


def worst_moment_nm(cage: BearingCage, weight: Weight) -> dict[str, float]:
    """Sum of all contributions by metal."""
    return {
        metal.name: sum(each.moment_nm for each in contributions(cage, weight, metal)) for metal in (ALUMINIUM, STEEL)
    }


def with_waist(scanner: Scanner, stack: DirectStack, ears: Ears) -> DirectStack:
    """The stack with a waist that the horn bears in every metal and that a stalled servo does not twist off.

    What bends less for what is out of line twists less under the lidar too, by one ratio for a round bar of any length:
    so of every length the thickest diameter, and of the lengths the shortest, since a low cage is a stiff one. If the
    horn bears none of them the longest that withstands the servo stays, and `tilt_moment` fails.

    Args:
        scanner: a horn that its maker does not rate is trusted with `UNRATED_NM`.
        stack: with a bearing; its waist is replaced.
        ears: that the cage stands on.
    """
    rated = rated_moment_nm(scanner)
    bears = SURELY * (UNRATED_NM if rated is None else SHARE * rated)
    strong = [one for one in WAIST_DIAMETERS if _outlasts(scanner, one)] or [WAIST_DIAMETERS[0]]
    off_m = sum(offsets_mm(ears).values()) / 1000
    for length in WAIST_LENGTHS:
        one = replace(stack, waist_length=length)
        weight, stiffness = heaviest(scanner, one), stiffness_n_per_m(one, ears)
        for diameter in strong:
            thick = replace(one, waist_diameter=diameter)
            shared = [supported(weight, thick, stiffness, metal) for metal in (ALUMINIUM, STEEL)]
            if max(each.horn_moment_nm + off_m * each.misaligned_nm_per_m for each in shared) <= bears:
                return thick
    return replace(stack, waist_length=WAIST_LENGTHS[-1], waist_diameter=strong[-1])


def _outlasts(scanner: Scanner, waist_diameter: float) -> bool:
    weakest = min(metal.twisted_off_nm(waist_diameter) for metal in (ALUMINIUM, STEEL))
    return scanner.servo.stall_torque_nm <= weakest
