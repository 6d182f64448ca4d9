"""Every number of the direct drive that more than one part needs. No kernel: plain numpy.

Rotation frame at gamma = 0, mm: origin at the optical centre, z the rotation axis out of the servo horn, +y
towards the servo's +Y face, where the index marks meet. Everything that turns stays above the plane of the
ring's top, all fixed parts around the shaft stay below it: clearance over a turn needs no stepping.

    z = 0             optical centre
    -h                top of the linkage's hub
    shoulder          the hub's height below: all that turns and is wider than the journal is above it
    sleeve_low        the shoulder, or below it the lower end of the sleeve in a bearing
    leads_low         below by SLEEVE_GAP; without a bearing by HUB_GAP, or the height of the bend of the ring's leads:
                      the end of the ring's rotor collar
    ring_top          the collar's length below
    ring_bottom       the length of the ring's stator below
                      RING_GAP, or the shaft's waist, below: top of the shaft's collar
    horn              the servo's horn face

A tilted axis whose rotor is too heavy for the horn alone gets a bearing on a sleeve of the shaft
(`cad/layout/direct/loads.py`). Without ring and bearing nothing has to pass over the shaft: it is a printed cup
(`cad/layout/direct/cup.py`), its flange CUP_GAP below the shoulder.
"""

import math
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.hub import HUB_GAP, SLEEVE_END, Hub
from scanwright.cad.layout.names import HORN_CUP, SERVO_SHAFT
from scanwright.design.arrays import Array

