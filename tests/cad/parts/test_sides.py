"""Lidars without holes in their base: held by walls of the sub-plate at two opposite sides, or at the rear."""

from dataclasses import replace

import cadquery as cq
import numpy as np
import pytest

from benchmarks.cad.combinations import screws_without_a_hole
from scanwright.cad.assembly.bought import lidar_body, lidar_cable
from scanwright.cad.layout.envelope import side_walls
from scanwright.cad.layout.joints import screw_patterns
from scanwright.cad.layout.placement import placement_of
from scanwright.cad.parts.all_parts import laid_out
from scanwright.cad.parts.linkage.sub_plate import sub_plate
from scanwright.cad.screws import SCREWS
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.holes import Hole
from scanwright.design.errors import BuildError
from scanwright.design.scanner import scanner_of

NAMES = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")
LIGHT_G = 300.0  # whatever its attitude, the hub's screws hold its angle
OUTWARDS = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0)}


def scanner_for(angles=(0, 31, 6, 15), lidar="LMS111", ring="SRC022A-6"):
    found = AngleSet(
        task="sides",
        angles_deg=Angles(**dict(zip(NAMES, map(float, angles), strict=True))),
        sensor=lidar,
        servo="MX-106",
        slip_ring=ring,
    )
    return scanner_of(found, "fdm-0.4", load_catalogue())


def with_holes(scanner, sides, size="M4", kind="tapped", z=60.0, off=0.0):
    """Return the scanner, its lidar with holes at places along each side; `off` is how far they are inside."""
    half = np.array([52.5, 51.0])
    holes = []
    for face, places in sides.items():
        across = "xy".index(face[1])
        for place in places:
            at = [place, z]
            at.insert(across, OUTWARDS[face][across] * (half[across] - off))
            holes.append(Hole(at_mm=tuple(at), axis=face, kind=kind, size=size, depth_mm=9.0))
    return replace(scanner, lidar=scanner.lidar.model_copy(update={"holes": tuple(holes), "mass_g": LIGHT_G}))


def held_at(layout):
    """Return the screws into the lidar in its frame, rounded: where each meets a side, and the side."""
    (joint,) = (joint for joint in layout.joints if joint.onto == "lidar_body")
    R, height = layout.stack.R(), layout.scanner.lidar.optical_height_mm
    faces = {tuple(-x for x in out): face for face, out in OUTWARDS.items()}
    found = set()
    for axis in joint.axes:
        along = R.T @ axis.along
        mouth = R.T @ axis.start + joint.grip_mm * along + [0, 0, height]
        found.add((*np.round(mouth, 3).tolist(), faces[tuple(np.round(along).astype(int).tolist())]))
    return joint, found


@pytest.mark.parametrize("seed", range(4))
def test_random_sets_in_the_sides_hold_a_lidar_at_any_attitude_by_all_their_holes(seed):
    random = np.random.default_rng(seed)
    faces = (("+y", "-y"), ("-x",), ("+x", "-x"), ("-x",))[seed]
    around = {face: random.permutation([-38.0, -12.0, 12.0, 38.0])[: random.integers(1, 4)] for face in faces}
    if faces == ("-x",):
        around["-x"] = [-38.0, 0.0] if seed == 1 else [-40.0, -10.0, -25.0]  # the cable is at 26.6
    elif "-x" in faces:
        around["-x"] = [-30.0]
    else:
        around["+x"] = [20.0]  # a third side alone is no use
    angles = random.uniform([0, 0, -60, -40], [20, 60, 60, 40])
    size, z = str(random.choice(["M3", "M4", "M6"])), float(random.uniform(20, 85))
    layout = laid_out(with_holes(scanner_for(angles, ring=None), around, size, z=z))
    joint, found = held_at(layout)
    assert {face for *_, face in found} == set(faces) and joint.count == sum(len(around[face]) for face in faces)
    holes = {(*hole.at_mm, hole.axis) for hole in layout.scanner.lidar.holes if hole.axis in faces}
    assert {(round(x, 3), round(y, 3), round(z, 3), face) for x, y, z, face in holes} == found
    assert list(screws_without_a_hole(layout)) == []
    window = layout.scanner.lidar.window_z_mm[0] - layout.scanner.lidar.optical_height_mm
    assert all(wall.box[1][2] < window for wall in side_walls(layout.scanner.lidar))
    turned = replace(layout, scanner=with_holes(layout.scanner, {"+y": [0.0, 20.0], "-x": [0.0]}, size, z=z))
    assert len(list(screws_without_a_hole(turned))) >= 1


