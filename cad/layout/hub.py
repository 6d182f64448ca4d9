"""The hub that carries the linkage on its shaft, for every drive. No kernel.

All below the hub is in `cad/layout/direct/` (servo on the axis) or `cad/layout/belt/` (servo next to the axis).
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scanwright.cad.screws import SCREWS, Screw
from scanwright.design.arrays import Array
from scanwright.design.catalogue.products import Bearing

HUB_WALL = 12.0  # around the spigot: between the heads of the cross screws and the shaft
HUB_ROOF = 3.0  # of the hub over the shaft
NECK_ON_RIM = 1.5  # between the neck and the edge of a cup's rim
HUB_STEP = 1.0  # by which the hub is wider than the bearing's bore
HUB_GAP = 10.0  # least height between a ring and the hub
BUNDLE_GAP = 0.25  # mm between two bundles of leads, and a bundle and its channel's wall
WASHER_GAP = 0.25  # around a washer
WASHER_WALL = 1.5  # of the hub below the washers of its cross screws
BEARING_STEP = 0.5  # between a face that turns and the bearing: only the inner ring touches
JOURNAL_WALL = 2.2  # of the sleeve between bore and leads
LEANING = 1.15  # width of a lead across the axis, over its diameter, at its bend outwards
SLEEVE_CLEAR = 1.0  # of the sleeve between the bearing and its end with the grub screws
SLEEVE_END = 5.5  # length of that end

Axis = Literal["x", "y"]


@dataclass(frozen=True, slots=True)
class CrossScrew:
    """Screw through the hub into the shaft, with a washer: on plastic the pressure limits the friction. mm."""

    screw: Screw
    washer: float  # diameter
    washer_thick: float
    cup_wall: float  # of the hub around a cup, which is wide enough to hold it stiffly
    sunk: float  # depth of the washer's seat in that wall
    before_nut: float  # wall of a cup between the hub and a nut

    @property
    def path(self) -> float:
        """Radius of the path of washer, head and driver."""
        return self.washer / 2 + WASHER_GAP

    @property
    def above_bottom(self) -> float:
        """Height of the screw over the hub's lower face."""
        return self.path + WASHER_WALL

    @property
    def spigot(self) -> float:
        """Length of the shaft inside the hub."""
        return self.above_bottom + self.path

    @property
    def hub_height(self) -> float:
        """Height of the hub."""
        return self.spigot + HUB_ROOF


CROSS_M3 = CrossScrew(SCREWS["M3"], 9.0, 0.8, 6.0, 2.8, 3.0)  # sunk so that two screws do not meet
CROSS_SCREWS = (  # washers of ISO 7089, then ISO 7093; the smallest first
    CrossScrew(SCREWS["M2.5"], 6.0, 0.5, 4.5, 2.0, 2.0),
    CROSS_M3,
    CrossScrew(SCREWS["M4"], 12.0, 1.0, 7.5, 3.5, 4.0),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hub(ABC):
    """The hub along the axis: radii, lengths and the z of each plane (rotation frame, mm).

    If the hub covers a screw of the lidar, or its threads are in its sides, the lidar is screwed to a sub-plate on the
    bench, and that to the linkage by its ears, from the lidar's side.
    """

    h: float
    R_rot_laser: tuple[tuple[float, float, float], ...]
    ring_length: float
    ring_radius: float
    shaft_diameter: float
    cross_screw: CrossScrew = CROSS_M3
    hub_wall: float = HUB_WALL  # around the shaft
    bearing: Bearing | None  # on a sleeve of the shaft, below the hub
    sub_plate: Axis | None  # of the laser frame, along which its ears stick out
    lead_count: int = 0  # bundles of leads from the ring to the lidar
    lead_diameter: float = 0.0  # of one of them
    lead_radius: float = 0.0  # least one of its bends
    cup_bore: float = 0.0  # diameter inside a printed shaft (`cad/layout/direct/cup.py`); 0 of a turned one

    @property
    def hub_radius(self) -> float:
        """Radius of the linkage's hub."""
        on_sleeve = 0.0 if self.bearing is None else self.bearing.bore_mm / 2 + HUB_STEP
        return max(self.shaft_diameter / 2 + self.hub_wall, on_sleeve)

    @property
    def neck_radius(self) -> float:
        """Radius of the linkage's neck at the hub: over a cup no wider than the cup's rim."""
        return self.shaft_diameter / 2 - NECK_ON_RIM if self.cup_bore > 0 else self.hub_radius - 1.0

    @property
    def shoulder(self) -> float:
        """Height of the hub's lower face: above it all turns, below it only sleeve and shaft."""
        return -self.h - self.cross_screw.hub_height

    @property
    def journal(self) -> float:
        """Length of the bearing's sleeve below the hub."""
        return 0.0 if self.bearing is None else BEARING_STEP + self.bearing.width_mm + SLEEVE_CLEAR + SLEEVE_END

    @property
    def sleeve_low(self) -> float:
        """Height of the lower end of the sleeve in a bearing, or of the hub without one."""
        return self.shoulder - self.journal

    @property
    def leads_corner(self) -> float:
        """Height at which leads through the sleeve of a bearing turn outwards, clear of the bearing."""
        assert self.bearing is not None
        reach = self.bearing.bore_mm / 2 - BUNDLE_GAP - LEANING * self.lead_diameter / 2
        aside = (self.lead_count - 1) / 2 * (self.lead_diameter + BUNDLE_GAP)  # of the outermost bundle
        outwards = math.sqrt(max(reach**2 - aside**2, 0.0)) - self.leads_radius  # before it leaves the bearing
        straight = max(self.lead_radius - max(outwards, 0.0), 0.0)
        return self.bearing_top + self.lead_radius - math.sqrt(self.lead_radius**2 - straight**2)

    @property
    def leads_radius(self) -> float:
        """Distance of the leads from the axis in the sleeve of a bearing."""
        return self.shaft_diameter / 2 + JOURNAL_WALL + self.lead_diameter / 2 + BUNDLE_GAP

    @property
    def leads_half_width(self) -> float:
        """Half the width of all bundles side by side."""
        return (self.lead_count * (self.lead_diameter + BUNDLE_GAP) + BUNDLE_GAP) / 2

    @property
    def cross(self) -> float:
        """Height of the screws that cross from the hub into the shaft."""
        return self.shoulder + self.cross_screw.above_bottom

    @property
    def spigot_top(self) -> float:
        """Height of the shaft's upper end, which is the floor of the hub's bore."""
        return self.shoulder + self.cross_screw.spigot

    @property
    def bearing_top(self) -> float:
        """Height of the upper face of the sleeve's bearing."""
        return self.shoulder - BEARING_STEP

    @property
    def flat(self) -> float:
        """Distance from the axis of the flat that keys the spigot."""
        return self.shaft_diameter / 2 - 1.0

    @property
    @abstractmethod
    def horn(self) -> float:
        """Height of the servo's horn face."""

    @property
    @abstractmethod
    def shadow_half_angle(self) -> float:
        """Half angle [rad] of the cone about -z that everything below the hub hides from the optical centre."""

    @property
    @abstractmethod
    def sure_half_angle(self) -> float:
        """Half angle [rad] of a cone inside it, of round bodies only."""

    def R(self) -> Array:
        """Return the laser in the rotation frame, shape (3, 3)."""
        return np.array(self.R_rot_laser)
