"""The two pulleys of the belt layout: one on the shaft, one on the servo's horn, with the same teeth.

Frame: rotation frame at gamma = 0 (`cad/layout/belt/stack.py`), mm. Teeth between two rims; a groove is a half circle
with flanks that widen to the tips, the belt's own round tooth with the play of a print. Both run with a light press,
half of the sliding fit: what they stand off their axes turns the angle once per turn (`belt_angle` in `checks.json`).

    shaft_pulley  lies on the shaft's collar, held by two grub screws in its boss; the belt is set by turning it
    drive_pulley  on the horn, centred by the horn's boss, its screws sunk from above; shortens the lever of the belt
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import cadquery as cq
import numpy as np

from cad import solids
from cad.layout.belt.loads import PRELOAD_N, press_newton
from cad.layout.belt.plate import pulley_foot_radius
from cad.layout.belt.stack import BOSS, GRUB, GRUBS_DEG, RIM, TRAVEL, BeltStack
from cad.layout.fits import OnSheet, no_wider
from cad.layout.joints import horn_centres, screws
from cad.layout.names import BEARING_TOWER, DRIVE_PLATE, DRIVE_PULLEY, MAIN_SHAFT, SERVO_OUTPUT, SHAFT_PULLEY
from cad.parts.part_spec import HORN, PartSpec, Step
from cad.screws import SCREWS, Screw, Thread, passing_hole, thread_in_part
from cad.solids import building, checked
from design.catalogue.products import Servo
from design.errors import BuildError
from design.scanner import Scanner

CHORDS = 4  # of a groove's half circle: within 0.05 mm, which a printer cannot tell
MOUTH = 0.25  # by which a groove is wider at the tips than below, on each side
GIVE_MM = 2.0  # of a strand, when the pre-load is felt
OFF_AXIS = "more play puts the pulley further off its axis than belt_angle of checks.json counts with"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulley:
    """Lengths in mm."""

    stack: BeltStack
    fit: float  # diametral clearance of a sliding fit
    thread: Thread  # of the grub screws
    screw: Screw  # of the horn
    hole: float  # diameter
    servo: Servo
    foot_radius: float  # of what lies on the horn
    boss_radius: float  # of the horn's
    boss_height: float


def shaft_pulley_spec(scanner: Scanner, stack: BeltStack) -> PartSpec:
    """The pulley on the shaft of one scanner."""
    words = (
        "Push the pulley over the spigot down to the collar of the shaft, its boss upwards, and lay the belt "
        f"around it: {stack.belt.name} of {stack.belt_teeth} teeth ({stack.belt_teeth * stack.belt.pitch_mm:g} mm). "
        f"{screws(MAIN_SHAFT)} Leave these two loose."
    )
    fit = no_wider(stack.tube_diameter, scanner.printer.fit_clearance_mm, OFF_AXIS)
    return PartSpec(
        name=SHAFT_PULLEY,
        turns=True,
        make=partial(shaft_pulley, pulley_of(scanner, stack)),
        step=Step("Pulley and belt on the shaft", words),
        sheet=OnSheet((fit,), (_teeth_words(stack),)),
        shapes={"belt.thickness_mm": "the rims of the pulleys", "belt.groove_radius_mm": "the teeth of the pulleys"},
    )


def drive_pulley_spec(scanner: Scanner, stack: BeltStack) -> PartSpec:
    """The pulley on the horn of one scanner."""
    push = press_newton(stack, PRELOAD_N, GIVE_MM)
    words = (
        f"The boss of the horn centres the pulley. {screws(SERVO_OUTPUT)} Hang the servo between the arms of the "
        "tower, lay the belt around both pulleys, and put in the screws of the slots: "
        f"{screws(BEARING_TOWER, DRIVE_PLATE)} Pull the plate outwards until a push of {push:.1f} N in the middle of a "
        f"strand moves it by {GIVE_MM:g} mm: that is {PRELOAD_N:g} N in each strand. The centres are then "
        f"{stack.centre:g} mm apart; the slots give {TRAVEL:g} mm to either side."
    )
    pocket = stack.servo.horn_boss_diameter_mm
    fits = (no_wider(pocket, scanner.printer.fit_clearance_mm, OFF_AXIS),) if pocket > 0 else ()
    return PartSpec(
        name=DRIVE_PULLEY,
        turns=False,
        make=partial(drive_pulley, pulley_of(scanner, stack)),
        step=Step("Drive pulley, and the servo beside the shaft", words),
        sheet=OnSheet(fits, (_teeth_words(stack),), stack.horn_axis),
        shaped_by=(*HORN, "servo.horn_thickness_mm"),
        sweep=partial(drive_envelope, pulley_of(scanner, stack)),
    )


def pulley_of(scanner: Scanner, stack: BeltStack) -> Pulley:
    """Parameters of both pulleys of one scanner.

    Raises:
        BuildError: the heads of the horn's screws leave no wall below the teeth, or around the horn's boss.
    """
    servo, printer = scanner.servo, scanner.printer
    screw = SCREWS[servo.horn_screw]
    root = stack.tip_radius - stack.belt.tooth_height_mm
    if servo.horn_circle_mm / 2 + screw.head_room + printer.min_wall_mm > root:
        raise BuildError(
            f"{DRIVE_PULLEY}: heads: horn_circle_mm = {servo.horn_circle_mm:g}: the heads of the {screw.name} screws "
            f"of {servo.name} reach into the teeth of a pulley of {stack.teeth}; take a servo with a smaller horn"
        )
    boss = servo.horn_boss_diameter_mm / 2
    if servo.horn_circle_mm / 2 - screw.head_room - printer.min_wall_mm < boss:
        raise BuildError(
            f"{DRIVE_PULLEY}: heads: horn_circle_mm = {servo.horn_circle_mm:g}: the heads of the {screw.name} screws "
            f"of {servo.name} leave no wall around its boss of {2 * boss:g} mm"
        )
    return Pulley(
        stack=stack,
        fit=printer.fit_clearance_mm,
        thread=thread_in_part(GRUB, printer, room_for_nut=False),
        screw=screw,
        hole=passing_hole(screw, printer),
        servo=servo,
        foot_radius=pulley_foot_radius(servo),
        boss_radius=boss,
        boss_height=servo.horn_boss_height_mm,
    )


def shaft_pulley(p: Pulley) -> cq.Solid:
    """Make the pulley on the shaft.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack = p.stack
    with building(SHAFT_PULLEY, "teeth and boss", "teeth", stack.teeth):
        boss = solids.upright(stack.boss_radius, stack.teeth_top - 0.5, stack.pulley_top)
        body = checked(_toothed(stack, None, boss), SHAFT_PULLEY, "teeth and boss", "teeth", stack.teeth)
    with building(SHAFT_PULLEY, "bore and grub screws", "shaft diameter", stack.tube_diameter):
        bore = solids.upright(stack.tube_diameter / 2 + p.fit / 4, stack.teeth_low - 1.0, stack.pulley_top + 1.0)
        middle = np.array([0.0, 0.0, stack.pulley_top - BOSS / 2])
        grubs = []
        for azimuth in np.radians(GRUBS_DEG):
            out = (math.cos(azimuth), math.sin(azimuth), 0.0)
            grubs.append(solids.cylinder(p.thread.hole / 2, middle, out, 80.0))
        cut = body.cut(bore, *grubs).clean()
        return checked(cut, SHAFT_PULLEY, "bore and grub screws", "shaft diameter", stack.tube_diameter)


