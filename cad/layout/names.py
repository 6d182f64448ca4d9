"""The names of parts, of bought products and of the bodies that draw these: in files, lists and words."""

from __future__ import annotations

# made parts
ALIGNMENT_LINKAGE = "alignment_linkage"
BASE_MOUNT = "base_mount"
BEARING_CAGE = "bearing_cage"
BEARING_TOWER = "bearing_tower"
CAGE_BASE = "cage_base"
COUNTERWEIGHT = "counterweight"
DRIVE_PLATE = "drive_plate"
DRIVE_PULLEY = "drive_pulley"
FIT_COUPON = "fit_coupon"
HORN_CUP = "horn_cup"
JOURNAL_SLEEVE = "journal_sleeve"
MAIN_SHAFT = "main_shaft"
RING_COVER = "ring_cover"
SERVO_SHAFT = "servo_shaft"
SHAFT_PULLEY = "shaft_pulley"
SHAFT_RING = "shaft_ring"
SLIP_RING_ADAPTER = "slip_ring_adapter"
SUB_PLATE = "sub_plate"
TRIPOD_FOOT = "tripod_foot"

# bought products, and what they are screwed to
BEARING = "bearing"
BELT = "belt"
DECK = "deck"
LIDAR = "lidar"
RING = "ring"
ROTOR_LEADS = "rotor_leads"
SERVO = "servo"
TRIPOD = "tripod"

# bodies of bought products
LIDAR_BODY = "lidar_body"
LIDAR_CABLE = "lidar_cable"
LIDAR_CAP = "lidar_cap"
LIDAR_WINDOW = "lidar_window"
RING_ROTOR = "ring_rotor"
RING_STATOR = "ring_stator"
ROTOR_LEAD = "rotor_lead"
SERVO_CASE = "servo_case"
SERVO_HORN = "servo_horn"
SERVO_OUTPUT = "servo_output"  # the horn beside the axis
