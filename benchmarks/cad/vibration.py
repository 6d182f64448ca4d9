"""First natural frequency by CalculiX: `python -m benchmarks.cad.vibration OUT...`, or `--random COUNT SEED`.

OUT are build folders; `--random` makes the first COUNT scanners of `benchmarks.cad.random_scanners`.
Gmsh meshes linkage, shaft and mount with tetrahedra; lidar, hub's bore, horn and what stands still are rigid bodies.
The shaft is a body, not a beam, the linkage's mass is where it is, and its screws alone hold the lidar: nothing is
shared with `cad/statics` but stiffness of horn, cage, belt and bearing seats, masses and materials. One line for each
folder, exit code 1 if `scanwright check` states a frequency that is off by more than it states.
"""

from __future__ import annotations

import contextlib
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.cad.elements import CALCULIX, HEAD_MM, Tetrahedra, tetrahedra
from benchmarks.cad.random_scanners import described, scanners
from scanwright.cad.assembly.assembly import Assembly, link_bodies
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.checks.loads.deflection import ERROR, deflection_checks, mount_checks, row_of_scanner
from scanwright.cad.geometry.inertia import Inertial, together
from scanwright.cad.layout.belt.loads import SEAT_N_PER_M, belt_nm_per_rad
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.direct.cage import BearingCage, stiffness_n_per_m
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.loads import ALUMINIUM_G_CM3, ALUMINIUM_PA, HORN_TILTS_RAD, trusted_moment_nm
from scanwright.cad.layout.names import BASE_MOUNT
from scanwright.cad.parts.mounts.base_mount import FOOT_RADIUS
from scanwright.cad.screws import passing_hole
from scanwright.design.angles import load_angles
from scanwright.design.arrays import Array, Mask
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner
from scanwright.design.task.task import load_task

STIFF = 1e7  # N/mm: of what does not give way
POISSON = 0.35
PAD_MM = 1.5  # around a screw's hole that the lidar is held by, beyond the head
NOTHING_KG = 1e-5


@dataclass
class Model:
    """An input file of CalculiX while it is written; mm, N, tonnes."""

    lines: list[str] = field(default_factory=list)
    nodes: int = 0
    elements: int = 0
    names: int = 0

    def point(self, at: Array) -> int:
        """Add a node."""
        self.nodes += 1
        self.lines += ["*NODE", f"{self.nodes}, " + ", ".join(f"{x:.9g}" for x in at)]
        return self.nodes

    def solid(self, body: Tetrahedra, modulus_mpa: float, density_g_cm3: float, poisson: float) -> int:
        """Add an elastic body; returns the number before its first node."""
        first, name = self.nodes, self._name("BODY")
        used = np.unique(body.cells)
        self.lines += ["*NODE"]
        self.lines += [
            f"{first + i + 1}, {x:.9g}, {y:.9g}, {z:.9g}" for i, (x, y, z) in zip(used, body.nodes[used], strict=True)
        ]
        self.nodes += len(body.nodes)
        self.lines += [f"*ELEMENT, TYPE=C3D10, ELSET={name}"]
        for row in (body.cells[:, CALCULIX] + first + 1).tolist():
            self.elements += 1
            self.lines.append(f"{self.elements}, {', '.join(map(str, row))}")
        self.lines += [f"*MATERIAL, NAME=M{name}", "*ELASTIC", f"{modulus_mpa}, {poisson}"]
        self.lines += ["*DENSITY", f"{density_g_cm3 * 1e-9}", f"*SOLID SECTION, ELSET={name}, MATERIAL=M{name}"]
        return first

    def rigid(self, nodes: list[int], at: Array, body: Inertial | None) -> tuple[int, int]:
        """Add a rigid body of nodes and perhaps a mass; returns its nodes of shift and of rotation."""
        masses: list[int] = []
        if body is not None and body.mass_kg > NOTHING_KG:
            turn, axes = np.linalg.eigh(body.inertia_kg_m2)
            arms = 1000 * np.sqrt(np.maximum(turn.sum() / 2 - turn, 1e-12) * 3 / body.mass_kg)
            offsets = [sign * arm * axis for arm, axis in zip(arms, axes.T, strict=True) for sign in (1, -1)]
            masses = [self.point(1000 * body.centre_m + offset) for offset in offsets]
            name = self._name("MASS")
            self.lines.append(f"*ELEMENT, TYPE=MASS, ELSET={name}")
            for node in masses:
                self.elements += 1
                self.lines.append(f"{self.elements}, {node}")
            self.lines += [f"*MASS, ELSET={name}", f"{body.mass_kg / 6e3:.9g}"]
        name = self._name("RIGID")
        shift, rotation = self.point(at), self.point(at)
        self.lines += [f"*NSET, NSET={name}", *(f"{node}," for node in [*nodes, *masses])]
        self.lines.append(f"*RIGID BODY, NSET={name}, REF NODE={shift}, ROT NODE={rotation}")
        return shift, rotation

    def spring(self, one: int, other: int, axis: int, stiffness: float) -> None:
        """Add a spring between two nodes along an axis, 1 to 3."""
        name = self._name("SPRING")
        self.elements += 1
        self.lines += [f"*ELEMENT, TYPE=SPRING2, ELSET={name}", f"{self.elements}, {one}, {other}"]
        self.lines += [f"*SPRING, ELSET={name}", f"{axis}, {axis}", f"{stiffness:.3f}"]

    def first_hz(self, held: list[int], folder: Path) -> Array:
        """Run it, some nodes fixed."""
        name = self._name("HELD")
        end = [f"*NSET, NSET={name}", *(f"{node}," for node in held), "*BOUNDARY", f"{name}, 1, 3"]
        end += ["*STEP", "*FREQUENCY", "4", "*END STEP"]
        (folder / "row.inp").write_text("\n".join([*self.lines, *end]) + "\n", encoding="ascii")
        done = subprocess.run(["ccx", "-i", "row"], cwd=folder, capture_output=True, text=True, check=False)
        text = (folder / "row.dat").read_text(encoding="ascii") if (folder / "row.dat").exists() else ""
        found = [
            float(line.split()[3]) for line in text.splitlines() if re.match(r"\s+\d+(\s+-?[\d.E+-]+){4}\s*$", line)
        ]
        if not found:
            raise RuntimeError(f"ccx: {done.stdout[-800:]}")
        return np.array(found)

    def _name(self, kind: str) -> str:
        self.names += 1
        return f"{kind}{self.names}"


