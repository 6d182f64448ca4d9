"""The holes of the robot's deck: what a task may ask for, and what the mount then has."""

from dataclasses import replace

import numpy as np
import pytest
from quick_tests import samples

from scanwright.cad.checks.access import driver_rays
from scanwright.cad.geometry.mesh import checked_mesh
from scanwright.cad.layout.deck import deck_of
from scanwright.cad.layout.direct.frame import ServoFrame
from scanwright.cad.layout.placement import drive_of, placement_of
from scanwright.cad.parts.all_parts import parts_of
from scanwright.cad.parts.mounts.base_mount import base_mount
from scanwright.cad.screws import KEYS_MM
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.deck_holes import Circle, Rectangle
from scanwright.design.errors import BuildError
from scanwright.design.scanner import scanner_of
from scanwright.design.task.task import load_task

SCREW_HOLE = {"M3": 3.4, "M4": 4.4, "M5": 5.4, "M6": 6.4}  # with the 0.4 mm of fdm-0.4
TASK = """name = "holes"
sensor = "UTM-30LX"
servo = "MX-64R"
slip_ring = "SNU11-P0210"
[motion]
period_s = 18.0
"""


def scanner_for(alpha_rot, beta_rot, deck, servo="MX-64R", ring="SNU11-P0210"):
    angles = AngleSet(
        task="holes",
        angles_deg=Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=20, beta_laser=-40),
        sensor="UTM-30LX",
        servo=servo,
        slip_ring=ring,
    )
    return scanner_of(angles, "fdm-0.4", load_catalogue(), deck)


DECKS = (
    (Rectangle(shape="rectangle", size_mm=(150, 70), screw="M5"), 4),
    (Circle(shape="circle", diameter_mm=110, count=6, first_deg=0, screw="M6"), 6),
    (Circle(shape="circle", diameter_mm=100, count=3, first_deg=90, screw="M3"), 3),
)
AXES = ((0, 90), (0, 0), (180, 0), (66, -52))
MOUNTS = [(*deck, *axis) for axis in AXES for deck in DECKS]
DAILY = [MOUNTS[k] for k in (0, 4, 11)]  # a lying, an upright and a tilted axis, and every deck, once


@pytest.mark.parametrize(("deck", "count", "alpha_rot", "beta_rot"), samples(MOUNTS, DAILY))
def test_the_mount_has_the_holes_of_the_deck_around_the_world_origin(deck, count, alpha_rot, beta_rot):
    scanner = scanner_for(alpha_rot, beta_rot, deck)
    stack = drive_of(scanner).stack
    place = placement_of(scanner)
    mesh = checked_mesh(base_mount(place), "base_mount")
    turn = scanner.angles.T_world_rot(0.0)[:3, :3]
    world = mesh.vertices @ turn.T + np.array(place.deck.t_world_rot)
    assert np.abs(world[:, 2]).min() < 1e-6
    face = world[np.abs(world[:, 2]) < 1e-3, :2]
    radius = SCREW_HOLE[deck.screw] / 2
    holes = np.array(deck.holes())
    assert len(holes) == count
    for hole in holes:
        reach = np.linalg.norm(face - hole, axis=1)
        rim = face[reach < radius + 0.5]
        assert len(rim) > 20
        np.testing.assert_allclose(np.linalg.norm(rim - hole, axis=1), radius, atol=0.01)
        assert reach[reach > radius + 0.5].min() > 2 * radius  # material around it
    assert stack == drive_of(scanner_for(alpha_rot, beta_rot, None)).stack  # nothing above the mount changes


