"""The whole scanner in the rotation frame at gamma = 0: made parts and bought bodies with what is known of each. mm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import cadquery as cq

from scanwright.cad.assembly.bought import BodySpec
from scanwright.cad.geometry.inertia import Inertial, of_solid
from scanwright.cad.geometry.mesh import TriMesh, mesh_of
from scanwright.cad.geometry.print_pose import PrintPose, print_pose
from scanwright.cad.layout.layout import Layout
from scanwright.cad.parts.part_spec import Colour, PartSpec


@dataclass(frozen=True, slots=True)
class Assembly:
    """Solids by name, rotation frame, mm.

    Attributes:
        layout: the numbers that they were made from.
        parts: what is known of the made ones.
        bodies: what is known of the bought ones.
        made: parts of this project.
        bought: bodies of bought products.
    """

    layout: Layout
    parts: dict[str, PartSpec]
    bodies: dict[str, BodySpec]
    made: dict[str, cq.Solid]
    bought: dict[str, cq.Solid]
    _meshes: dict[str, TriMesh] = field(default_factory=dict, init=False, repr=False, compare=False)
    _poses: dict[str, PrintPose] = field(default_factory=dict, init=False, repr=False, compare=False)
    _inertials: dict[str, Inertial] = field(default_factory=dict, init=False, repr=False, compare=False)

    def spec(self, name: str) -> PartSpec | BodySpec:
        """What is known of a part or a body."""
        return self.parts[name] if name in self.parts else self.bodies[name]

    def metal(self) -> frozenset[str]:
        """Names of the made parts that no printer makes."""
        return frozenset(name for name in self.made if self.parts[name].metal)

    def turning(self) -> frozenset[str]:
        """Names of all parts and bodies that turn about the axis."""
        return frozenset(name for name in (*self.made, *self.bought) if self.spec(name).turns)

    def fixed_parts(self) -> list[str]:
        """Names of the made parts that do not turn."""
        return [name for name in self.made if not self.parts[name].turns]

    def turning_parts(self) -> list[str]:
        """Names of the made parts that turn about the axis."""
        return [name for name in self.made if self.parts[name].turns]

    def carriers(self) -> list[str]:
        """Names of the made parts between hub and lidar."""
        return [name for name in self.made if self.parts[name].seat is not None]

    def thing(self, body: str) -> str:
        """The part, or the bought product that a body is a piece of."""
        return self.bodies[body].product if body in self.bodies else body

    def mesh(self, name: str) -> TriMesh:
        """The mesh of a part, made or bought; made once, as beams, checks and scenes all want it."""
        if name not in self._meshes:
            if name in self.made:
                self._meshes[name] = mesh_of(self.made[name])
            else:
                self._meshes[name] = mesh_of(self.bought[name], *self.bodies[name].chords)
        return self._meshes[name]

    def meshes(self) -> dict[str, TriMesh]:
        """Meshes of all parts by name."""
        return {name: self.mesh(name) for name in (*self.made, *self.bought)}

    def inertial(self, name: str) -> Inertial:
        """Mass properties of a made part, integrated once: each joint asks for all that hangs on it."""
        if name not in self._inertials:
            density = self.parts[name].density_g_cm3(self.layout.scanner.printer)
            self._inertials[name] = of_solid(self.made[name], density)
        return self._inertials[name]

    def print_pose(self, name: str) -> PrintPose:
        """How a part is printed: decided once, before its label, for checks, print files, sheet and plates."""
        if name not in self._poses:
            self._poses[name] = print_pose(self.mesh(name), self.layout.scanner.printer.bed_mm)
        return self._poses[name]

    def outlines(self) -> dict[str, TriMesh]:
        """Outlines of all parts by name, as they look from outside while they turn."""
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
    """All parts under one named root, each with its name and colour."""
    tree = cq.Assembly(name="scanwright")
    for name, solid in (assembly.made | assembly.bought).items():
        tree.add(solid, name=name, color=cq.Color(*assembly.spec(name).colour))
    return tree


def alone(name: str, solid: cq.Solid, colour: Colour) -> cq.Assembly:
    """One part under a named root: a STEP file without a root names its product by a process-wide counter."""
    return cq.Assembly(name="scanwright").add(solid, name=name, color=cq.Color(*colour))
