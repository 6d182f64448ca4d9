"""Linkage and mount by another's finite elements: `python -m benchmarks.cad.elements OUT...` (build folders).

Gmsh meshes the parts with tetrahedra of second order, CalculiX solves them (Debian: `apt-get install gmsh
calculix-ccx`): nothing is shared with `cad/statics` but loads and material. The linkage is held all around the shaft,
the mount under the heads of the deck's screws. Two lines for each folder: how far gravity turns the lidar by the
linkage alone, along the axis that bends it most, how far what `scanwright check` works with is off, and what share of
its stated error that is; and how far the mount gives way, beside what `mount_lean` says of it: what stays the same and
what changes over a turn.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cadquery as cq
import numpy as np

from scanwright.cad.assembly.assembly import Assembly, link_bodies, rotor_of
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.checks.loads.deflection import LEAN_ERROR, LEAN_LEAST_DEG, LEAST_ERROR, carried
from scanwright.cad.geometry.inertia import of_solid
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, BASE_MOUNT
from scanwright.cad.parts.mounts.base_mount import FOOT_RADIUS
from scanwright.cad.screws import passing_hole
from scanwright.cad.statics.sag import POISSON, linkage_sag, mount_sag
from scanwright.design.angles import load_angles
from scanwright.design.arrays import Array, Mask
from scanwright.design.frames import STANDARD_GRAVITY_M_S2, Rz
from scanwright.design.scanner import Scanner
from scanwright.design.task.task import load_task

EDGE_MM = 5.0  # of the tetrahedra
CALCULIX = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)  # where a tetrahedron of Gmsh has its nodes
BORE_MM = 0.3  # the hub's bore is larger than the shaft by less
HEAD_MM = 4.0  # of a deck screw's washer beyond the hole


@dataclass(frozen=True, slots=True)
class Tetrahedra:
    """A body: nodes [mm], shape (n, 3), tetrahedra, (m, 10), and the triangles of its surface, (t, 6)."""

    nodes: Array
    cells: Array
    surface: Array

    def middles(self, chosen: Mask) -> tuple[Array, Array]:
        """Of some triangles, the nodes amid their edges, each once, and the area [mm2] that each stands for."""
        corners = self.nodes[self.surface[chosen, :3]]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        found, index = np.unique(self.surface[chosen, 3:], return_inverse=True)
        return found, np.bincount(index.ravel(), np.repeat(area / 3, 3))


def tetrahedra(solid: cq.Shape, folder: Path) -> Tetrahedra:
    """Of a solid, by way of its STEP file."""
    step, mesh = folder / "part.step", folder / "part.msh"
    cq.exporters.export(cq.Workplane(solid), str(step))
    straight = ["-order", "2", "-setnumber", "Mesh.SecondOrderLinear", "1"]  # bent edges turn some inside out
    sizes = ["-clmax", str(EDGE_MM), "-clmin", str(EDGE_MM / 3), "-clcurv", "12"]
    _run(["gmsh", "-3", *straight, *sizes, "-format", "msh22", str(step), "-o", str(mesh)], folder)
    lines = iter(mesh.read_text().splitlines())
    nodes, cells, surface = [], [], []
    for line in lines:
        if line == "$Nodes":
            nodes = [next(lines).split() for _ in range(int(next(lines)))]
        elif line == "$Elements":
            for row in (next(lines).split() for _ in range(int(next(lines)))):
                if row[1] == "11":
                    cells.append(row[-10:])
                elif row[1] == "9":
                    surface.append(row[-6:])
    number = np.full(max(int(row[0]) for row in nodes) + 1, -1)
    number[[int(row[0]) for row in nodes]] = np.arange(len(nodes))
    places = np.array([row[1:4] for row in nodes], float)
    return Tetrahedra(places, number[np.array(cells, int)], number[np.array(surface, int)])


def turned(
    body: Tetrahedra,
    held: Array,
    seat: tuple[Array, Array],
    cases: Sequence[tuple[Array, float, Array]],
    material: tuple[float, float],
    folder: Path,
) -> Array:
    """Rotation [rad] of a seat, shape (cases, 3).

    Args:
        body: the part.
        held: nodes that cannot move.
        seat: nodes of the seat and the area that each stands for; it does not stay plane.
        cases: direction of gravity, and what lies on the seat: its mass [kg] and centre [m].
        material: modulus [MPa] and density [g/cm3].
        folder: where the solver may write.

    Raises:
        RuntimeError: the solver gives up.
    """
    nodes, share = seat
    middle = share @ body.nodes[nodes] / share.sum()
    arms = body.nodes[nodes] - middle
    inertia = (share * (arms**2).sum(axis=1)).sum() * np.eye(3) - (share * arms.T) @ arms
    modulus, density = material
    text = ["*NODE, NSET=ALL", *(f"{i + 1}, {x:.9g}, {y:.9g}, {z:.9g}" for i, (x, y, z) in enumerate(body.nodes))]
    text += ["*ELEMENT, TYPE=C3D10, ELSET=BODY"]
    text += [f"{i + 1}, {', '.join(map(str, row))}" for i, row in enumerate((body.cells[:, CALCULIX] + 1).tolist())]
    text += ["*NSET, NSET=HELD", *(str(node + 1) for node in held), "*NSET, NSET=SEAT"]
    text += [*(str(node + 1) for node in nodes), "*BOUNDARY", "HELD, 1, 3", "*MATERIAL, NAME=PRINTED", "*ELASTIC"]
    text += [f"{modulus}, {POISSON}", "*DENSITY", f"{density * 1e-9}"]
    text += ["*SOLID SECTION, ELSET=BODY, MATERIAL=PRINTED"]
    for down, mass_kg, centre_m in cases:
        force = mass_kg * STANDARD_GRAVITY_M_S2 * down
        moment = np.cross(1000 * centre_m - middle, force)
        forces = share[:, None] * (force / share.sum() + np.cross(np.linalg.solve(inertia, moment), arms))
        text += ["*STEP", "*STATIC", "*CLOAD, OP=NEW"]
        text += [f"{n + 1}, {axis + 1}, {f[axis]:.9g}" for n, f in zip(nodes, forces, strict=True) for axis in range(3)]
        along = ", ".join(f"{share:.9f}" for share in down)
        text += ["*DLOAD, OP=NEW", f"BODY, GRAV, {1000 * STANDARD_GRAVITY_M_S2:.6f}, {along}"]
        text += ["*NODE PRINT, NSET=SEAT", "U", "*END STEP"]
    (folder / "part.inp").write_text("\n".join(text) + "\n", encoding="ascii")
    _run(["ccx", "-i", "part"], folder)
    found = []
    for told in re.split(r"displacements.*\n", (folder / "part.dat").read_text(encoding="ascii"))[1:]:
        rows = np.array([line.split() for line in told.splitlines() if line.strip()], float)
        moved = rows[np.argsort(rows[:, 0]), 1:]
        found.append(np.linalg.solve(inertia, (share[:, None] * np.cross(arms, moved)).sum(axis=0)))
    return np.array(found)


@dataclass(frozen=True, slots=True)
class Compared:
    """A bend by CalculiX, and what a build works with, at the axis or position where it bends most.

    Attributes:
        bend: by CalculiX [rad].
        off: length of the difference [rad].
        stated: error that the build states [rad].
        changes: how much of the bend changes over a turn [rad].
        nodes: of the mesh.
    """

    bend: float
    off: float
    stated: float
    changes: float
    nodes: int


def linkage_compared(scanner: Scanner, assembly: Assembly, folder: Path) -> Compared:
    """The linkage, with its sub-plate where there is one, along the axis that bends it most."""
    stack, linkage, printer = assembly.layout.stack, assembly.layout.linkage, scanner.printer
    names, R = assembly.carriers(), scanner.angles.R_rot_laser()
    first, *others = (assembly.made[name] for name in names)
    body = tetrahedra(first.fuse(*others) if others else first, folder)
    corners = body.nodes[body.surface[:, :3]]
    radius, z = np.hypot(corners[..., 0], corners[..., 1]), corners[..., 2]
    bore = (radius < stack.shaft_diameter / 2 + BORE_MM) & (z < stack.spigot_top + 0.1)
    x, y, z = np.moveaxis(corners @ R, 2, 0)  # laser frame
    on_seat = (abs(z - linkage.seat) < 0.01) & (abs(x) < linkage.half_x) & (abs(y) < linkage.half_y)
    seat = body.middles(on_seat.all(axis=1))
    lidar = link_bodies(assembly)["laser"]
    material = 1000 * printer.modulus_gpa, printer.density_g_cm3
    half = np.array([linkage.half_x, linkage.half_y, linkage.seat])
    own = linkage_sag(stack, [assembly.mesh(name) for name in names], half, lidar, *material)
    cases = [(down, lidar.mass_kg, R @ lidar.centre_m) for down in np.eye(3)]
    found = turned(body, np.unique(body.surface[bore.all(axis=1)]), seat, cases, material, folder)
    off, bend = (np.linalg.norm(rotation, axis=1) for rotation in (own.rotation_rad.T - found, found))
    stated = np.linalg.norm(own.rotation_error_rad, axis=0)
    stated = np.maximum(stated, LEAST_ERROR * np.linalg.norm(own.rotation_rad, axis=0))
    worst = int(np.argmax(bend))
    return Compared(float(bend[worst]), float(off[worst]), float(stated[worst]), 0.0, len(body.nodes))


def mount_compared(scanner: Scanner, assembly: Assembly, folder: Path) -> Compared:
    """The mount under servo, cage and rotor: what stays the same over a turn."""
    layout, printer = assembly.layout, scanner.printer
    deck, mounted = layout.deck, layout.drive.mounted
    body = tetrahedra(assembly.made[BASE_MOUNT], folder)
    corners = body.nodes[body.surface[:, :3]]
    x, y, z = np.moveaxis((corners - np.array(deck.centre)) @ deck.rotation(), 2, 0)
    head = passing_hole(deck.screw, printer) / 2 + HEAD_MM
    near = np.any([np.hypot(x - hole[0], y - hole[1]) < head for hole in deck.deck_holes], axis=0)
    held = np.unique(body.surface[:, :3][near & (abs(z) < 0.01)])
    x, y, z = np.moveaxis(corners, 2, 0)
    on_foot = np.any([np.hypot(x - at[0], y - at[1]) < FOOT_RADIUS + 0.1 for at in mounted.holes], axis=0)
    seat = body.middles((on_foot & (abs(z - mounted.ears) < 0.01)).all(axis=1))
    bodies = link_bodies(assembly)
    mount, standing = of_solid(assembly.made[BASE_MOUNT], printer.density_g_cm3), bodies["servo"]
    rotor = rotor_of(scanner, bodies)
    masses = np.array([standing.mass_kg, -mount.mass_kg, rotor.mass_kg])
    down = -scanner.angles.T_world_rot(0.0)[2, :3]
    cases = []
    for turn in np.radians([0, 90, 180, 270]):
        centres = np.stack([standing.centre_m, mount.centre_m, Rz(turn) @ rotor.centre_m])
        cases.append((down, float(masses.sum()), masses @ centres / masses.sum()))
    material = 1000 * printer.modulus_gpa, printer.density_g_cm3
    found = turned(body, held, seat, cases, material, folder)
    stays = found.mean(axis=0)
    bend = float(np.linalg.norm(stays))
    changes = float(np.linalg.norm(found - stays, axis=1).max())
    load = carried(assembly, bodies)
    own = mount_sag(assembly.mesh(BASE_MOUNT), deck, mounted, load, *material)[0]
    stated = max(float(LEAN_ERROR * np.linalg.norm(own)), math.radians(LEAN_LEAST_DEG))
    return Compared(bend, float(np.linalg.norm(own - stays)), stated, changes, len(body.nodes))


def _line(what: str, found: Compared) -> str:
    said = (
        f"{what} turns {math.degrees(found.bend):.4f} deg, off by {found.off / found.bend:.0%}, "
        f"{found.off / found.stated:.2f} of the stated error ({found.nodes} nodes)"
    )
    return f"{said}, and {math.degrees(found.changes):.4f} deg over a turn" if found.changes else said


def _run(words: list[str], folder: Path) -> None:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{words[0]}: {done.stdout[-500:]}{done.stderr[-500:]}")


def main() -> None:
    """Print the lines."""
    for out in map(Path, sys.argv[1:]):
        scanner = load_task(out / "task.toml").scanner(load_angles(out / "angles.json"))
        assembly = make_parts(scanner)
        for part, what, compared in (
            (ALIGNMENT_LINKAGE, "linkage", linkage_compared),
            (BASE_MOUNT, "mount", mount_compared),
        ):
            if part in assembly.made:
                with tempfile.TemporaryDirectory() as folder:
                    print(f"{out.name}: {_line(what, compared(scanner, assembly, Path(folder)))}", flush=True)


if __name__ == "__main__":
    main()