@pytest.mark.parametrize("servo", ["XM430-W350", "XM540-W270", "MX-64R"])
def test_the_key_of_every_deck_screw_passes_what_is_on_the_mount(servo):
    """Random tilted axes, with and without a belt: the boxes of case and frame, the tower's tube and foot, in plain."""
    draw = np.random.default_rng(7)
    tilts = [(-72.74, 46.72), *draw.uniform((-180, -80), (180, 80), (19, 2))]  # at the first the boss was in the way
    for i, tilt in enumerate(tilts):
        ring = None if i == 0 or draw.random() < 0.5 else "SRC022A-6"
        scanner = scanner_for(*tilt, None, servo=servo, ring=ring)
        place = placement_of(scanner)
        stack, drive = place.stack, place.drive
        joint = next(joint for part in parts_of(place) for joint in getattr(part, "joints", ()) if joint.onto == "deck")
        starts, back = driver_rays(joint)
        x, y, z = (starts + np.linspace(0, KEYS_MM["M4"][1], 200)[:, None, None, None] * back).T
        if ring is None:
            low, high = scanner.servo.case_min_mm, scanner.servo.case_max_mm
            boxes = [((low[0], high[0]), (low[1], high[1]), (stack.horn + low[2], stack.horn + high[2]))]
            if (frame := drive.of(ServoFrame)) is not None:
                side = frame.half_x + frame.leg
                boxes.append(((-side, side), frame.ends_y, (frame.low, frame.high)))
                boxes.append(((-frame.reach_x, frame.reach_x), frame.ends_y, (frame.low, frame.low + 6)))
            for (x0, x1), (y0, y1), (z0, z1) in boxes:
                assert not ((x0 < x) & (x < x1) & (y0 < y) & (y < y1) & (z0 < z) & (z < z1)).any()
            boss = 2 * np.hypot(x, y) < scanner.servo.horn_boss_diameter_mm
            assert not (boss & (stack.horn < z) & (z < stack.horn + scanner.servo.horn_boss_height_mm)).any()
        else:
            tube = (np.hypot(x, y) < stack.tower_radius) & (stack.tower_bottom < z) & (z < stack.tower_top)
            chamber = (np.hypot(x, y) < stack.wide_radius) & (stack.tower_bottom < z) & (z < stack.lower_bottom)
            foot = (np.maximum(abs(x), abs(y)) < 32) & (abs(x) + abs(y) < 56) & (abs(z - stack.tower_bottom - 5) < 5)
            assert not (tube | chamber | foot).any()


def test_a_hole_under_the_strut_is_refused_with_the_bound():
    scanner = scanner_for(0, 90, Rectangle(shape="rectangle", size_mm=(50, 50), screw="M4"))
    with pytest.raises(BuildError, match=r"deck.shape = 'rectangle': the hole at \(25, 25\) mm .* needs 30.9 mm"):
        deck_of(scanner, drive_of(scanner))


def test_an_upright_axis_needs_a_mount_only_where_the_deck_has_holes():
    bare, drilled = scanner_for(0, 0, None), scanner_for(0, 0, Circle(shape="circle", diameter_mm=100))
    assert deck_of(bare, drive_of(bare)).flat and not deck_of(drilled, drive_of(drilled)).flat
    usual = scanner_for(0, 40, None)
    named = replace(usual, deck=Rectangle(shape="rectangle"))
    assert deck_of(usual, drive_of(usual)) == deck_of(named, drive_of(named))


@pytest.mark.parametrize(
    ("deck", "said"),
    [
        ('shape = "circle"', "deck.diameter_mm: this key is required"),
        ('shape = "circle"\ndiameter_mm = -3', "deck.diameter_mm = -3: "),
        ('shape = "square"', "deck.shape = 'square': not one of 'rectangle', 'circle'"),
        ('shape = "rectangle"\nscrew = "M8"', "deck.screw = 'M8'"),
        ('shape = "rectangle"\nsize = [3, 4]', "deck.size: unknown key; did you mean 'size_mm'?"),
    ],
)
def test_a_deck_that_makes_no_sense_is_one_line(tmp_path, command, deck, said):
    path = tmp_path / "holes.toml"
    path.write_text(TASK + "[deck]\n" + deck + "\n")
    code, _, complaint = command("optimise", path)
    assert code == 2 and len(complaint) == 1 and said in complaint[0], complaint
    path.write_text(TASK)
    assert load_task(path).task.deck is None
