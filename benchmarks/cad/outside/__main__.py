"""Measure builds from their files alone: `python -m benchmarks.cad.outside FOLDER...`, or `--random COUNT [SEED]`.

It reads assembly.step, the STEP, STL and 3MF files of the parts, assembly.md, bom.csv, scanner.urdf and the manifest,
and finds by itself: the hole, thread, room and straight line for the key of each screw, the least distance over a turn,
overlaps, balance, and the volume and mass of each part. It shares no code with the package. One line for each build,
and one for each value that differs from what the files state or that no check reported. Exit code 1 if there is one.
`--random` first builds COUNT random tasks under `out/outside` by the command line.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cad.outside.access import collisions, key_blocked, screw_points
from benchmarks.cad.outside.bodies import Array, StepBody, step_bodies
from benchmarks.cad.outside.gaps import overlaps, turning_gap
from benchmarks.cad.outside.masses import measured_moment, part_faults, turning_bodies, urdf_moments
from benchmarks.cad.outside.random_tasks import built, catalogue
from benchmarks.cad.outside.screws import COAXIAL_MM, LOOSE_MM, TIGHT_MM, FoundScrew, found_screws
from benchmarks.cad.outside.steps import WrittenScrews, present, steps_of

GAP_MM = 0.05  # that a distance may differ from the stated one
HELD_MM = 0.15
OFF = re.compile(r"± ([\d.]+) mm")  # stated error of the rotor's centre of mass
RANDOM = Path("out/outside")


@dataclass(frozen=True, slots=True)
class Measured:
    """What a build's files show: the numbers of its line, and the lines of what disagrees."""

    screws: int
    gap_mm: float
    stated_gap_mm: float
    overlap_mm3: float
    moment_gmm: float
    stated_moment_gmm: float
    faults: tuple[str, ...]

    @property
    def words(self) -> str:
        """The numbers of its line."""
        return (
            f"{self.screws} screws, clearance {self.gap_mm:.3f} mm (stated {self.stated_gap_mm:.3f}), overlap "
            f"{self.overlap_mm3:.2f} mm3, moment {self.moment_gmm:.0f} g mm (scanner.urdf {self.stated_moment_gmm:.0f})"
        )


def measured(folder: Path, products: list[dict[str, Any]]) -> Measured:
    """Measure one build folder; `products` are those of `scanwright catalogue --json`."""
    bodies = step_bodies(folder / "assembly.step")
    checks = json.loads((folder / "checks.json").read_text("utf-8"))["checks"]
    steps = steps_of((folder / "assembly.md").read_text("utf-8"))
    printers = {each["name"]: each["density_g_cm3"] for each in products if each["kind"] == "printer"}
    turning, deck = turning_bodies(folder, bodies), deck_of(folder, bodies)
    faults: list[str] = []
    screws: list[FoundScrew] = []
    for step, there in zip(steps, present(steps, bodies), strict=True):
        for written in step.screws:
            found = found_screws(written, bodies, deck)
            screws += found
            faults += [f"{written.words}: {words}" for words in screw_faults(written, found, checks)]
            for number, screw in enumerate(found, start=1):
                if (by := key_blocked(screw, bodies, there, turning)) is not None:
                    faults.append(f"{written.words}: no straight line for the key of screw {number}: {by}")
                faults += [f"{written.words}: screw {number}: {words}" for words in collisions(screw, bodies, there)]
    extra = {
        f"screw of {screw.written.words}": (screw.written.part in turning, screw_points(screw)) for screw in screws
    }
    gap, where = turning_gap(bodies, turning, extra)
    stated = next(each["value"] for each in checks if each["kind"] == "clearance")
    if gap < min(stated, 5.0) - GAP_MM:
        faults.append(f"clearance {gap:.3f} mm, {stated:.3f} stated: {where}")
    shared = sorted(overlaps(bodies), reverse=True)
    faults += [f"{names} share {volume:.2f} mm3" for volume, names in shared]
    faults += part_faults(folder, bodies, printers)
    links = urdf_moments(folder)
    lidar, told = links["laser"][:2], sum(links.values(), np.zeros(3))
    moment = lidar + measured_moment(folder, bodies, turning, screws, printers)
    error = OFF.search(next(each["message"] for each in checks if each["kind"] == "centre_of_mass"))
    if np.linalg.norm(moment - told[:2]) > (float(error[1]) if error else 0.0) * told[2]:
        faults.append(f"moment about the axis {moment.round()} g mm, scanner.urdf has {told[:2].round()}")
    failed = {each["kind"] for each in checks if each["severity"] == "error"}
    return Measured(
        len(screws), gap, stated, shared[0][0] if shared else 0.0, float(np.linalg.norm(moment)),
        float(np.linalg.norm(told[:2])), tuple(each for each in faults if not _reported(each, failed)),
    )  # fmt: skip


