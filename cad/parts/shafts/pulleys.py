"""The two pulleys of the belt layout: one on the shaft, one on the servo's horn, with the same teeth.

Frame: rotation frame at gamma = 0 (`cad/layout/belt/stack.py`), mm. Teeth between two rims; a groove is a half circle
with flanks that widen to the tips, the belt's round tooth with the clearance of a print. Both have a light press fit,
half of the sliding fit: their offset from the axis changes the angle once per turn (`belt_angle` in `checks.json`).

    shaft_pulley  on the shaft's collar, held by two grub screws in its boss; the belt is set by turning it
    drive_pulley  on the horn, centred by the horn's boss, its screws sunk from above
"""

import math
from dataclasses import replace
from functools import partial

import cadquery as cq
import numpy as np

from scanwright.cad import solids
from scanwright.cad.layout import names
from scanwright.cad.layout.belt.loads import PRELOAD_N, press_newton
from scanwright.cad.layout.belt.stack import BOSS, HORN_BOSS_GAP, RIM, TRAVEL, BeltStack, pulley_foot_radius
from scanwright.cad.layout.drive import Ears
from scanwright.cad.layout.joints import (
    Joint,
    horn_centres,
    horn_joint,
    inward_axes,
    placed_axes,
    round_wall_mm,
    screws,
)
from scanwright.cad.layout.placement import Placement
from scanwright.cad.parts.part_spec import HORN, PartSpec, Row, Step, no_wider
from scanwright.cad.screws import SCREWS, Thread, passing_hole, thread_in_part
from scanwright.cad.solids import building
from scanwright.design.catalogue.products import Printer

CHORDS = 4  # of a groove's half circle: within 0.05 mm, below the resolution of a printer
MOUTH = 0.25  # extra width of a groove at the tips, on each side
GIVE_MM = 2.0  # movement of a strand in the test of its pre-load
OFF_AXIS = "more clearance puts the pulley further off its axis than belt_angle of checks.json assumes"
GRUB = SCREWS["M3"]  # of the pulley on the shaft
GRUBS_DEG = (45.0, 135.0)  # their azimuths from +x: on both sides of the flat


def shaft_pulley_spec(place: Placement) -> PartSpec | None:
    """Return the pulley on the shaft of one scanner; None without a belt."""
    stack, printer = place.drive.of(BeltStack), place.scanner.printer
    if stack is None:
        return None
    words = (
        "Push the pulley over the spigot down to the collar of the shaft, its boss upwards, and put the belt "
        f"around it: {stack.belt.name} of {stack.belt_teeth} teeth ({stack.belt_teeth * stack.belt.pitch_mm:g} mm). "
        f"{screws(names.MAIN_SHAFT)} Leave these two loose."
    )
    fit, grub = no_wider(stack.tube_diameter, printer.fit_clearance_mm, OFF_AXIS), _grub_thread(printer)
    azimuths = (math.radians(azimuth) for azimuth in GRUBS_DEG)
    return PartSpec(
        name=names.SHAFT_PULLEY,
        turns=True,
        make=partial(shaft_pulley, stack, printer),
        step=Step("Pulley and belt on the shaft", words, "the belt is between both rims", (names.BELT,)),
        fits=(fit,),
        notes=(_teeth_words(stack),),
        shapes={"belt.thickness_mm": "the rims of the pulleys", "belt.groove_radius_mm": "the teeth of the pulleys"},
        joints=(
            Joint(
                names.SHAFT_PULLEY,
                names.MAIN_SHAFT,
                "grub",
                GRUB,
                inward_axes(azimuths, stack.boss_radius, stack.pulley_top - BOSS / 2),
                grip_mm=round_wall_mm(_bore(stack, printer), stack.boss_radius, grub.hole),
                thread_mm=0.0,
                thread=grub,
            ),
        ),
    )


def _bore(stack: BeltStack, printer: Printer) -> float:
    """Return the bore radius of the pulley on the shaft: a light press fit."""
    return stack.tube_diameter / 2 + printer.fit_clearance_mm / 4


def _grub_thread(printer: Printer) -> Thread:
    return thread_in_part(GRUB, printer, nut_fits=False)


def drive_pulley_spec(place: Placement) -> PartSpec | None:
    """Return the pulley on the horn of one scanner; None without a belt."""
    scanner, stack = place.scanner, place.drive.of(BeltStack)
    plate = place.drive.of(Ears)
    if stack is None or plate is None:
        return None
    foot = pulley_foot_radius(scanner.servo, plate.opening)
    seat, grip = stack.pulley_seat, stack.pulley_seat - stack.horn
    horn = horn_joint(scanner.servo, names.DRIVE_PULLEY, names.SERVO_OUTPUT, seat, grip)
    push = press_newton(stack, PRELOAD_N, GIVE_MM)
    words = (
        f"The boss of the horn centres the pulley. {screws(names.SERVO_OUTPUT)} Hang the servo between the arms of the "
        "tower, put the belt around both pulleys, and insert the screws of the slots: "
        f"{screws(names.BEARING_TOWER, names.DRIVE_PLATE)} Pull the plate outwards until a push of {push:.1f} N "
        "(spring scale) in the "
        f"middle of a strand moves it by {GIVE_MM:g} mm: that is {PRELOAD_N:g} N in each strand. The centres are then "
        f"{stack.centre:g} mm apart; the slots allow {TRAVEL:g} mm to either side."
    )
    pocket = stack.servo.horn_boss_diameter_mm
    fits = (no_wider(pocket, scanner.printer.fit_clearance_mm, OFF_AXIS),) if pocket > 0 else ()
    return PartSpec(
        name=names.DRIVE_PULLEY,
        turns=False,
        make=partial(drive_pulley, stack, scanner.printer, foot),
        step=Step("Drive pulley and servo", words, "the belt stays between the rims for a turn by hand"),
        rows=(Row("tool", "spring scale", "spring scale", "assembly.md", "0 to 5 N, for the belt"),),
        fits=fits,
        notes=(_teeth_words(stack),),
        axis=stack.horn_axis,
        shaped_by=(*HORN, "servo.horn_thickness_mm"),
        sweep=partial(drive_envelope, stack, foot),
        joints=(replace(horn, axes=placed_axes(horn.axes, stack.turn(), stack.servo_origin() * [1.0, 1.0, 0.0])),),
    )


