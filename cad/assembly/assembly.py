"""The whole scanner in the rotation frame at gamma = 0: made parts, bought parts, names and colours. Millimetres.

Every part is placed by an explicit location; the lidar by the angle set's own `T_rot_laser`, the one that the
point cloud goes through.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import cadquery as cq

from cad import solids
from cad.assembly import bought
from cad.drives.drive import Drive, drive_of
from cad.geometry.mesh import Mesh, mesh_of
from cad.layout.balance import PART as COUNTERWEIGHT
from cad.layout.balance import SCREW as BAR_SCREW
from cad.layout.balance import Counterweight, counterweight_of
from cad.layout.deck import Deck, deck_of
from cad.layout.head import Head
from cad.layout.linkage import PART as LINKAGE
from cad.layout.linkage import AlignmentLinkage, linkage_of
from cad.parts.alignment_linkage import alignment_linkage
from cad.parts.base_mount import base_mount, mount_of
from cad.parts.counterweight import counterweight
from cad.parts.sub_plate import PART as SUB_PLATE
from cad.parts.sub_plate import sub_plate, sub_plate_of
from cad.screws import Screw
from design.left_out import LeftOut
from design.scanner import Scanner

PRINTED, TURNED = (0.93, 0.45, 0.10), (0.75, 0.76, 0.78)
STEEL = (0.60, 0.62, 0.66)
BOUGHT = {
    "servo": (0.16, 0.16, 0.19),
    "ring": (0.72, 0.58, 0.20),
    "lidar": (0.20, 0.23, 0.27),
    "bearing_inner": STEEL,
    "bearing_outer": STEEL,
    "bearing_inner_upper": STEEL,
    "bearing_outer_upper": STEEL,
    "bearing_inner_lower": STEEL,
    "bearing_outer_lower": STEEL,
    "belt": (0.10, 0.10, 0.11),
}
WINDOW = (0.35, 0.05, 0.08)


TURNING = (
    "servo_shaft",
    "main_shaft",
    "shaft_pulley",
    "shaft_ring",
    "alignment_linkage",
    "sub_plate",
    "counterweight",
    "servo_horn",
    "ring_rotor",
    "bearing_inner",
    "lidar",
)


@dataclass(frozen=True, slots=True)
class Assembly:
    """Solids by name: `made` are the parts of this project. Rotation frame, mm."""

    drive: Drive
    deck: Deck
    linkage: AlignmentLinkage
    counterweight: Counterweight | LeftOut  # or why there is none
    made: dict[str, cq.Solid]
    bought: dict[str, cq.Solid]
    _meshes: dict[str, Mesh] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def stack(self) -> Head:
        """Every number that more than one part needs."""
        return self.drive.stack

    def metal(self) -> frozenset[str]:
        """Names of the made parts that no printer makes."""
        return self.drive.turned() | (frozenset({COUNTERWEIGHT}) & self.made.keys())

    def slotted(self) -> list[tuple[str, str, Screw, int, float, float]]:
        """Screws in slots: part, what they end in, size, number, grip and depth of thread."""
        slots, bar = self.drive.slotted(), self.counterweight
        if COUNTERWEIGHT in self.made and isinstance(bar, Counterweight):
            grip = bar.ear.high - bar.ear.low
            slots = [*slots, (LINKAGE, COUNTERWEIGHT, BAR_SCREW, len(bar.screws), grip, bar.section[1])]
        return slots

    def mesh(self, name: str) -> Mesh:
        """The mesh of a part, made or bought; made once, as beams, checks and scenes all want it."""
        if name not in self._meshes:
            self._meshes[name] = mesh_of((self.made | self.bought)[name])
        return self._meshes[name]

    def meshes(self) -> dict[str, Mesh]:
        """Of all parts by name."""
        return {name: self.mesh(name) for name in (*self.made, *self.bought)}

    def outlines(self) -> dict[str, Mesh]:
        """Of all parts by name, as they look from outside while they turn."""
        return self.meshes() | {name: mesh_of(solid) for name, solid in self.drive.sweeps().items()}

    def standing_parts(self) -> list[str]:
        """Names of the made parts that stand still."""
        return [name for name in self.made if not turns(name)]

    def turning_parts(self) -> list[str]:
        """Names of the made parts that turn about the axis."""
        return [name for name in self.made if turns(name)]


def turns(name: str) -> bool:
    """Whether a part, made or bought, turns about the axis."""
    return name.startswith(TURNING)


def make_parts(scanner: Scanner, wanted: Callable[[str], bool] = lambda _: True) -> Assembly:
    """Make every part that this scanner needs, and the bought ones around them; of these, those that are wanted.

    Raises:
        BuildError: a part cannot be made; the message names part, feature, parameter and value.
    """
    drive = drive_of(scanner)
    stack = drive.stack
    deck, linkage = deck_of(scanner, stack), linkage_of(scanner, stack)
    bar = counterweight_of(scanner, linkage)
    if isinstance(bar, Counterweight):
        linkage = replace(linkage, ear=bar.ear)
    made: dict[str, Callable[[], cq.Solid]] = {**drive.made()}
    made[LINKAGE] = lambda: alignment_linkage(linkage)
    between = sub_plate_of(scanner, stack)
    if between is not None:
        made[SUB_PLATE] = partial(sub_plate, between)
    if not deck.flat:
        made["base_mount"] = lambda: base_mount(mount_of(scanner, deck))
    others = {**drive.bought()}
    T = scanner.angles.T_rot_laser()
    optical = solids.location(stack.R(), T[:3, 3] * 1000)
    base = optical * cq.Location(cq.Vector(0, 0, -scanner.lidar.optical_height_mm))
    others |= {name: solid.moved(base) for name, solid in bought.lidar_solids(scanner.lidar).items()}
    assembly = Assembly(
        drive,
        deck,
        linkage,
        bar,
        {name: make() for name, make in made.items() if wanted(name)},
        {name: solid for name, solid in others.items() if wanted(name)},
    )
    return _balanced(scanner, assembly) if wanted(COUNTERWEIGHT) else assembly


def _balanced(scanner: Scanner, assembly: Assembly) -> Assembly:
    """With the counterweight, if there is one, cut to the solids; without linkage and sub-plate, to their estimate."""
    from cad.assembly.masses import rotor_moment

    bar = assembly.counterweight
    if isinstance(bar, LeftOut):
        return assembly
    held = {LINKAGE} if assembly.stack.sub_plate is None else {LINKAGE, SUB_PLATE}
    if held <= assembly.made.keys():
        bar = bar.balancing(rotor_moment(scanner, assembly))
    return replace(assembly, counterweight=bar, made=assembly.made | {COUNTERWEIGHT: counterweight(bar)})


def as_tree(assembly: Assembly) -> cq.Assembly:
    """All parts under one named root, each with its name and colour."""
    tree = cq.Assembly(name="scanwright")
    for name, solid in (assembly.made | assembly.bought).items():
        tree.add(solid, name=name, color=cq.Color(*colour_of(name)))
    return tree


def alone(name: str, solid: cq.Solid) -> cq.Assembly:
    """One part under a named root: a STEP file without a root names its product by a process-wide counter."""
    return cq.Assembly(name="scanwright").add(solid, name=name, color=cq.Color(*colour_of(name)))


def colour_of(name: str) -> tuple[float, float, float]:
    """SRGB colour of a part, made or bought."""
    if name == "lidar_window":
        return WINDOW
    if name in ("servo_shaft", "main_shaft"):
        return TURNED
    if name == COUNTERWEIGHT:
        return STEEL
    return BOUGHT.get(name, BOUGHT.get(name.split("_")[0], PRINTED))
