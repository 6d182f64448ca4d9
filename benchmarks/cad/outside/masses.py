"""Volumes, masses and balance from the solids, beside what the files of a build state."""

from __future__ import annotations

import csv
import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.cad.outside.bodies import Array, StepBody, mesh_of, solid_of
from benchmarks.cad.outside.screws import HEADS_MM, FoundScrew

# g/cm3: aluminium by EN 573 and makers' sheets, steel, stainless steel, brass
METALS_G_CM3 = {"7075": 2.81, "6082": 2.70, "6060": 2.70, "2007": 2.85, "stainless": 7.9, "steel": 7.85, "brass": 8.47,
                "aluminium": 2.70}  # fmt: skip
LEAD_G_CM3 = 1.5  # of a bundle of 3.5 mm: five wires of 1.3 mm with 0.14 mm2 of copper, the rest insulation and air
VOLUME_SHARE = 1e-4  # of a solid's volume: what two writers of the same solid may differ by
CHORD_SHARE, LABEL_SHARE = 2e-3, 0.015  # of a mesh's volume: its chords, and its engraved label
MASS_SHARE = 0.01
PLACE_MM = 0.01


def bill(folder: Path) -> list[dict[str, str]]:
    """Return the rows of `bom.csv`."""
    with (folder / "bom.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def density_g_cm3(row: Mapping[str, str], printers: Mapping[str, float]) -> float:
    """Return the density of the material that a row of the bill names."""
    note = row["note"]
    known = {name: density for name, density in printers.items() if note.startswith(f"{name},")} or {
        name: density for name, density in METALS_G_CM3.items() if name in note
    }
    return next(iter(known.values()), float("nan"))


def part_faults(folder: Path, bodies: Mapping[str, StepBody], printers: Mapping[str, float]) -> Iterator[str]:
    """Yield where volume, mass, place or mesh of a made part differs between the files of a build."""
    stated = {each["name"]: each for each in json.loads((folder / "manifest.json").read_text("utf-8"))["parts"]}
    rows = {row["part"]: row for row in bill(folder) if row["kind"] in ("printed", "turned", "sawn", "bent", "milled")}
    if set(stated) != set(rows):
        yield f"parts: the manifest has {sorted(stated)}, the bill {sorted(rows)}"
    for name, each in stated.items():
        solid = solid_of(folder / "parts" / f"{name}.step")
        volume, mass = solid.Volume(), density_g_cm3(rows[name], printers) * solid.Volume() / 1e3
        if not solid.isValid() or len(solid.Solids()) != 1:
            yield f"{name}: parts/{name}.step is no valid single solid"
        if not np.isclose(volume, each["volume_mm3"], rtol=VOLUME_SHARE):
            yield f"{name}: volume {volume:.1f} mm3, the manifest states {each['volume_mm3']:.1f}"
        for file, value in (("manifest", each["mass_g"]), ("bill", float(rows[name]["mass_g"]))):
            if not np.isclose(mass, value, rtol=MASS_SHARE, atol=0.06):
                yield f"{name}: mass {mass:.1f} g, the {file} states {value:.1f}"
        placed = bodies[name].shape if name in bodies else None
        if placed is None or not np.isclose(placed.Volume(), volume, rtol=VOLUME_SHARE):
            yield f"{name}: assembly.step does not have the solid of parts/{name}.step"
        elif (placed.Center() - solid.Center()).Length > PLACE_MM:
            yield f"{name}: at another place in assembly.step than in parts/{name}.step"
        for mesh_file in (folder / "parts" / f"{name}.stl", folder / "print" / f"{name}.3mf"):
            if mesh_file.exists():
                mesh = mesh_of(mesh_file)
                more = mesh.volume / volume - 1
                if not mesh.is_watertight or not -CHORD_SHARE - LABEL_SHARE < more < CHORD_SHARE:
                    yield f"{name}: {mesh_file.name}: closed {mesh.is_watertight}, {more:+.2%} of volume"


def turning_bodies(folder: Path, bodies: Mapping[str, StepBody]) -> set[str]:
    """Return the bodies that turn with the rotor: the made ones of `scanner.urdf`, and bought ones about its axis."""
    robot = ET.fromstring((folder / "scanner.urdf").read_text("utf-8"))
    made = {
        Path(mesh.attrib["filename"]).stem
        for link in robot.findall("link")
        if link.attrib["name"] in ("rot", "laser")
        for mesh in link.iter("mesh")
    }
    turns = re.compile(r"lidar_|rotor_lead|ring_rotor|servo_horn|bearing_inner|lower_bearing_inner")
    return {name for name in bodies if name in made or turns.match(name)}


def urdf_moments(folder: Path) -> dict[str, Array]:
    """Return the moment (x, y) of each link that turns about the rotor's axis, and its mass [g mm, g]; shape (3,)."""
    robot = ET.fromstring((folder / "scanner.urdf").read_text("utf-8"))
    poses = {"rot": (np.eye(3), np.zeros(3))}
    for joint in robot.findall("joint"):
        parent, child = (_attributes(joint, name)["link"] for name in ("parent", "child"))
        if parent in poses:
            origin = _attributes(joint, "origin")
            R, t = poses[parent]
            poses[child] = R @ _rpy(origin["rpy"]), t + R @ (1e3 * np.array(origin["xyz"].split(), dtype=float))
    moments = {}
    for link in robot.findall("link"):
        if link.attrib["name"] in poses and (inertial := link.find("inertial")) is not None:
            R, t = poses[link.attrib["name"]]
            at = 1e3 * np.array(_attributes(inertial, "origin")["xyz"].split(), dtype=float)
            mass = 1e3 * float(_attributes(inertial, "mass")["value"])
            moments[link.attrib["name"]] = mass * np.array([*(t + R @ at)[:2], 1.0])
    return moments


def _attributes(parent: ET.Element, name: str) -> dict[str, str]:
    found = parent.find(name)
    return {} if found is None else found.attrib


def _rpy(words: str) -> Array:
    roll, pitch, yaw = map(float, words.split())
    (a, b), (c, d), (e, f) = ((np.cos(x), np.sin(x)) for x in (roll, pitch, yaw))
    return (
        np.array([[e, -f, 0], [f, e, 0], [0, 0, 1]])
        @ np.array([[c, 0, d], [0, 1, 0], [-d, 0, c]])
        @ np.array([[1, 0, 0], [0, a, -b], [0, b, a]])
    )


def measured_moment(
    folder: Path, bodies: Mapping[str, StepBody], turning: set[str], screws: Sequence[FoundScrew],
    printers: Mapping[str, float],
) -> Array:  # fmt: skip
    """Return the moment (x, y) of made parts, screws and leads that turn about the axis [g mm]; the rest is round."""
    rows = {row["part"]: row for row in bill(folder)}
    total = np.zeros(3)
    for lead in (bodies[name].shape for name in turning if name.startswith("rotor_lead")):
        total += LEAD_G_CM3 * lead.Volume() / 1e3 * np.array(lead.Center().toTuple())
    for name in turning & set(rows):
        shape = bodies[name].shape
        total += density_g_cm3(rows[name], printers) * shape.Volume() / 1e3 * np.array(shape.Center().toTuple())
    for screw in screws:
        if screw.written.part in turning and screw.written.holds != "grub":
            diameter, height = HEADS_MM[screw.written.size_mm]
            for across, length, middle in (
                (diameter, height, -height / 2),
                (0.93 * screw.written.size_mm, screw.written.length_mm, screw.written.length_mm / 2),
            ):
                grams = 1e-3 * METALS_G_CM3["steel"] * np.pi / 4 * across**2 * length
                total += grams * (screw.seat + middle * screw.along)
    return total[:2]