def shaft_pulley(stack: BeltStack, printer: Printer) -> cq.Solid:
    """Make the pulley on the shaft."""
    bore, grub = _bore(stack, printer), _grub_thread(printer)
    with building(names.SHAFT_PULLEY, "teeth and boss", "teeth", stack.teeth) as checked:
        boss = solids.upright(stack.boss_radius, stack.teeth_top - 0.5, stack.pulley_top)
        body = checked(_toothed(stack, None, boss))
    with building(names.SHAFT_PULLEY, "bore and grub screws", "shaft diameter", stack.tube_diameter) as checked:
        cuts = [solids.upright(bore, stack.teeth_low - 1.0, stack.pulley_top + 1.0)]
        for azimuth in GRUBS_DEG:
            cuts.append(solids.radial(grub.hole / 2, math.radians(azimuth), stack.pulley_top - BOSS / 2))
        return checked(body.cut(*cuts).clean())


def drive_pulley(stack: BeltStack, printer: Printer, foot_radius: float) -> cq.Solid:
    """Make the pulley on the horn."""
    servo, horn, top = stack.servo, stack.horn, stack.teeth_top + 1.0
    screw, boss = SCREWS[servo.horn_screw], servo.horn_boss_diameter_mm / 2
    with building(names.DRIVE_PULLEY, "teeth and foot", "teeth", stack.teeth) as checked:
        foot = solids.upright(foot_radius, horn, stack.teeth_low + 0.5)
        body = checked(_toothed(stack, foot, None))
    with building(names.DRIVE_PULLEY, "pocket and screws", "horn_circle_mm", servo.horn_circle_mm) as checked:
        cuts = []
        for x, y in horn_centres(servo).tolist():
            cuts.append(solids.upright(passing_hole(screw, printer) / 2, horn - 1.0, top, x, y))
            cuts.append(solids.upright(screw.driver_radius, stack.pulley_seat, top, x, y))
        if boss > 0:
            radius = boss + printer.fit_clearance_mm / 4
            cuts.append(solids.upright(radius, horn - 1.0, horn + servo.horn_boss_height_mm + HORN_BOSS_GAP))
        made = checked(body.cut(*cuts).clean())
    return made.moved(solids.location(stack.turn(), stack.servo_origin() * [1.0, 1.0, 0.0]))


def drive_envelope(stack: BeltStack, foot_radius: float) -> cq.Solid:
    """Return the space that the pulley on the horn fills while it turns about its own axis."""
    rim, tip = stack.rim_radius, stack.tip_radius
    low, high = stack.teeth_low, stack.teeth_top
    foot = solids.upright(foot_radius, stack.horn, low + 0.5)
    with building(names.DRIVE_PULLEY, "sweep", "teeth", stack.teeth) as checked:
        envelope = foot.fuse(
            solids.upright(rim, low, low + RIM), solids.upright(tip, low, high), solids.upright(rim, high - RIM, high)
        )
        swept = checked(envelope)
    return swept.moved(solids.location(stack.turn(), stack.servo_origin() * [1.0, 1.0, 0.0]))


def _teeth_words(stack: BeltStack) -> str:
    """Return the note of a pulley's drawing on its teeth."""
    belt = stack.belt
    return (
        f"{stack.teeth} teeth for {belt.name}, pitch {belt.pitch_mm:g}: pitch diameter {2 * stack.pitch_radius:.2f}, "
        f"over the tips {2 * stack.tip_radius:.2f}, grooves {belt.tooth_height_mm:g} deep with "
        f"a round bottom R{belt.groove_radius_mm:g}."
    )


def _toothed(stack: BeltStack, below: cq.Solid | None, above: cq.Solid | None) -> cq.Shape:
    """Return teeth between two rims about the axis, each rim joined with the solid on its far side.

    Rims and teeth touch without overlap: the kernel then glues them in half the time.
    """
    low, high = stack.teeth_low + RIM, stack.teeth_top - RIM
    teeth = cq.Solid.extrudeLinear(_outline(stack), [], cq.Vector(0, 0, high - low))
    lower: cq.Shape = solids.upright(stack.rim_radius, stack.teeth_low, low)
    upper: cq.Shape = solids.upright(stack.rim_radius, high, stack.teeth_top)
    lower, upper = (rim.fuse(more) if more else rim for rim, more in ((lower, below), (upper, above)))
    return teeth.moved(cq.Location(cq.Vector(0, 0, low))).fuse(lower, upper, glue=True)


def _outline(stack: BeltStack) -> cq.Wire:
    """Return the outline of the teeth at z = 0: a flank, the groove's half circle in chords, a flank, the tip."""
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
