"""The entire scanner in the rotation frame at gamma = 0: made parts and bought bodies with their descriptions. mm.

Mass properties of its bodies, for the URDF, the checks and the counterweight, are in SI units.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import cadquery as cq
import numpy as np

from scanwright.cad.assembly.bought import BodySpec, Frame
from scanwright.cad.geometry import inertia
from scanwright.cad.geometry.inertia import Inertial, of_solid
from scanwright.cad.geometry.mesh import TriMesh, mesh_of
from scanwright.cad.geometry.print_pose import PrintPose, print_pose
from scanwright.cad.layout.cables.fixed import FixedCable
from scanwright.cad.layout.cables.leads import SAMPLE, RotorLead
from scanwright.cad.layout.hub import Hub
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.loads import Weight, weight_of
from scanwright.cad.parts.part_spec import Colour, PartSpec
from scanwright.design.arrays import Array
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.scanner import Scanner


@dataclass(frozen=True, slots=True)
class Assembly:
    """Solids by name, rotation frame, mm."""

    layout: Layout  # the numbers that they were made from
    parts: dict[str, PartSpec]  # descriptions of the made ones
    bodies: dict[str, BodySpec]  # descriptions of the bought ones
    made: dict[str, cq.Solid]  # parts of this project
    bought: dict[str, cq.Solid]  # bodies of bought products
    _meshes: dict[str, TriMesh] = field(default_factory=dict, init=False, repr=False, compare=False)
    _poses: dict[str, PrintPose] = field(default_factory=dict, init=False, repr=False, compare=False)
    _inertials: dict[str, Inertial] = field(default_factory=dict, init=False, repr=False, compare=False)

    def spec(self, name: str) -> PartSpec | BodySpec:
        """Return the description of a part or a body."""
        return self.parts[name] if name in self.parts else self.bodies[name]

    def metal(self) -> frozenset[str]:
        """Return the names of the made parts that are not printed."""
        return frozenset(name for name in self.made if self.parts[name].metal)

    def turning(self) -> frozenset[str]:
        """Return the names of all parts and bodies that turn about the axis."""
        return frozenset(name for name in (*self.made, *self.bought) if self.spec(name).turns)

    def parts_in(self, frame: Frame) -> list[str]:
        """Return the names of the made parts that move with a frame."""
        return [name for name in self.made if self.parts[name].frame == frame]

    def carriers(self) -> list[str]:
        """Return the names of the made parts between hub and lidar."""
        return [name for name in self.made if self.parts[name].seat is not None]

    def thing(self, body: str) -> str:
        """Return the name of a part, or of the bought product that a body belongs to."""
        return self.bodies[body].product if body in self.bodies else body

    def mesh(self, name: str) -> TriMesh:
        """Return the mesh of a part or a body; it is made once."""
        if name not in self._meshes:
            if name in self.made:
                self._meshes[name] = mesh_of(self.made[name])
            else:
                self._meshes[name] = mesh_of(self.bought[name], *self.bodies[name].chords)
        return self._meshes[name]

    def meshes(self) -> dict[str, TriMesh]:
        """Return the meshes of all parts and bodies by name."""
        return {name: self.mesh(name) for name in (*self.made, *self.bought)}

    def inertial(self, name: str) -> Inertial:
        """Return the mass properties of a made part; they are integrated once."""
        if name not in self._inertials:
            density = self.parts[name].density_g_cm3(self.layout.scanner.printer)
            self._inertials[name] = of_solid(self.made[name], density)
        return self._inertials[name]

    def print_pose(self, name: str) -> PrintPose:
        """Return the pose in which a part is printed, without its label; it is computed once."""
        if name not in self._poses:
            self._poses[name] = print_pose(self.mesh(name), self.layout.scanner.printer.bed_mm)
        return self._poses[name]

    def outlines(self) -> dict[str, TriMesh]:
        """Return the meshes of all parts by name, swept if a part turns about another axis."""
        return self.meshes() | {
            name: self._swept(name, part.sweep)
            for name, part in self.parts.items()
            if name in self.made and part.sweep is not None
        }

    def _swept(self, name: str, sweep: Callable[[], cq.Solid]) -> TriMesh:
        key = f"sweep of {name}"
        if key not in self._meshes:
            self._meshes[key] = mesh_of(sweep())
        return self._meshes[key]


def as_tree(assembly: Assembly) -> cq.Assembly:
    """Return all parts under one named root, each with its name and colour."""
    tree = cq.Assembly(name="scanwright")
    for name, solid in (assembly.made | assembly.bought).items():
        tree.add(solid, name=name, color=cq.Color(*assembly.spec(name).colour))
    return tree


def alone(name: str, solid: cq.Solid, colour: Colour) -> cq.Assembly:
    """Return one part under a root: without a root, a process-wide counter names the product of a STEP file."""
    return cq.Assembly(name="scanwright").add(solid, name=name, color=cq.Color(*colour))


def link_bodies(assembly: Assembly) -> dict[str, Inertial]:
    """Return the mass properties of the URDF's links: servo and rot in the rotation frame, laser in the laser frame.

    Bought parts are homogeneous boxes, of which a share may turn; cables are lines.
    """
    layout, bodies = assembly.layout, {"laser": lidar_body(assembly.layout.scanner.lidar)}
    cables: tuple[tuple[Frame, Sequence[FixedCable | RotorLead]], ...] = ("servo", layout.cables), ("rot", layout.leads)
    for frame, lines in cables:
        own = [assembly.inertial(name) for name in assembly.parts_in(frame)]
        for each, mass_g, box in layout.drive.masses:
            share = each.turning if frame == "rot" else 1 - each.turning
            own += [inertia.of_box(share * mass_g, *box)] if share > 0 else []
        own += [inertia.of_line(lead.mass_g, lead.path.points(SAMPLE)) for lead in lines if lead.path]
        bodies[frame] = inertia.together(own)
    return bodies


def lidar_body(lidar: Lidar) -> Inertial:
    """Return the lidar as a homogeneous box, laser frame."""
    (x, y, z), base = lidar.body_mm, -lidar.optical_height_mm
    return inertia.of_box(lidar.mass_g, (-x / 2, -y / 2, base), (x / 2, y / 2, base + z))


def rotor_of(scanner: Scanner, bodies: Mapping[str, Inertial]) -> Inertial:
    """Return all that turns, rotation frame, from the bodies of `link_bodies`."""
    return inertia.together([bodies["rot"], bodies["laser"].moved(scanner.angles.T_rot_laser())])


def rotor_weight(scanner: Scanner, stack: Hub, bodies: Mapping[str, Inertial]) -> Weight:
    """Return the weight of all that turns, from the bodies of `link_bodies`."""
    rotor = rotor_of(scanner, bodies)
    x, y, z = rotor.centre_m
    return weight_of(scanner, rotor.mass_kg, float(z) - stack.horn / 1000, math.hypot(x, y))


def rotor_moment(assembly: Assembly) -> Array:
    """Return the mass times distance from the axis of all that turns, shape (2,) [g mm]."""
    rotor = rotor_of(assembly.layout.scanner, link_bodies(assembly))
    return np.asarray(1e6 * rotor.mass_kg * rotor.centre_m[:2])
