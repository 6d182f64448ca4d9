"""Every lidar and every servo of the catalogue scans the room that its emulators stand in; one row for each pair.

    uv run python -m benchmarks.firmware_io.devices.every_device [LIDAR...]

Each lidar is on the next servo of the list, so that every servo has its turn, and is swept out and back once in six
seconds, driven and assembled as from hardware. Told is how the cloud lies in the room, as `low_cost_cloud` tells it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from itertools import cycle

from benchmarks.firmware_io.devices.low_cost_cloud import scanned
from scanwright.design.angles import AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import ScanwrightError
from scanwright.design.progress import no_progress

_MOTION = {"mode": "sweep", "limits_deg": [-85, 85], "period_s": 6.0, "profile": "trapezoid", "accel_deg_s2": 200.0}
_ANGLES_DEG = {"alpha_rot": 0, "beta_rot": 0, "alpha_laser": 0, "beta_laser": 50}


def pairs(wanted: list[str]) -> Iterator[AngleSet]:
    """A scanner for each lidar that is driven, or for those that are named; servos take turns."""
    products = list(load_catalogue())
    servos = cycle(product for product in products if isinstance(product, Servo))
    for lidar in products:
        if isinstance(lidar, Lidar) and lidar.family:
            servo = next(servos)
            if not wanted or lidar.name in wanted:
                values = {"task": "devices", "angles_deg": _ANGLES_DEG, "motion": _MOTION}
                yield AngleSet.model_validate(values | {"sensor": lidar.name, "servo": servo.name})


def main() -> None:
    """Print the table; what cannot be scanned is a row, too, and fails the command."""
    with suppress(PermissionError):
        os.nice(-10)  # emulators need their time, as hardware does not
    failed = False
    print("| lidar | servo | points | away from edges | behind the room | spread | noise | beyond six times it |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for angles in pairs(sys.argv[1:]):
        who = f"| {angles.sensor} | {angles.servo} |"
        try:
            found = scanned(angles, 1, no_progress)
        except ScanwrightError as error:
            failed = True
            print(f"{who} {error} |", flush=True)
            continue
        noise_mm = load_catalogue().get(angles.sensor, Lidar).range_sigma_mm
        print(
            f"{who} {found.points:,} | {found.share:.0%} | {found.median_mm:+.2f} mm | {found.spread_mm:.1f} mm | "
            f"{noise_mm:g} mm | {found.beyond:.2%} |",
            flush=True,
        )
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