RING_GAP = 3.0
BELOW_HUB = 0.85  # between the hub, or its slotted tab, and a lead that leaves under it
GROOVE_WIDTH, GROOVE_DEPTH = 2.6, 0.3  # of the shaft, for the flat points of the sleeve's grub screws
SLEEVE_GAP = 4.5  # between a ring and the sleeve, whose channel its leads enter
CUP_GAP = 0.5  # between hub and flange of a cup: the cup's rim carries the hub
APART = 54.0  # least length of shaft between waist and hub: a bearing near the horn is no lever against it
CAGE_MIN = 30.0  # least inner radius of the bearing's cage: heads of the servo's screws
CAGE_WALL = 5.0
CAGE_TIE = 2.0  # between ring and cage: a cable tie around the ring
CAGE_GAP = 1.0  # between hub and cage
WINDOWS_REACH = 3.0  # of the cage's windows into its roof
CAGE_SEAT_WALL = 4.0  # around the bearing
STRIP = 0.3  # under the top of a ring's stator that its drawing does not vouch for
CAGE_LIP = 1.5  # under the bearing's outer ring, thick and wide
SLICES = 100  # of each piece of the shaft between two edges: bend within 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectStack(Hub):
    """The scanner along its axis with the servo on it: horn, shaft through the ring, hub (rotation frame, mm)."""

    ring_bore: float
    ring_collar: float = 0.0  # of the rotor, beyond the stator
    flange_radius: float
    flange_thickness: float
    collar_radius: float
    collar_height: float
    waist_length: float  # of the thin piece that bends if horn and bearing are not quite in line
    waist_diameter: float  # in aluminium
    cage_least: float = 0.0  # inner radius of a bearing's cage, around the boss of its base
    foot_radius: float = 0.0  # of a cup over the screws of a servo frame; else 0
    foot_height: float = 0.0
    grip: float = 0.0  # of such a cup under the heads of the horn's screws; else its flange

    @property
    def shaft(self) -> str:
        """Name of the part on the horn."""
        return SERVO_SHAFT if self.cup_bore == 0 else HORN_CUP

    @property
    def horn_grip(self) -> float:
        """Thickness of the part below the heads of the horn's screws."""
        return self.grip or self.flange_thickness

    @property
    def bearing_middle(self) -> float:
        """Height of the bearing's balls."""
        return self.bearing_top - (0.0 if self.bearing is None else self.bearing.width_mm / 2)

    @property
    def cage_inner(self) -> float:
        """Inner radius of the bearing's cage, around the ring and the base's opening."""
        return max(self.ring_radius + CAGE_TIE, CAGE_MIN, self.cage_least)

    @property
    def cage_outer(self) -> float:
        """Outer radius of the bearing's cage."""
        return self.cage_inner + CAGE_WALL

    @property
    def cage_top(self) -> float:
        """Height of the cage's upper face."""
        return self.shoulder - CAGE_GAP

    @property
    def cage_seat(self) -> float:
        """Height of the lip below the bearing."""
        return self.bearing_top - (0.0 if self.bearing is None else self.bearing.width_mm)

    @property
    def cage_roof(self) -> float:
        """Height at which the cage starts to narrow towards the bearing, at 45 deg."""
        if self.bearing is None:
            return self.cage_seat
        return self.cage_seat - CAGE_LIP - (self.cage_inner - self.bearing.outer_mm / 2 + CAGE_LIP)

    @property
    def rims(self) -> list[tuple[float, float]]:
        """Radius and depth below the hub's top of the ring, or of seat and wall of the cage around it."""
        if self.bearing is None:
            return [(self.ring_radius, self.cross_screw.hub_height + HUB_GAP)]
        seat = self.bearing.outer_mm / 2 + CAGE_SEAT_WALL
        return [(seat, -self.cage_top - self.h), (self.cage_outer, -self.cage_roof - self.h)]

    @property
    def leads_low(self) -> float:
        """Height of the upper end of the ring's rotor, where its leads leave."""
        bend = self.lead_radius + self.lead_diameter / 2 + BELOW_HUB
        return self.sleeve_low - (max(HUB_GAP, bend) if self.bearing is None else SLEEVE_GAP)

    @property
    def ring_top(self) -> float:
        """Height of the upper face of the ring's stator."""
        return self.leads_low - self.ring_collar

    @property
    def ring_bottom(self) -> float:
        """Height of the ring's lower face."""
        return self.ring_top - self.ring_length

    @property
    def horn(self) -> float:
        """Height of the servo's horn face."""
        if self.cup_bore > 0:
            return self.shoulder - CUP_GAP - self.flange_thickness
        if self.bearing is None:
            return self.ring_bottom - RING_GAP - self.collar_height
        apart = max(0.0, APART - self.ring_length - self.ring_collar)
        return self.ring_bottom - apart - self.waist_length - self.collar_height

    @property
    def sleeve_grubs(self) -> float:
        """Height of the grub screws that hold the sleeve in a bearing."""
        return self.sleeve_low + SLEEVE_END / 2

    def radius_at(self, above_horn: Array, waist_diameter: float) -> Array:
        """Return the radius of the shaft at heights above the horn, without the pocket of the horn's boss.

        The floor of a cup counts as wide as the circle of its screws: finite elements of a cup on the face of its horn
        turn 1.2 times as far.

        Args:
            above_horn: heights, any shape.
            waist_diameter: of its waist, in the metal used.
        """
        z, shaft = np.asarray(above_horn), self.shaft_diameter / 2
        if self.foot_radius > 0:  # a cone of 45 deg above the foot
            return np.minimum(shaft, self.collar_radius + np.maximum(z - self.foot_height, 0.0))
        if self.cup_bore > 0:
            return np.where(z < self.flange_thickness, self.collar_radius, shaft)
        radius = np.full(z.shape, shaft)
        if self.bearing is not None:
            above = z - self.collar_height - self.waist_length
            radius = np.minimum(shaft, waist_diameter / 2 + np.maximum(above, 0.0))
        radius = np.where(z < self.collar_height, max(self.collar_radius, shaft), radius)
        return np.where(z < self.flange_thickness, np.maximum(self.flange_radius, radius), radius)

    def bore_at(self, above_horn: Array) -> Array:
        """Return the radius inside the shaft at heights above the horn: 0 if it is solid."""
        return np.where(np.asarray(above_horn) < self.horn_grip, 0.0, self.cup_bore / 2)

    def slices(self, length: float, waist_diameter: float) -> tuple[Array, Array]:
        """Return middles and thicknesses of slices of a length of shaft above the horn; none crosses an edge of it.

        Its waist has a diameter in the metal used.
        """
        waist = self.collar_height + self.waist_length
        slope = (self.shaft_diameter - waist_diameter) / 2
        cone = self.foot_height, self.horn_grip, self.foot_height + self.shaft_diameter / 2 - self.collar_radius
        bounds = [0.0, self.flange_thickness, self.collar_height, waist, waist + slope, length]
        edges = np.sort(np.clip([*bounds, *(cone if self.foot_radius > 0 else ())], 0.0, length))
        pieces, within = np.diff(edges)[:, None], (np.arange(SLICES) + 0.5) / SLICES
        return (edges[:-1, None] + pieces * within).ravel(), np.repeat(pieces / SLICES, SLICES)

    @property
    def shadow_half_angle(self) -> float:
        """Half angle [rad] of the cone about -z that ring, or cage, hide from the optical centre."""
        ring = math.atan2(max(self.ring_radius, self.hub_radius), -self.ring_top)
        if self.bearing is None:
            return ring
        seat = math.atan2(self.bearing.outer_mm / 2 + CAGE_SEAT_WALL, -self.cage_top)
        return max(ring, seat, math.atan2(self.cage_outer, -self.cage_roof))

    @property
    def sure_half_angle(self) -> float:
        """Half angle [rad] of that cone by solids of revolution only, a little inside their edges."""
        rims = []
        if self.ring_radius > 0:
            rims.append((self.ring_radius, self.ring_top - 1.0 - STRIP))
        if self.bearing is not None:
            rims.append((self.bearing.outer_mm / 2 + CAGE_SEAT_WALL, self.cage_top))
            rims.append((self.cage_outer - WINDOWS_REACH, self.cage_roof + WINDOWS_REACH))
        return max((math.atan2(radius, -z) for radius, z in rims), default=0.0)