def screw_faults(written: WrittenScrews, found: list[FoundScrew], checks: list[dict[str, Any]]) -> Iterator[str]:
    """Yield what is wrong with the holes and threads of the screws of a line."""
    if len(found) < written.count:
        yield f"{len(found)} of {written.count} screws have a hole in both bodies"
    for screw in found:
        if (
            not written.size_mm - 2 * TIGHT_MM < screw.hole_mm < written.size_mm + LOOSE_MM
            and screw.written.holds != "grub"
        ):
            yield f"hole of {screw.hole_mm:.2f} mm"
        if screw.thread_off_mm > COAXIAL_MM:
            yield f"what holds its thread is {screw.thread_off_mm:.2f} mm off the axis"
    if written.holds == "grub":
        return
    number = f"ISO {written.standard} M{written.size_mm:g} x {written.length_mm:g}:"
    for each in checks:
        if (
            each["kind"] == "screw"
            and f"{written.part} on {written.onto}: " in each["message"]
            and number in each["message"]
        ):
            if found and (least := min(screw.held_mm for screw in found)) < each["value"] - HELD_MM:
                yield f"{least:.2f} mm of thread, {each['value']:.2f} stated"
            return
    yield "no check states its thread"


def deck_of(folder: Path, bodies: dict[str, StepBody]) -> Array:
    """Return a point of the deck's face and its normal towards the scanner, in the rotor's frame; shape (2, 3)."""
    record = json.loads((folder / "angles.json").read_text("utf-8"))
    a, b = (np.radians(record["angles_deg"][name]) for name in ("alpha_rot", "beta_rot"))
    Rx = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    Ry = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    R, t = Rx @ Ry, np.array(record["t_world_rot_mm"])
    at, up = -R.T @ t, R.T @ np.array([0.0, 0.0, 1.0])
    middle = np.mean([body.mesh.bounds.mean(axis=0) for body in bodies.values()], axis=0)
    return np.array([at, up * np.sign((middle - at) @ up)])


def _reported(fault: str, failed: set[str]) -> bool:
    kinds = {"clearance": "clearance", "share": "interference", "straight line": "driver_access", "thread": "screw"}
    return any(word in fault and kind in failed for word, kind in kinds.items())


def main(words: list[str]) -> int:
    """Print the lines; return the exit code."""
    folders = [Path(word) for word in words]
    if words[:1] == ["--random"]:
        folders, refused = built(RANDOM, int(words[1]), int(words[2]) if len(words) > 2 else 0)
        print(*(f"refused {line}" for line in refused), sep="\n")
    if missing := [folder for folder in folders if not (folder / "checks.json").is_file()]:
        sys.exit(f"{missing[0]}: no checks.json: name the folder of a build, such as out/low_cost")
    products, faults, screws = catalogue(), 0, 0
    for folder in folders:
        found = measured(folder, products)
        faults, screws = faults + len(found.faults), screws + found.screws
        print(f"{'FAIL' if found.faults else 'ok  '} {folder.name}: {found.words}", flush=True)
        for line in found.faults:
            print(f"     {line}", flush=True)
    print(f"{len(folders)} builds with {screws} screws: {faults} disagreements")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