@pytest.mark.parametrize(
    ("sides", "changed", "why"),
    [
        ({"+y": [-20.0, 20.0]}, {}, r"no equal threads in two opposite sides or its rear \(2 x M4 tapped in \+y\)"),
        ({"-x": [0.0]}, {}, "no equal threads"),
        ({"-x": [-20.0, 20.0]}, {"kind": "through"}, "no equal threads"),
        ({"-x": [-20.0, 20.0]}, {"off": 5.0}, "no equal threads"),
        ({"+y": [0.0], "-y": [0.0]}, {"z": 97.0}, r"a head of 7.8 mm needs a wall up to 2 mm below the window at 100"),
        ({"-x": [-20.0, 20.0]}, {}, r"in -x: a head is within 11.9 mm of the cables"),
    ],
)
def test_sides_that_cannot_hold_a_lidar_are_refused_with_the_reason(sides, changed, why):
    with pytest.raises(BuildError, match=why):
        placement_of(with_holes(scanner_for(ring=None), sides, **changed))


def test_the_rear_of_an_lms111_holds_it_too_and_its_sides_come_first():
    """Two holes that tip over the edge of the wall above them; the paper template has a page for each kind of side."""
    layout = laid_out(scanner_for())
    joint, found = held_at(layout)
    assert (joint.screw.name, joint.count, joint.length_mm) == ("M6", 4, 16) and joint.heel_mm is None
    assert {face for *_, face in found} == {"+y", "-y"}
    pages = [page for page in screw_patterns(layout.joints, layout.stack.R()) if page.device == "lidar_body"]
    assert [np.ptp(np.array(page.places), axis=0).tolist() for page in pages] == [[49.0, 0.0]]  # both look alike
    rear = with_holes(scanner_for(), {"-x": [-38.0, 0.0]}, z=60.0)
    joint, _ = held_at(laid_out(rear))
    assert joint.heel_mm == pytest.approx(SCREWS["M4"].driver_radius + 3.0)  # less than over the floor


@pytest.mark.parametrize("rear", [False, True])
def test_the_walls_leave_the_lidar_its_cables_and_drivers_free_and_take_the_screws(rear):
    """Measured on the solid, in the frame of the lidar."""
    scanner = scanner_for((0, 0, 0, 0), ring=None)
    if rear:
        scanner = with_holes(scanner, {"-x": [-38.0, 5.0]}, "M5", z=60.0)
    place = placement_of(scanner)
    lidar, seat = scanner.lidar, scanner.lidar.optical_height_mm
    part = sub_plate(scanner, place.stack, place.stack.sub_plate).moved(cq.Location(cq.Vector(0, 0, seat)))
    assert part.isValid() and len(part.Solids()) == 1
    bought = [lidar_body(lidar), *(lidar_cable(lidar, y) for y in lidar.cable_y_mm)]
    assert sum(part.intersect(body).Volume() for body in bought) < 1e-6
    assert part.BoundingBox().zmax < lidar.window_z_mm[0]
    for face, pattern in lidar.held.items():
        out = np.array(OUTWARDS[face], dtype=float)
        screw = SCREWS[pattern.screw]
        for hole in (hole for hole in lidar.holes if hole.axis == face):
            path = cq.Solid.makeCylinder(screw.nominal / 2, 90.0, cq.Vector(*hole.at_mm), cq.Vector(*out))
            assert part.intersect(path).Volume() < 1e-6
            head = hole.at_mm + out * (place.linkage.walls[0].grip_mm + 0.01)
            over = cq.Solid.makeCylinder(screw.driver_radius, 90.0, cq.Vector(*head), cq.Vector(*out))
            assert part.intersect(over).Volume() < 1e-6
            under = cq.Solid.makeCylinder(screw.head_diameter / 2, 2.0, cq.Vector(*head), cq.Vector(*-out))
            ring = np.pi / 4 * (screw.head_diameter**2 - (screw.nominal + scanner.printer.screw_clearance_mm) ** 2)
            assert part.intersect(under).Volume() == pytest.approx(1.99 * ring, rel=1e-3)
