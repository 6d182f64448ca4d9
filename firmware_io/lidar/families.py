"""Supported lidar families.

An installed package adds a `LidarFamily` by an entry point of the group "scanwright.lidars" (docs/how-to/new-lidar.md).
"""

from __future__ import annotations

from functools import cache

from scanwright.design.catalogue.catalogue import LIDAR_GROUP, load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, suggest
from scanwright.firmware_io.installed import with_installed
from scanwright.firmware_io.lidar.ldrobot.driver import LdrobotLidar
from scanwright.firmware_io.lidar.lidar import LidarDriver, LidarFamily, StampAt
from scanwright.firmware_io.lidar.lms2xx.driver import LmsLidar
from scanwright.firmware_io.lidar.scip.driver import ScipLidar
from scanwright.firmware_io.lidar.sick.driver import SICK_STAMPS, SickLidar
from scanwright.firmware_io.lidar.slamtec.driver import SlamtecLidar

_EMULATORS = "scanwright.firmware_io.emulators"  # named as text, since drivers must not import emulators

# If no model is given, they are tried in this order; the first one sends nothing to the device.
FAMILIES = (
    LidarFamily("ldrobot", "LDROBOT", LdrobotLidar, f"{_EMULATORS}.ldrobot:ldrobot_emulator"),
    LidarFamily("scip", "Hokuyo (SCIP 2.0)", ScipLidar, f"{_EMULATORS}.lidar:scip_emulator", ("step_0", "rear")),
    LidarFamily("slamtec", "Slamtec RPLIDAR", SlamtecLidar, f"{_EMULATORS}.slamtec.machine:slamtec_emulator"),
    LidarFamily(
        "sick", "SICK (CoLa A and B)", SickLidar, f"{_EMULATORS}.sick.cola_emulator:sick_emulator", SICK_STAMPS
    ),
    LidarFamily("lms2xx", "SICK LMS 2xx (RS-422)", LmsLidar, f"{_EMULATORS}.sick.lms_emulator:lms_emulator"),
)


@cache
def all_families() -> dict[str, LidarFamily]:
    """Return the shipped families and those of installed packages, by name; raises as `with_installed`."""
    return with_installed(LIDAR_GROUP, LidarFamily, FAMILIES)


def family_of(model: str) -> LidarFamily:
    """Return the family of a lidar; TaskError if it is not in the catalogue, DeviceError if it has no driver."""
    name = load_catalogue().get(model, Lidar).family
    if name is None:
        driven = [product.name for product in load_catalogue() if isinstance(product, Lidar) and product.family]
        raise DeviceError(f"{model}: no driver: its catalogue file names no family{suggest(model, driven)}")
    if name not in all_families():
        raise DeviceError(f"{model}: family = '{name}': not a family of lidars{suggest(name, all_families())}")
    return all_families()[name]


def open_lidar(address: str, model: str | None = None, stamp_at: StampAt | None = None) -> LidarDriver:
    """Open a lidar in any state.

    Args:
        address: such as "/dev/ttyACM0" or "192.168.0.10:10940".
        model: expected catalogue name; None tries all families.
        stamp_at: beam of its timestamps, if documents differ; None for the family's default.

    Raises:
        DeviceError: the port does not exist or is in use, or no known sensor answers.
        TaskError: the model is not in the catalogue.
    """
    if model is not None:
        family = family_of(model)
        if stamp_at is not None and stamp_at not in family.stamp_choices:
            allowed = (
                f"use {' or '.join(family.stamp_choices)}" if family.stamp_choices else "it has no choice; omit it"
            )
            raise DeviceError(f"stamp_at = '{stamp_at}': {model} ({family.title}): {allowed}")
        return family.open(address, model, stamp_at)
    failures = []
    for family in all_families().values():
        if stamp_at is not None and stamp_at not in family.stamp_choices:
            continue
        try:
            return family.open(address, None, stamp_at)
        except DeviceError as error:
            failures.append(str(error))
    raise DeviceError("; ".join(dict.fromkeys(failures)))