def drive_pulley(p: Pulley) -> cq.Solid:
    """Make the pulley on the horn.

    Raises:
        BuildError: a step did not give one valid solid.
    """
    stack, horn = p.stack, p.stack.horn
    with building(DRIVE_PULLEY, "teeth and foot", "teeth", stack.teeth):
        foot = solids.upright(p.foot_radius, horn, stack.teeth_low + 0.5)
        body = checked(_toothed(stack, foot, None), DRIVE_PULLEY, "teeth and foot", "teeth", stack.teeth)
    with building(DRIVE_PULLEY, "pocket and screws", "horn_circle_mm", p.servo.horn_circle_mm):
        cuts = []
        for x, y in horn_centres(p.servo).tolist():
            cuts.append(solids.upright(p.hole / 2, horn - 1.0, stack.teeth_top + 1.0, x, y))
            cuts.append(solids.upright(p.screw.head_room, stack.pulley_seat, stack.teeth_top + 1.0, x, y))
        if p.boss_radius > 0:
            cuts.append(solids.upright(p.boss_radius + p.fit / 4, horn - 1.0, horn + p.boss_height + 0.5))
        cut = body.cut(*cuts).clean()
        made = checked(cut, DRIVE_PULLEY, "pocket and screws", "horn_circle_mm", p.servo.horn_circle_mm)
    return made.moved(solids.location(stack.turn(), stack.beside() * [1.0, 1.0, 0.0]))


