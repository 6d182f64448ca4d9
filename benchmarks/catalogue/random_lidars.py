"""Invented lidars: random bodies, holes and ears, laid out, and some of them built and measured.

    python -m benchmarks.catalogue.random_lidars [--count 200] [--built 4]

Each gets a random body, window, ears and holes (any number, kind and face, and holes that must not be used), a servo, a
ring or none, and a mount. It is laid out, or rejected with a reason. Screws of an accepted one must meet usable holes
of the record. Of the first `--built` accepted ones the parts are made, and the mesh of the part that carries the lidar
is measured: at each screw there must be a hole that passes it. Anything else than a `BuildError` is a crash. Exit code
1 if a screw misses, or a run crashes.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.cad.combinations import screws_without_a_hole
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.names import LIDAR_BODY
from scanwright.cad.measure.bores import walls_of
from scanwright.cad.parts.all_parts import laid_out
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import BuildError
from scanwright.design.scanner import Scanner, scanner_of

SIZES = ("M2", "M2.5", "M3", "M4", "M5", "M6")
SETS = (
    ("MX-64R", "UH1256-02-0610-06S"),
    ("MX-64R", "SNU11-P0210"),
    ("MX-64R", "SRC022A-6"),
    ("XM430-W350", None),
    ("XL430-W250", None),
    ("XM540-W270", None),
)
OFF_MM = 2.1  # slots take a screw this far from its place


def random_holes(random: np.random.Generator, half: tuple[float, float], tall: float) -> list[dict[str, Any]]:
    """Return holes: a set in the base, or in ears, or in sides or the rear only, and some that carry no load."""
    size, depth = str(random.choice(SIZES)), float(random.uniform(2.0, 12.0))
    x, y = random.uniform(0.5, 0.92) * half[0], random.uniform(0.5, 0.92) * half[1]
    square = [(x, y), (-x, y), (-x, -y), (x, -y)]
    kind = str(random.choice(["tapped", "tapped", "self_tapping"]))
    pattern = str(random.choice(["square", "diagonal", "free", "sides", "one", "ears"]))
    places = {
        "square": square,
        "diagonal": square[::2],
        "free": [tuple(random.uniform(-0.9, 0.9, 2) * half) for _ in range(random.integers(2, 7))],
        "one": square[:1],
        "ears": [(half[0] + 4.0, y), (half[0] + 4.0, -y), (-half[0] - 4.0, 0.0)],
        "sides": [],
    }[pattern]
    holes: list[dict[str, Any]] = [
        {"at_mm": (*place, 0.0), "axis": "-z", "kind": kind, "size": size, "depth_mm": depth} for place in places
    ]
    if pattern == "ears":
        for hole in holes:
            hole |= {"kind": "through", "depth_mm": 3.5, "head_space_mm": float(random.uniform(2.0, 20.0))}
    if pattern == "sides":
        faces = [("+y", "-y"), ("-x",), ("+x", "-x"), ("+y",), ("+y", "-x")][int(random.integers(5))]
        height = float(random.uniform(0.1, 0.6) * tall)
        for face in faces:
            across, sign = "xy".index(face[1]), 1.0 if face[0] == "+" else -1.0
            for aside in random.uniform(-0.8, 0.8, int(random.integers(1, 4))).tolist():
                mouth = np.insert([aside * half[1 - across], height], across, sign * half[across]).tolist()
                holes.append({"at_mm": mouth, "axis": face, "kind": kind, "size": size, "depth_mm": depth})
    for _ in range(int(random.integers(0, 3))):
        holes.append(
            {
                "at_mm": [*random.uniform(-0.9, 0.9, 2) * half, 0.0],
                "axis": "-z",
                "kind": str(random.choice(["pin", "case_screw", "slot"])),
                "size": "M3",
                "depth_mm": 3.0,
            }
        )
    return holes


def random_lidar(random: np.random.Generator) -> Lidar:
    """Return a lidar; its beams are those of one that is sold."""
    base = load_catalogue().get("UST-10LX", Lidar)
    half = tuple(random.uniform(17.0, 55.0, 2).tolist())
    tall = float(random.uniform(30.0, 120.0))
    window = float(random.uniform(0.5, 0.75) * tall)
    holes = random_holes(random, half, tall)
    ears = [
        ((h["at_mm"][0] - 4, h["at_mm"][1] - 4, 0), (h["at_mm"][0] + 4, h["at_mm"][1] + 4, 3.5))
        for h in holes
        if h["kind"] == "through"
    ]
    values = {name: getattr(base, name) for name in Lidar.model_fields} | {
        "name": "RANDOM",
        "body_mm": (2 * half[0], 2 * half[1], tall),
        "window_z_mm": (window, min(tall, window + float(random.uniform(8.0, 25.0)))),
        "window_radius_mm": float(random.uniform(0.6, 0.95) * min(half)),
        "optical_height_mm": window + 4.0,
        "mass_g": float(random.uniform(40.0, 600.0)),
        "holes": holes,
        "ears_mm": ears or None,
        "cable_z_mm": float(random.uniform(0.1, 0.4) * tall),
        "cable_diameter_mm": float(random.uniform(3.0, 7.0)),
    }
    return Lidar.model_validate(values)


def random_scanner(random: np.random.Generator) -> Scanner:
    """Return a scanner of a random lidar on products of the catalogue."""
    servo, ring = SETS[int(random.integers(len(SETS)))]
    angles = Angles(
        alpha_rot=0.0 if random.random() < 0.5 else float(random.uniform(-90, 90)),
        beta_rot=0.0,
        alpha_laser=float(random.uniform(-90, 90)),
        beta_laser=float(random.uniform(-90, 90)),
    )
    chosen = AngleSet(task="random", angles_deg=angles, sensor="UST-10LX", servo=servo, slip_ring=ring)
    return replace(scanner_of(chosen, "fdm-0.4", load_catalogue()), lidar=random_lidar(random))


def screws_without_a_bore(scanner: Scanner, layout: Layout) -> Iterator[str]:
    """Make the parts, and yield a line for each screw of the lidar that no hole of a mesh passes."""
    assembly = make_parts(scanner)
    for joint in layout.joints:
        if joint.onto != LIDAR_BODY:
            continue
        mesh = assembly.mesh(joint.part)
        R = layout.stack.R()  # the lidar's axes are those that walls are looked for along
        walls = [wall for wall in walls_of(mesh.vertices[mesh.faces] @ R) if wall.hole]
        for axis in joint.axes:
            at, along = np.asarray(axis.start) @ R, np.asarray(axis.along) @ R
            in_line = [wall for wall in walls if abs(np.asarray(wall.axis) @ along) > 0.99]
            near = [w for w in in_line if np.linalg.norm(np.cross(np.asarray(w.middle) - at, along)) < OFF_MM]
            if not any(2 * wall.radius >= joint.screw.nominal for wall in near):
                yield f"{joint.part}: no hole passes {joint.screw.name} at {at.round(2).tolist()}"


def main() -> None:
    """Lay all of them out, build some, and print counts and reasons."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--built", type=int, default=4)
    options = parser.parse_args()
    random, counts, reasons, faults = np.random.default_rng(37), Counter[str](), Counter[str](), []
    for i in range(options.count):
        scanner = random_scanner(random)
        try:
            layout = laid_out(scanner)
            missed = list(screws_without_a_hole(layout))
            if counts["accepted"] < options.built:
                missed += screws_without_a_bore(scanner, layout)
                counts["built"] += 1
            counts["accepted"] += 1
            faults += [f"{i}: {line}" for line in missed]
        except BuildError as error:
            counts["rejected"] += 1
            reasons[re.sub(r"-?\d+(\.\d+)?", "#", str(error).splitlines()[0])[:110]] += 1
        except Exception as error:  # what must not happen, with its place
            faults.append(f"{i}: crash: {type(error).__name__}: {error}")
    print(", ".join(f"{count} {what}" for what, count in counts.items()))
    for reason, count in reasons.most_common():
        print(f"  rejected {count}: {reason}")
    print("\n".join(faults) or "no screw misses a hole, nothing crashes")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