def by_calculix(scanner: Scanner, assembly: Assembly, folder: Path) -> Array:
    """Return the first natural frequencies [Hz]."""
    layout, printer, model = assembly.layout, scanner.printer, Model()
    stack, linkage, bodies, R = (
        layout.stack,
        layout.linkage,
        link_bodies(assembly),
        scanner.angles.R_rot_laser(),
    )
    plastic = 1000 * printer.modulus_gpa, printer.density_g_cm3, POISSON
    metal = ALUMINIUM_PA / 1e6, ALUMINIUM_G_CM3, 0.33

    first, *others = (assembly.made[name] for name in assembly.carriers())
    carrier = tetrahedra(first.fuse(*others) if others else first, folder)
    at = model.solid(carrier, *plastic)
    x, y, z = (carrier.nodes @ R).T
    pads = np.min([np.hypot(x - hole[0], y - hole[1]) for hole in linkage.holes], axis=0)
    on_pads = (abs(z - linkage.seat) < 0.01) & (pads < linkage.screw.head_diameter / 2 + PAD_MM)
    bore = _inside(carrier, stack.shaft_diameter / 2 + 0.3, stack.shoulder, stack.spigot_top + 0.1)
    model.rigid(_numbers(on_pads, carrier, at), np.zeros(3), bodies["laser"].moved(scanner.angles.T_rot_laser()))

    shaft_name = layout.drive.shaft
    shaft = tetrahedra(assembly.made[shaft_name], folder)
    own = model.solid(shaft, *(plastic if not assembly.parts[shaft_name].metal else metal))
    spigot = _inside(shaft, stack.shaft_diameter / 2 + 0.1, stack.shoulder, stack.spigot_top + 0.1)
    rest = _less(bodies["rot"], [assembly.inertial(name) for name in (*assembly.carriers(), shaft_name)])
    model.rigid(_numbers(bore, carrier, at) + _numbers(spigot, shaft, own), np.array([0, 0, stack.shoulder]), rest)

    mount = BASE_MOUNT in assembly.made
    ends: list[tuple[int, float]] = []  # nodes of the stator beside a bearing, and heights
    for height in _bearing_heights(layout.drive.of(DirectStack), layout.drive.of(BeltStack)):
        ends.append((model.point(np.array([0.0, 0.0, height])), height))
    fixed = bodies["servo"]
    seats: list[int] = []
    held: list[int] = []
    if mount:
        deck, mounted = layout.deck, layout.drive.mounted
        body = tetrahedra(assembly.made[BASE_MOUNT], folder)
        number = model.solid(body, *plastic)
        x, y, z = ((body.nodes - np.array(deck.centre)) @ deck.rotation()).T
        head = passing_hole(deck.screw, printer) / 2 + HEAD_MM
        near = np.any([np.hypot(x - hole[0], y - hole[1]) < head for hole in deck.deck_holes], axis=0)
        held = _numbers(near & (abs(z) < 0.01), body, number)
        x, y, z = body.nodes.T
        feet = np.any([np.hypot(x - hole[0], y - hole[1]) < FOOT_RADIUS + 0.1 for hole in mounted.holes], axis=0)
        seats = _numbers(feet & (abs(z - mounted.ears) < 0.01), body, number)
        fixed = _less(fixed, [assembly.inertial(BASE_MOUNT)])
    stator = model.rigid([*seats, *(node for node, _ in ends)], np.array([0.0, 0.0, stack.horn]), fixed)
    if not mount:
        held = list(stator)

    direct, belt = layout.drive.of(DirectStack), layout.drive.of(BeltStack)
    if direct is not None:
        face = np.hypot(*shaft.nodes[:, :2].T) < scanner.servo.horn_diameter_mm / 2 + 0.1
        horn = model.rigid(
            _numbers(face & (abs(shaft.nodes[:, 2] - stack.horn) < 0.01), shaft, own),
            np.array([0, 0, stack.horn]),
            None,
        )
        tilt = 1000 * trusted_moment_nm(scanner) / HORN_TILTS_RAD
        for axis, turns in ((1, tilt), (2, tilt), (3, 100 * STIFF)):
            model.spring(stator[0], horn[0], axis, STIFF)
            model.spring(stator[1], horn[1], axis, turns)
        cage = layout.drive.of(BearingCage)
        if cage is not None:
            band = _rim(shaft, stack.shaft_diameter / 2, direct.bearing_middle, cage.bearing.width_mm)
            sleeve = model.rigid(_numbers(band, shaft, own), np.array([0, 0, direct.bearing_middle]), None)
            for axis in (1, 2):
                model.spring(ends[0][0], sleeve[0], axis, stiffness_n_per_m(direct, cage.ears) / 1000)
    if belt is not None:
        for (node, height), axes in zip(ends, ((1, 2, 3), (1, 2)), strict=True):
            band = _rim(shaft, belt.seat_diameter / 2, height, belt.carrier.width_mm)
            inner = model.rigid(_numbers(band, shaft, own), np.array([0, 0, height]), None)
            for axis in axes:
                model.spring(node, inner[0], axis, STIFF if axis == 3 else SEAT_N_PER_M / 1000)
        band = _rim(shaft, belt.seat_diameter / 2, belt.belt_middle, belt.belt.width_mm)
        pulley = model.rigid(_numbers(band, shaft, own), np.array([0, 0, belt.belt_middle]), None)
        model.spring(stator[1], pulley[1], 3, 1000 * belt_nm_per_rad(belt))
    return model.first_hz(held, folder)


