"""How a scanner with its servo on the axis is put together, in words."""

from __future__ import annotations

# The order that always works: what comes over the shaft follows what carries it. `{...}` is filled with the screws.
DIRECT_STEPS: dict[str, tuple[str, str]] = {
    "base_mount": (
        "Servo into the mount",
        "Put the case between the rails of the base mount, plugs to the channel behind it. {servo_case} Connect the "
        "servo's cable now. {deck}",
    ),
    "deck": (
        "Servo on the deck",
        "The axis stands upright, so no mount is needed: drill the pattern of the servo's rear holes into the deck. "
        "{servo_case} Leave room for the plugs.",
    ),
    "servo_shaft": (
        "Shaft on the horn",
        "Turn the servo to its centre (position 2048 of 4096, 512 of 1024). Put the flange of the shaft on the horn so "
        "that its index groove points to the servo's +Y face, the end of the case nearest to the horn. {servo_horn}",
    ),
    "slip_ring_adapter": (
        "Adapter on the servo",
        "Slide the fork round the flange of the shaft. {servo_case}",
    ),
    "cage_base": ("Base of the cage on the servo", "Lower the base over the shaft. {servo_case}"),
    "ring": (
        "Slip ring",
        "Lower the ring over the shaft, the rotor's leads upwards, and clamp its rotor to the shaft with its own set "
        "screws. A cable tie in the grooves of the adapter holds the stator: it may move a little, it may not turn.",
    ),
    "bearing_cage": (
        "Bearing and cage",
        "Put the bearing into its seat and lower the cage onto its base. Put the screws of the cage "
        "in loosely: {*} Tighten them last, when the linkage is on and turns freely, so that the bearing finds the "
        "journal.",
    ),
    "lidar": (
        "Lidar on its seat",
        "On the bench: put the lidar on its seat, its front to the V in the edge (FRONT), its cables over the square "
        "notch. {lidar_body}",
    ),
    "sub_plate": (
        "Lidar and sub-plate on the linkage",
        "The hub covers one of the lidar's screws, so the lidar came on a plate of its own: put this plate on the "
        "linkage, FRONT over FRONT, and drive the screws of its ears from the lidar's side. {alignment_linkage}",
    ),
    "counterweight": (
        "Counterweight on the linkage",
        "Lay the bar on the ear of the hub, its threads over the slots, and drive the screws from below, in the middle "
        "of the slots. {alignment_linkage>counterweight} The leads of the ring pass below their heads. Nobody tells "
        "where a lidar's centre of mass is: when the scanner turns, slide the bar along its slots to where `scanwright "
        "scan` prints the least ripple.",
    ),
    "alignment_linkage": (
        "Linkage on the shaft",
        "Lower the hub onto the upper end of the shaft until it sits on the end; the flat of the shaft fits one way "
        "only, and the groove of the hub then stands above the groove of the flange. {servo_shaft}",
    ),
}
