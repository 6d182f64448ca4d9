"""A task file from a few answers in metres: lidar, servo, position, region to see, time of a scan."""

from __future__ import annotations

import json
import math
import os
import tomllib
from dataclasses import dataclass
from pathlib import Path

from scanwright.cad.layout.placement import placement_of
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import Catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.electrics.cautions import data_fault
from scanwright.design.errors import BuildError, TaskError
from scanwright.design.frames import STANDARD_GRAVITY_M_S2
from scanwright.design.scanner import scanner_of
from scanwright.design.task.shapes import LEAST_M, MOST_M, MeshRegion
from scanwright.design.task.task import LoadedTask, load_task
from scanwright.pipeline.deck_height import deck_height
from scanwright.pipeline.robot_around import robot_around
from scanwright.pipeline.seen_regions import density_lines, known_regions, parse_region, region_lines, require_positive

LINE_GAP_DEG = 1.0  # between neighbouring lines of a usual scan: two to four lines in every ball of 2 deg
UPRIGHT = Angles(alpha_rot=0, beta_rot=0, alpha_laser=0, beta_laser=0)

ANGLES = r"""
# The four angles of the mount, in degrees. L is the lidar, --- the plane of its beams with > at its front, S the servo:
# it turns all that stands on its axis.
#
#     all are 0          beta_rot = 45         beta_laser = 45      alpha_rot = 45        alpha_laser = 45
#     from the right     the axis leans        the lidar's front    from behind: the      from behind: the
#     ahead is -->       ahead                 dips                 axis leans right      lidar's left goes up
#
#          | axis            \   / axis            \ | axis               \   / axis             \ | axis
#          |                  \ /                   \|                     \ /                    \|
#     -----L----->             L                     L                      L                      L
#          |                  / \                    |\                    / \                     |\
#          |                 /   \                   | \                  /   \                    | \
#          S                S     >                  S  >                S                         S
#
# A pair [from, to] is searched, one value fixes the angle.
"""

DECK = (
    "",
    "# [deck]  # holes of your robot for the mount, about the origin of the world; without it these",
    '# shape = "rectangle"',
    "# size_mm = [80, 80]  # between their centres, along x and y",
    '# screw = "M4"',
)


@dataclass(frozen=True, slots=True)
class Answers:
    """The answers of `scanwright new`."""

    name: str  # of the task and its build folder
    lidar: str  # by its name in the catalogue
    servo: str  # the same
    height_m: float  # of the scanner's optical centre over the ground
    see: tuple[str, ...]  # regions to see, in the form of `scanwright.pipeline.seen_regions.SEEN`
    scan_s: float  # time of one full scan
    # parts of the robot that block the view: "none", "box:LENGTH:WIDTH:HEIGHT" or the file of a mesh
    robot: str = "none"
    ahead_m: float = 0.0  # position of the scanner ahead of the middle of the box, or of the origin of the mesh


def task_text(answers: Answers, products: Catalogue, command: str, path: Path) -> str:
    """Return the commented task file for `path`; `command` writes the same file again.

    Raises:
        TaskError: an answer is invalid, or lidar and servo cannot work together.
    """
    lidar, servo = products.get(answers.lidar, Lidar), products.get(answers.servo, Servo)
    _require_strength(lidar, servo)
    if not LEAST_M <= answers.height_m <= MOST_M:
        raise TaskError(f"height_m = {answers.height_m:g}: must be between {LEAST_M:g} and {MOST_M:g} m")
    if answers.height_m > lidar.practical_range_m:
        raise TaskError(
            f"height_m = {answers.height_m:g}: {lidar.name} sees {lidar.practical_range_m:g} m and would not reach the "
            f"ground; use metres ({answers.height_m:g} cm is "
            f"{answers.height_m / 100:g}, {answers.height_m:g} mm is {answers.height_m / 1000:g})"
        )
    # where regions overlap the last one decides: those all around come first
    seen = sorted(
        (parse_region(each) for each in answers.see), key=lambda each: {"all": 0, "around": 1}.get(each[0], 2)
    )
    if not seen:
        raise TaskError(f"see: no region; {known_regions()}")
    things = [numbers for word, numbers in seen if word == "thing"]
    regions = [(word, numbers) for word, numbers in seen if word != "thing"] or [("all", ())]
    blocks = [
        f"# {answers.name}: {lidar.name} turned by {servo.name}, {answers.height_m:g} m over the ground.",
        "# World: x ahead, y to the left, z up. Every key: `scanwright schema`, or the pages of documentation.",
        f"# Made by: {command}",
        f"# Next:    scanwright build {path}",
        "",
        f'name = "{answers.name}"',
        f'sensor = "{lidar.name}"',
        f'servo = "{servo.name}"',
        *_motion(answers, lidar, servo, slip_ring_for(lidar, servo, products)),
        ANGLES,
        "[angles]",
        _alpha_rot(answers, path.parent),
        "beta_rot_deg = [-90, 90]",
        "alpha_laser_deg = [-90, 90]",
        "beta_laser_deg = [-90, 90]",
        "",
        *density_lines(things, regions, answers.height_m),
        *(line for word, numbers in regions for line in region_lines(word, numbers, answers.height_m)),
        *_mask(answers, path.parent),
        *DECK,
    ]
    return "\n".join(blocks) + "\n"