def drive_envelope(p: Pulley) -> cq.Solid:
    """What the pulley on the horn fills while it turns about its own axis."""
    stack = p.stack
    rim, tip = stack.rim_radius, stack.tip_radius
    low, high = stack.teeth_low, stack.teeth_top
    foot = solids.upright(p.foot_radius, stack.horn, low + 0.5)
    with building(DRIVE_PULLEY, "sweep", "teeth", stack.teeth):
        whole = foot.fuse(
            solids.upright(rim, low, low + RIM), solids.upright(tip, low, high), solids.upright(rim, high - RIM, high)
        )
        swept = checked(whole, DRIVE_PULLEY, "sweep", "teeth", stack.teeth)
    return swept.moved(solids.location(stack.turn(), stack.beside() * [1.0, 1.0, 0.0]))


def _teeth_words(stack: BeltStack) -> str:
    """What a pulley's drawing says of its teeth."""
    belt = stack.belt
    return (
        f"{stack.teeth} teeth for {belt.name}, pitch {belt.pitch_mm:g}: pitch diameter {2 * stack.pitch_radius:.2f}, "
        f"over the tips {2 * stack.tip_radius:.2f}, grooves {belt.tooth_height_mm:g} deep with "
        f"a round bottom R{belt.groove_radius_mm:g}."
    )


def _toothed(stack: BeltStack, below: cq.Solid | None, above: cq.Solid | None) -> cq.Shape:
    """Teeth between two rims about the axis, each rim in one with what is on its far side.

    Rims and teeth touch and do not overlap: the kernel then glues them in half the time.
    """
    low, high = stack.teeth_low + RIM, stack.teeth_top - RIM
    teeth = cq.Solid.extrudeLinear(_outline(stack), [], cq.Vector(0, 0, high - low))
    lower: cq.Shape = solids.upright(stack.rim_radius, stack.teeth_low, low)
    upper: cq.Shape = solids.upright(stack.rim_radius, high, stack.teeth_top)
    lower, upper = (rim.fuse(more) if more else rim for rim, more in ((lower, below), (upper, above)))
    return teeth.moved(cq.Location(cq.Vector(0, 0, low))).fuse(lower, upper, glue=True)


def _outline(stack: BeltStack) -> cq.Wire:
    """Of the teeth, in the plane z = 0: per tooth a flank, the groove's half circle in chords, a flank, the tip."""
    groove, tip = stack.belt.groove_radius_mm, stack.tip_radius
    centre = tip - stack.belt.tooth_height_mm + groove
    half = (groove + MOUTH) / tip  # rad, of the mouth
    bow = math.pi * (1 + np.arange(CHORDS + 1) / CHORDS)
    around = np.stack([centre + groove * np.sin(bow), groove * np.cos(bow)], axis=1)  # outwards, sideways
    mouth = tip * np.array([[math.cos(half), math.sin(half)]])
    one = np.concatenate([mouth * [1.0, -1.0], around, mouth])
    turn = math.pi / 2 + 2 * math.pi * np.arange(stack.teeth) / stack.teeth
    out = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    side = np.stack([-np.sin(turn), np.cos(turn)], axis=1)
    points = (one[:, :1] * out[:, None] + one[:, 1:] * side[:, None]).reshape(-1, 2)
    return cq.Wire.makePolygon([cq.Vector(float(x), float(y), 0.0) for x, y in points], close=True)
