"""Geometry of a device's sketch: boxes, cylinders and holes, from its catalogue record."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from scanwright.cad.drawings.patterns import number
from scanwright.cad.layout.drive import Point, Rod
from scanwright.cad.layout.envelope import Box
from scanwright.cad.layout.joints import triple
from scanwright.cad.screws import SCREWS
from scanwright.design.catalogue.holes import Hole
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Bearing
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import TaskError

AXES = {f"{sign}{axis}": (1 if sign == "+" else -1) * np.eye(3)[i] for i, axis in enumerate("xyz") for sign in "+-"}


@dataclass(frozen=True, slots=True)
class Spot:
    """A hole to draw: middle of its mouth, direction out of the device, radius, call-out of its kind."""

    at: Point
    out: Point
    radius: float
    words: str


@dataclass(frozen=True, slots=True)
class DeviceOutline:
    """A device to draw."""

    solids: tuple[Box | Rod, ...]  # its bodies
    spots: tuple[Spot, ...] = ()  # its holes
    heights: tuple[float, ...] = ()  # other heights that get a dimension, such as that of the optical centre
    unverified: tuple[str, ...] = ()  # fields of the sketch that are not verified


def spots_of(holes: Iterable[Hole], mark: str = "") -> tuple[Spot, ...]:
    """Return the holes of a sketch; `mark` follows the call-out of unverified ones."""
    spots = []
    for hole in holes:
        depth = f"{number(hole.depth_mm)} {'THICK' if hole.kind == 'through' else 'DEEP'}"
        words = f"{hole.size} {hole.kind.replace('_', ' ').upper()}, {depth}{mark}"
        axis = AXES[hole.axis] if isinstance(hole.axis, str) else np.asarray(hole.axis, dtype=float)
        spots.append(Spot(hole.at_mm, triple(axis / np.linalg.norm(axis)), SCREWS[hole.size].nominal / 2, words))
    return tuple(spots)


@singledispatch
def outline_of(product: Product) -> DeviceOutline:
    """Return the geometry of a product's sketch.

    Raises:
        TaskError: its record has no dimensions.
    """
    raise TaskError(f"{product.name}: a {product.kind} has no dimensions to draw")


@outline_of.register
def _lidar(product: Lidar) -> DeviceOutline:
    x, y, z = product.body_mm
    window = Rod(product.window_radius_mm, *product.window_z_mm)
    body = ((-x / 2, -y / 2, 0.0), (x / 2, y / 2, z))
    fields = ("body_mm", "ears_mm", "window_z_mm", "window_radius_mm", "holes", "optical_height_mm")
    unverified = _open(product, fields)
    spots = spots_of(product.holes, "?" if "holes" in unverified else "")
    return DeviceOutline((body, *(product.ears_mm or ()), window), spots, (product.optical_height_mm,), unverified)


@outline_of.register
def _servo(product: Servo) -> DeviceOutline:
    horn = Rod(product.horn_diameter_mm / 2, -product.horn_thickness_mm, 0.0)
    boss = Rod(product.horn_boss_diameter_mm / 2, 0.0, product.horn_boss_height_mm)
    horn_fields = ("horn_circle_mm", "horn_holes", "horn_first_hole_deg", "horn_screw", "horn_thread_depth_mm")
    fields = ("case_min_mm", "case_max_mm", "horn_diameter_mm", "horn_thickness_mm", *horn_fields, "holes")
    unverified = _open(product, fields)
    mark = "?" if set(horn_fields) & set(unverified) else ""
    turns = math.radians(product.horn_first_hole_deg) + 2 * math.pi * np.arange(product.horn_holes) / product.horn_holes
    circle = product.horn_circle_mm / 2
    words = f"{product.horn_screw} TAPPED, {number(product.horn_thread_depth_mm)} DEEP ON Ø{number(2 * circle)}{mark}"
    radius = SCREWS[product.horn_screw].nominal / 2
    on_horn = [Spot((-circle * math.sin(t), circle * math.cos(t), 0.0), (0.0, 0.0, 1.0), radius, words) for t in turns]
    solids: list[Box | Rod] = [(product.case_min_mm, product.case_max_mm), horn]
    spots = (*on_horn, *spots_of(product.holes, "?" if "holes" in unverified else ""))
    return DeviceOutline((*solids, *([boss] if boss.radius else [])), spots, (), unverified)


@outline_of.register
def _slip_ring(product: SlipRing) -> DeviceOutline:
    length = product.length_mm
    solids = [Rod(product.outer_diameter_mm / 2, 0.0, length)]
    if product.bore_mm:
        solids.append(Rod(product.bore_mm / 2, 0.0, length))
    spots: list[Spot] = []
    if product.flange is not None:
        flange = product.flange
        top = length - flange.below_top_mm
        solids.append(Rod(flange.diameter_mm / 2, top - flange.thickness_mm, top))
        words = f"Ø{number(flange.hole_mm)} FOR {flange.screw}"
        for turn in 2 * math.pi * np.arange(flange.holes) / flange.holes:
            x, y = flange.circle_mm / 2 * math.cos(turn), flange.circle_mm / 2 * math.sin(turn)
            spots.append(Spot((x, y, top), (0.0, 0.0, 1.0), flange.hole_mm / 2, words))
    if product.rotor is not None:
        solids.append(Rod(product.rotor.diameter_mm / 2, length, length + product.rotor.length_mm))
    fields = ("bore_mm", "outer_diameter_mm", "length_mm", "flange", "rotor")
    return DeviceOutline(tuple(solids), tuple(spots), (), _open(product, fields))


@outline_of.register
def _bearing(product: Bearing) -> DeviceOutline:
    outer = Rod(product.outer_mm / 2, 0.0, product.width_mm)
    bore = Rod(product.bore_mm / 2, 0.0, product.width_mm)
    return DeviceOutline((outer, bore), (), (), _open(product, ("bore_mm", "outer_mm", "width_mm")))


def _open(product: Product, fields: Sequence[str]) -> tuple[str, ...]:
    return tuple(field for field in product.unverified() if field in fields)