def _alpha_rot(answers: Answers, folder: Path) -> str:
    """Return the range of alpha_rot: a scanner can hang only below a part of the robot."""
    hangs = answers.robot == "none"
    if not hangs and answers.robot.split(":")[0] != "box":
        (table,) = tomllib.loads("\n".join(_mask(answers, folder)))["mask"]
        hangs = math.isfinite(robot_around([MeshRegion(**table)], folder)[1])
    if hangs:
        return "alpha_rot_deg = [-180, 180]"
    return "alpha_rot_deg = [-90, 90]  # the axis points up: the robot has nothing above the scanner to hang it from"


def usual_scan_s(lidar: Lidar) -> float:
    """Return a time of a full scan, a multiple of 5 s, with lines at most `LINE_GAP_DEG` apart."""
    return 5.0 * math.ceil(360 / (lidar.scan_rate_hz * LINE_GAP_DEG) / 5)


def _require_strength(lidar: Lidar, servo: Servo) -> None:
    """Reject a lidar whose weight, off a horizontal axis, needs more than the continuous torque of the servo."""
    needed = torque_nm(lidar, None)
    if needed > servo.continuous_torque_nm:
        raise TaskError(
            f"{lidar.name} on {servo.name}: these cannot work together: {lidar.mass_g:g} g, {1000 * _off_m(lidar):.0f} "
            f"mm off a level axis, need {needed:.2g} N m, and the servo gives {servo.continuous_torque_nm:.2g} N m all "
            "day"
        )


def torque_nm(lidar: Lidar, ring: SlipRing | None) -> float:
    """Return the torque for a lidar's weight, off a horizontal axis, and for the drag of a ring."""
    drag_nm = 0.0 if ring is None or ring.friction_nm is None else ring.friction_nm[1]
    return lidar.mass_g / 1000 * STANDARD_GRAVITY_M_S2 * _off_m(lidar) + drag_nm


def _off_m(lidar: Lidar) -> float:
    """Return the distance between the middle of a lidar and its optical centre."""
    return abs(lidar.optical_height_mm - lidar.body_mm[2] / 2) / 1000


def slip_ring_for(lidar: Lidar, servo: Servo, products: Catalogue) -> SlipRing | None:
    """Return the slip ring for continuous rotation; None for a servo that must sweep.

    Rings that are rated for the lidar's data are preferred, then those with a bore, which need no belt, then those with
    a known speed. A servo sweeps if it does not read its angle all around, or no ring has a layout with it. One whose
    case has no holes for the parts of a ring sweeps too, with fewer parts, if it can.

    Raises:
        TaskError: lidar and servo have no layout.
    """

    def order(ring: SlipRing) -> tuple[bool, bool, bool, str]:
        return bool(data_fault(ring, lidar)), ring.bore_mm == 0, ring.max_rpm is None, ring.name

    rings = sorted((product for product in products if isinstance(product, SlipRing)), key=order)
    strong = [ring for ring in rings if torque_nm(lidar, ring) <= servo.continuous_torque_nm]
    why, found = "", list[SlipRing]()
    for ring in (*(strong if servo.position_feedback_deg == 360 else ()), None):
        name = None if ring is None else ring.name
        angles = AngleSet(task="new", angles_deg=UPRIGHT, sensor=lidar.name, servo=servo.name, slip_ring=name)
        try:
            drive = placement_of(scanner_of(angles, "fdm-0.4", products)).drive
        except BuildError as error:
            why = str(error)
            continue
        if ring is None or drive.plain:
            return ring
        found.append(ring)
    if found:
        return found[0]
    raise TaskError(f"{lidar.name} on {servo.name}: these cannot work together: {why}")


