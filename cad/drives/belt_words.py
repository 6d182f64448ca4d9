"""How a scanner with a belt beside its axis is put together, in words."""

from __future__ import annotations

from cad.drives.belt_loads import PRELOAD_N, press_newton
from cad.drives.direct_words import DIRECT_STEPS
from cad.layout.belt_stack import TRAVEL, BeltStack

GIVE_MM = 2.0  # of a strand, when the pre-load is felt


def belt_steps(stack: BeltStack) -> dict[str, tuple[str, str]]:
    """Title and words by the part that a step puts in, in the order that always works.

    Braces are filled with screws: `{onto}` with those of the step's part, `{part>onto}` with those of any other.
    """
    belt = f"{stack.belt.name} of {stack.belt_teeth} teeth ({stack.belt_teeth * stack.belt.pitch_mm:g} mm)"
    push = press_newton(stack, PRELOAD_N, GIVE_MM)
    return {
        "slip_ring_adapter": (
            "Capsule on its disc",
            "On the bench: put the capsule through the disc from above, its flange on the disc, its rotor upwards. "
            "{ring_stator} Leave them so loose that the flange still gives. Push 10 mm of soft tube, "
            f"{stack.shaft_bore:g} x {stack.rotor.diameter_mm:g} mm, over the stub of the rotor.",
        ),
        "bearing_tower": (
            "Bearings into the tower",
            "Press one bearing into each end of the tower's lip by its outer ring: one from above, one from below.",
        ),
        "shaft_pulley": (
            "Pulley and belt on the shaft",
            "Push the pulley over the spigot down to the collar of the shaft, its boss upwards, and lay the belt "
            f"around it: {belt}. " + "{main_shaft} Leave these two loose.",
        ),
        "main_shaft": (
            "Shaft into the tower",
            "Lower the shaft through both bearings until its collar lies on the upper one.",
        ),
        "shaft_ring": (
            "Ring under the bearings",
            "From below push the ring up the shaft, its step against the lower bearing, so that the shaft has no play "
            "along the axis and still turns freely. {main_shaft} A driver reaches them through the round window in the "
            "tower: turn the shaft until they show.",
        ),
        "ring": (
            "Capsule into the tower",
            "Lead the rotor's leads up the shaft and out by one of its windows, and slide the disc into the tower from "
            "below until the soft tube sits in the shaft. {bearing_tower>slip_ring_adapter}",
        ),
        "drive_plate": (
            "Servo on its plate",
            "Turn the servo to its centre (position 2048 of 4096, 512 of 1024) and put the plate on its front. "
            "{servo_case}",
        ),
        "drive_pulley": (
            "Drive pulley, and the servo beside the shaft",
            "The boss of the horn centres the pulley. {servo_output} Hang the servo between the arms of the tower, lay "
            "the belt around both pulleys, and put in the screws of the slots: {drive_plate>bearing_tower} Pull the "
            f"plate outwards until a push of {push:.1f} N in the middle of a strand moves it by {GIVE_MM:g} mm: that "
            f"is {PRELOAD_N:g} N in each strand. The centres are then {stack.centre:g} mm apart; the slots give "
            f"{TRAVEL:g} mm to either side.",
        ),
        "base_mount": (
            "Tower on the mount",
            "Put the tower on the rails of the base mount, the stator's leads into the channel behind it. "
            "{bearing_tower} {deck}",
        ),
        "lidar": DIRECT_STEPS["lidar"],
        "sub_plate": DIRECT_STEPS["sub_plate"],
        "counterweight": DIRECT_STEPS["counterweight"],
        "alignment_linkage": (
            "Linkage on the shaft, and the belt set",
            "Lower the hub onto the upper end of the shaft until it sits on the end; the flat of the shaft fits one "
            "way only. {main_shaft} Now set the belt: with the servo still at its centre turn the linkage, and the "
            "shaft in its loose pulley, until the groove of the hub stands over the groove in the edge of the tower's "
            "top, and tighten the pulley's two grub screws. Both pulleys have the same number of teeth and turn the "
            "same way, so from now on the servo's angle is that of the axis.",
        ),
    }


def teeth_words(stack: BeltStack) -> str:
    """What a pulley's drawing says of its teeth."""
    belt = stack.belt
    return (
        f"{stack.teeth} teeth for {belt.name}, pitch {belt.pitch_mm:g}: pitch diameter {2 * stack.pitch_radius:.2f}, "
        f"over the tips {2 * stack.tip_radius:.2f}, grooves {belt.tooth_height_mm:g} deep with "
        f"a round bottom R{belt.groove_radius_mm:g}."
    )