def _bearing_heights(direct: DirectStack | None, belt: BeltStack | None) -> list[float]:
    if belt is not None:
        return [belt.upper_middle, belt.lower_middle]
    return [direct.bearing_middle] if direct is not None and direct.bearing is not None else []


def _less(body: Inertial, parts: list[Inertial]) -> Inertial:
    return together([body, *(Inertial(-part.mass_kg, part.centre_m, -part.inertia_kg_m2) for part in parts)])


def _inside(body: Tetrahedra, radius: float, low: float, high: float) -> Mask:
    x, y, z = body.nodes.T
    return np.asarray((np.hypot(x, y) < radius) & (z > low - 0.01) & (z < high))


def _rim(body: Tetrahedra, radius: float, middle: float, width: float) -> Mask:
    x, y, z = body.nodes.T
    return np.asarray((abs(np.hypot(x, y) - radius) < 0.1) & (abs(z - middle) < width / 2))


def _numbers(chosen: Mask, body: Tetrahedra, before: int) -> list[int]:
    chosen = chosen & np.isin(np.arange(len(body.nodes)), body.cells)
    return [int(i) + before + 1 for i in np.flatnonzero(chosen)]


def main() -> None:
    """Print the lines."""
    off = False
    words = sys.argv[1:]
    for made in _random(*map(int, words[1:])) if words[:1] == ["--random"] else _built(words):
        off |= compared(*made)
    sys.exit(off)


def _built(folders: list[str]) -> Iterator[tuple[str, Scanner, Assembly]]:
    for out in map(Path, folders):
        scanner = load_task(out / "task.toml").scanner(load_angles(out / "angles.json"))
        yield out.name, scanner, make_parts(scanner)


def _random(count: int, seed: int) -> Iterator[tuple[str, Scanner, Assembly]]:
    found = 0
    for number, scanner in scanners(load_catalogue(), seed):
        if scanner is None:
            continue
        with contextlib.suppress(BuildError):
            assembly = make_parts(scanner)
            found += 1
            yield f"{number} {described(scanner)}", scanner, assembly
        if found == count:
            return


def compared(name: str, scanner: Scanner, assembly: Assembly) -> bool:
    """Print the line of one scanner, and return whether the stated frequency is off by more than its error."""
    bodies = link_bodies(assembly)
    (_, linkage), (_, mount) = (check(assembly, bodies) for check in (deflection_checks, mount_checks))
    assert linkage is not None
    own = row_of_scanner(assembly, bodies, linkage, mount).frequencies_hz()
    with tempfile.TemporaryDirectory() as folder:
        found = by_calculix(scanner, assembly, Path(folder))
    off = float(own[0] / found[0] - 1)
    print(
        f"{name}: {own[0]:.1f} Hz, CalculiX {found[0]:.1f} ({off:+.0%}); next {own[1]:.1f}, {found[1]:.1f}", flush=True
    )
    return abs(off) > ERROR


if __name__ == "__main__":
    main()