def _motion(answers: Answers, lidar: Lidar, servo: Servo, ring: SlipRing | None) -> list[str]:
    gap_deg = 360 / (lidar.scan_rate_hz * answers.scan_s)  # in a turn, or in 180 deg out and back
    lines = f"its lines are {gap_deg:.2g} deg apart; longer is denser"
    if ring is not None:
        how = "the shaft goes through it" if ring.bore_mm > 0 else "a belt turns the shaft next to it"
        return [
            f'slip_ring = "{ring.name}"  # lets the cable turn on and on; {how}',
            "",
            "[motion]",
            'mode = "spin"',
            f"period_s = {answers.scan_s:g}    # one full turn is one full scan: {lines}",
        ]
    why = f"{servo.name} does not read its angle all around"
    if servo.position_feedback_deg == 360:
        why = f"a slip ring does not fit {servo.name}, or needs a printed frame around it"
    return [
        "",
        f"[motion]  # {why}: it sweeps back and forth, and its cable hangs in a loop",
        'mode = "sweep"',
        "limits_deg = [-90, 90]",
        f"period_s = {answers.scan_s:g}    # out and back is one full scan: {lines}",
        "# a wider range, such as [-160, 160], lets a tilted lidar see all around, with lines farther apart",
    ]


def _mask(answers: Answers, folder: Path) -> list[str]:
    ahead = answers.ahead_m
    if answers.robot == "none":
        return [
            "# [[mask]]  # directions that the robot hides do not count: its mesh, and the scanner's position in it",
            '# shape = "mesh"',
            '# file = "robot.stl"',
            "# unit_m = 0.001",
            f"# sensor_m = [0, 0, {answers.height_m:g}]",
        ]
    if answers.robot.split(":")[0] != "box":
        return [
            "[[mask]]  # directions that the robot hides do not count",
            'shape = "mesh"',
            f"file = {json.dumps(os.path.relpath(answers.robot, folder))}",
            "unit_m = 1            # of the file: 0.001 if it is in mm",
            f"sensor_m = [{ahead:g}, 0, {answers.height_m:g}]  # the scanner in the mesh",
        ]
    how = "box:LENGTH:WIDTH:HEIGHT in metres, or the file of a mesh"
    try:
        length, width, height = sizes = [float(each) for each in answers.robot.split(":")[1:]]
    except ValueError as error:
        raise TaskError(f"robot = '{answers.robot}': must be {how}") from error
    require_positive("robot", answers.robot, how, sizes)
    over = answers.height_m - height
    if not (over > 0 and abs(ahead) <= length / 2):
        raise TaskError(
            f"robot = '{answers.robot}': the scanner ({answers.height_m:g} m high, {ahead:g} m ahead of the "
            f"middle) is not above it: needs height_m above {height:g}, ahead_m from {-length / 2:g} to {length / 2:g} "
            "(metres)"
        )
    return [
        f"[[mask]]  # the robot's own top, {over:g} m below the scanner: directions that it hides do not count",
        'shape = "ground"',
        f"height_m = {over:g}",
        f"from_m = {-length / 2 - ahead:g}",
        f"to_m = {length / 2 - ahead:g}",
        f"width_m = {width:g}",
    ]


def _too_low(loaded: LoadedTask) -> list[str]:
    """Return a warning if the scanner of a task is lower over its robot than it can be built with its axis upright."""
    task = loaded.task
    angles = AngleSet(
        task=task.name, angles_deg=UPRIGHT, sensor=task.sensor, servo=task.servo, slip_ring=task.slip_ring
    )
    deck = placement_of(loaded.scanner(angles)).deck
    height = deck_height(loaded, angles.model_copy(update={"t_world_rot_mm": deck.t_world_rot}))
    if height.severity != "warning" or height.limit is None or height.value is None or height.limit > height.value:
        return []
    return [
        f"the scanner is {height.limit:.0f} mm above the robot, but its parts need {height.value:.0f} mm with "
        f"an upright axis, and more if tilted: use a height_m that is {(height.value - height.limit) / 1000:.2g} m "
        "larger, or more"
    ]


def check_answers(answers: Answers, products: Catalogue) -> None:
    """Reject answers that make no valid task, before a file is written; mesh paths are relative to the working folder.

    Raises:
        TaskError: as `task_text` and `design.task.task.load_task`.
    """
    load_task(tomllib.loads(task_text(answers, products, "", Path(f"{answers.name}.toml"))))


def write_task_file(path: Path, text: str) -> list[str]:
    """Write a new task file, and return its warnings.

    Raises:
        TaskError: the file exists or cannot be written, or an answer makes no task; then there is no file.
    """
    loaded = load_task(tomllib.loads(text), path.parent)
    warnings = [*loaded.warnings(), *_too_low(loaded)]
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise TaskError(f"{path}: exists; choose another name") from error
    except OSError as error:
        raise TaskError(f"{path}: cannot be written: {error.strerror}") from error
    return warnings
