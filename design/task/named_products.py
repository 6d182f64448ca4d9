"""Check that the products of a task exist and can do its motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from scanwright.design.catalogue.catalogue import Catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import TaskError
from scanwright.design.files.faults import Fault
from scanwright.design.motion import Motion, Shortest, Spin, Sweep

NAMED: dict[str, type[Product]] = {"sensor": Lidar, "servo": Servo, "slip_ring": SlipRing, "printer": Printer}
"""Keys of a task that name a product, and its kind."""

Names = Mapping[str, str | None]


def motion_faults(names: Names, motion: Motion | Shortest, products: Catalogue) -> list[Fault]:
    """Return the faults of the products of a task (`names` by the keys of `NAMED`), and of its motion with them."""
    faults: list[Fault] = []
    for key, kind in NAMED.items():
        name = names[key]
        try:
            if name is not None:
                products.get(name, kind)
        except TaskError as error:
            faults.append(Fault((key,), f": {error}"))
    if names["slip_ring"] is None and not isinstance(motion, Sweep):
        mode = "spin" if isinstance(motion, Shortest) else motion.mode
        word = "turns without end" if mode == "spin" else "goes all around"
        faults.append(Fault(("motion",), f".mode = '{mode}' {word} and needs a slip ring: name it as slip_ring"))
    unknown = {fault.path[0] for fault in faults}
    return faults if unknown & {"servo", "slip_ring"} else faults + _speed_faults(names, motion, products)


def fastest_rpm(names: Names, motion: Motion | Shortest, products: Catalogue) -> tuple[float, str]:
    """Return the highest speed of servo and slip ring of a task [rpm], and the field that limits it.

    Raises:
        TaskError: one of them is not in the catalogue.
    """
    servo = products.get(str(names["servo"]), Servo)
    bounds = [(servo.no_load_rpm, f"servo = '{servo.name}'")]
    if names["slip_ring"] is not None and not isinstance(motion, Sweep):
        ring = products.get(names["slip_ring"], SlipRing)
        bounds += [] if ring.max_rpm is None else [(ring.max_rpm, f"slip_ring = '{ring.name}'")]
    return min(bounds)


def _speed_faults(names: Names, motion: Motion | Shortest, products: Catalogue) -> list[Fault]:
    faults: list[Fault] = []
    if isinstance(motion, Sweep):
        servo = products.get(str(names["servo"]), Servo)
        reach = servo.angular_range_deg / 2
        if max(-motion.limits_deg[0], motion.limits_deg[1]) > reach:
            message = f" = {list(motion.limits_deg)}: the {servo.name} reaches -{reach:g} .. {reach:g}"
            faults.append(Fault(("motion", "limits_deg"), message))
    if not isinstance(motion, Spin | Sweep):
        return faults
    most, field = fastest_rpm(names, motion, products)
    if isinstance(motion, Spin):
        rpm, least_s = 60 / motion.period_s, 60 / most
    else:
        span_deg, cruise_deg_s = motion.limits_deg[1] - motion.limits_deg[0], 6 * most
        rpm, least_s = motion.cruise_deg_s / 6, 2 * (span_deg / cruise_deg_s + cruise_deg_s / motion.accel_deg_s2)
    if rpm > most:
        message = (
            f" = {motion.period_s:g}: that is {rpm:.3g} rpm, and {field} turns at {most:g} rpm at most, without a "
            f"load: use {np.ceil(1000 * least_s) / 1000:g} or more"
        )
        faults.append(Fault(("motion", "period_s"), message))
    return faults
