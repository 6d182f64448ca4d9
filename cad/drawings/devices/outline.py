"""Geometry of a device's sketch: boxes, cylinders and holes, from its catalogue record."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from scanwright.cad.drawings.patterns import number
from scanwright.cad.screws import SCREWS
from scanwright.design.arrays import Array
from scanwright.design.catalogue.holes import Hole
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Bearing, Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import TaskError

Point3 = tuple[float, float, float]
AXES = {f"{sign}{axis}": (1 if sign == "+" else -1) * np.eye(3)[i] for i, axis in enumerate("xyz") for sign in "+-"}


@dataclass(frozen=True, slots=True)
class BoxBody:
    """A box between two corners."""

    low: Point3
    high: Point3


@dataclass(frozen=True, slots=True)
class Upright:
    """A cylinder about the z axis."""

    radius: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Spot:
    """A hole to draw: middle of its mouth, direction out of the device, radius, call-out of its kind."""

    at: Point3
    out: tuple[float, float, float]
    radius: float
    words: str


@dataclass(frozen=True, slots=True)
class DeviceOutline:
    """A device to draw.

    Attributes:
        solids: its bodies.
        spots: its holes.
        heights: other heights that get a dimension, such as that of the optical centre.
        unverified: fields that the sketch shows and no source verifies.
    """

    solids: tuple[BoxBody | Upright, ...]
    spots: tuple[Spot, ...] = ()
    heights: tuple[float, ...] = ()
    unverified: tuple[str, ...] = ()


def direction_of(hole: Hole) -> Array:
    """Return the unit vector out of the device along a hole."""
    axis = AXES[hole.axis] if isinstance(hole.axis, str) else np.asarray(hole.axis, dtype=float)
    return np.asarray(axis / np.linalg.norm(axis))


def spots_of(holes: Iterable[Hole], mark: str = "") -> tuple[Spot, ...]:
    """Return holes as a sketch shows them; `mark` stands behind the call-out of unverified ones."""
    spots = []
    for hole in holes:
        depth = f"{number(hole.depth_mm)} {'THICK' if hole.kind == 'through' else 'DEEP'}"
        words = f"{hole.size} {hole.kind.replace('_', ' ').upper()}, {depth}{mark}"
        x, y, z = direction_of(hole).tolist()
        spots.append(Spot(hole.at_mm, (x, y, z), SCREWS[hole.size].nominal / 2, words))
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
    window = Upright(product.window_radius_mm, *product.window_z_mm)
    body = BoxBody((-x / 2, -y / 2, 0.0), (x / 2, y / 2, z))
    ears = [BoxBody(low, high) for low, high in product.ears_mm or ()]
    fields = ("body_mm", "ears_mm", "window_z_mm", "window_radius_mm", "holes", "optical_height_mm")
    unverified = _open(product, fields)
    spots = spots_of(product.holes, _mark("holes", unverified))
    return DeviceOutline((body, *ears, window), spots, (product.optical_height_mm,), unverified)


@outline_of.register
def _servo(product: Servo) -> DeviceOutline:
    horn = Upright(product.horn_diameter_mm / 2, -product.horn_thickness_mm, 0.0)
    boss = Upright(product.horn_boss_diameter_mm / 2, 0.0, product.horn_boss_height_mm)
    horn_fields = ("horn_circle_mm", "horn_holes", "horn_first_hole_deg", "horn_screw", "horn_thread_depth_mm")
    fields = ("case_min_mm", "case_max_mm", "horn_diameter_mm", "horn_thickness_mm", *horn_fields, "holes")
    unverified = _open(product, fields)
    mark = "?" if set(horn_fields) & set(unverified) else ""
    turns = math.radians(product.horn_first_hole_deg) + 2 * math.pi * np.arange(product.horn_holes) / product.horn_holes
    circle = product.horn_circle_mm / 2
    words = f"{product.horn_screw} TAPPED, {number(product.horn_thread_depth_mm)} DEEP ON Ø{number(2 * circle)}{mark}"
    radius = SCREWS[product.horn_screw].nominal / 2
    on_horn = [Spot((-circle * math.sin(t), circle * math.cos(t), 0.0), (0.0, 0.0, 1.0), radius, words) for t in turns]
    solids: list[BoxBody | Upright] = [BoxBody(product.case_min_mm, product.case_max_mm), horn]
    spots = (*on_horn, *spots_of(product.holes, _mark("holes", unverified)))
    return DeviceOutline((*solids, *([boss] if boss.radius else [])), spots, (), unverified)


@outline_of.register
def _slip_ring(product: SlipRing) -> DeviceOutline:
    length = product.length_mm
    solids = [Upright(product.outer_diameter_mm / 2, 0.0, length)]
    if product.bore_mm:
        solids.append(Upright(product.bore_mm / 2, 0.0, length))
    spots: list[Spot] = []
    if product.flange is not None:
        flange = product.flange
        top = length - flange.below_top_mm
        solids.append(Upright(flange.diameter_mm / 2, top - flange.thickness_mm, top))
        words = f"Ø{number(flange.hole_mm)} FOR {flange.screw}"
        for turn in 2 * math.pi * np.arange(flange.holes) / flange.holes:
            x, y = flange.circle_mm / 2 * math.cos(turn), flange.circle_mm / 2 * math.sin(turn)
            spots.append(Spot((x, y, top), (0.0, 0.0, 1.0), flange.hole_mm / 2, words))
    if product.rotor is not None:
        solids.append(Upright(product.rotor.diameter_mm / 2, length, length + product.rotor.length_mm))
    fields = ("bore_mm", "outer_diameter_mm", "length_mm", "flange", "rotor")
    return DeviceOutline(tuple(solids), tuple(spots), (), _open(product, fields))


@outline_of.register
def _bearing(product: Bearing) -> DeviceOutline:
    outer = Upright(product.outer_mm / 2, 0.0, product.width_mm)
    bore = Upright(product.bore_mm / 2, 0.0, product.width_mm)
    return DeviceOutline((outer, bore), (), (), _open(product, ("bore_mm", "outer_mm", "width_mm")))


@outline_of.register
def _printer(product: Printer) -> DeviceOutline:
    return DeviceOutline((BoxBody((0.0, 0.0, 0.0), product.bed_mm),), (), (), _open(product, ("bed_mm",)))


def _open(product: Product, fields: Sequence[str]) -> tuple[str, ...]:
    return tuple(field for field in product.unverified() if field in fields)


def _mark(field: str, unverified: Sequence[str]) -> str:
    return "?" if field in unverified else ""
