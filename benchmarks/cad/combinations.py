"""Which lidar, servo and slip ring of the catalogue go together, and why the others do not.

    python -m benchmarks.cad.combinations [ALPHA_ROT BETA_ROT ALPHA_LASER BETA_LASER]

Every lidar and servo, with every ring and without one, is laid out with all its parts and joints, without the CAD
kernel: what cannot be made is rejected there. Of those that are accepted, each screw into a lidar or a servo's case
must meet a usable hole of its record and end in it; exit code 1 if one does not.
"""

from __future__ import annotations

import itertools
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator

import numpy as np

from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.names import LIDAR_BODY, SERVO_CASE
from scanwright.cad.parts.all_parts import laid_out
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.arrays import Array
from scanwright.design.catalogue.catalogue import Catalogue, load_catalogue
from scanwright.design.catalogue.holes import USABLE, Hole
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import BuildError
from scanwright.design.scanner import scanner_of

TILTED = (0.0, 31.0, 6.0, 15.0)
SAME_MM = 2.1  # slots take a screw this far from its place
EXACT_MM = 0.01  # rounding
FACING = 0.999  # cosine, between a screw and its hole


def main(angles: tuple[float, ...] = TILTED) -> None:
    """Lay out all of them, and print what goes with what, and the screws that meet no hole."""
    catalogue = load_catalogue()
    lidars = [one.name for one in catalogue if isinstance(one, Lidar)]
    servos = [one.name for one in catalogue if isinstance(one, Servo)]
    rings = [None, *(one.name for one in catalogue if isinstance(one, SlipRing))]
    fits: defaultdict[tuple[str, str | None], list[str]] = defaultdict(list)
    refused, misses = Counter[str](), Counter[str]()
    for lidar, servo, ring in itertools.product(lidars, servos, rings):
        try:
            layout = laid_out_at(catalogue, angles, lidar, servo, ring)
            misses.update(screws_without_a_hole(layout))
        except BuildError as error:
            refused[f"{servo} with {ring}: {general(str(error), lidar)}"] += 1
        else:
            fits[servo, ring].append(lidar)
    accepted = sum(map(len, fits.values()))
    print(f"{accepted} of {accepted + refused.total()} laid out, at {angles}; {misses.total()} screws meet no hole")
    for (servo, ring), fit in fits.items():
        named = "every lidar" if len(fit) == len(lidars) else ", ".join(fit)
        print(f"  {servo} with {ring}: {len(fit)}: {named}")
    for reason, count in refused.most_common():
        print(f"  refused {count}: {reason}")
    for miss, count in misses.most_common():
        print(f"  no hole {count}: {miss}")
    sys.exit(bool(misses))


def laid_out_at(catalogue: Catalogue, angles: tuple[float, ...], lidar: str, servo: str, ring: str | None) -> Layout:
    """Lay out one scanner at (alpha_rot, beta_rot, alpha_laser, beta_laser)."""
    names = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")
    chosen = AngleSet(
        task="combinations",
        angles_deg=Angles(**dict(zip(names, angles, strict=True))),
        sensor=lidar,
        servo=servo,
        slip_ring=ring,
    )
    return laid_out(scanner_of(chosen, "fdm-0.4", catalogue))


def screws_without_a_hole(layout: Layout) -> Iterator[str]:
    """Yield a line for each screw into a lidar or a servo's case that no usable hole of its record takes."""
    (R, t), seat = layout.drive.servo_pose, np.array([0.0, 0.0, layout.scanner.lidar.optical_height_mm])
    for joint in layout.joints:
        start, along = (np.array([getattr(axis, name) for axis in joint.axes]) for name in ("start", "along"))
        if joint.onto == LIDAR_BODY:
            lidar = layout.stack.R()
            yield from _misses(joint, start @ lidar + seat, along @ lidar, layout.scanner.lidar.holes)
        elif joint.onto == SERVO_CASE:
            yield from _misses(joint, (start - t) @ R, along @ R, layout.scanner.servo.holes)


def _misses(joint: Joint, start: Array, along: Array, holes: tuple[Hole, ...]) -> Iterator[str]:
    """Yield the screws, in the frame of a device, on whose line there is no hole that faces them."""
    fit = [hole for hole in holes if hole.kind in USABLE and hole.size == joint.screw.name]
    reach_mm = SAME_MM if joint.slot_mm else EXACT_MM
    for at, into in zip(start, along, strict=True):
        near = [hole for hole in fit if into @ _outwards(hole) < -FACING and _aside(hole, at, into) < reach_mm]
        if not near:
            place = ", ".join(f"{value:.1f}" for value in at)
            yield f"{joint.part} on {joint.onto}: no hole for {joint.screw.name} at ({place})"
        elif near[0].kind != "through" and joint.length_mm - joint.grip_mm > near[0].depth_mm:
            yield f"{joint.part} on {joint.onto}: {joint.number} is longer than the thread of {near[0].depth_mm:g} mm"


def _outwards(hole: Hole) -> Array:
    if not isinstance(hole.axis, str):
        return np.array(hole.axis) / np.linalg.norm(hole.axis)
    return (1.0 if hole.axis[0] == "+" else -1.0) * np.eye(3)["xyz".index(hole.axis[1])]


def _aside(hole: Hole, at: Array, into: Array) -> float:
    """Return the distance of a hole's mouth from a screw's line [mm], infinite if it is not in front of the head."""
    way = np.array(hole.at_mm) - at
    return float(np.linalg.norm(way - (way @ into) * into)) if way @ into > 0 else np.inf


def general(reason: str, lidar: str) -> str:
    """Return a reason without the lidar's name and the numbers that go with it, so that like reasons count together."""
    return re.sub(r"-?\d+\.\d+", "#", reason.replace(lidar, "the lidar"))


if __name__ == "__main__":
    main(tuple(map(float, sys.argv[1:5])) or TILTED)
