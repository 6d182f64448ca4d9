"""Where the devices are: the ports of an emulated scanner, or of the hardware that is plugged in."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from serial.tools import list_ports

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.products import Lidar, Servo
from scanwright.design.errors import DeviceError
from scanwright.design.files.atomic_file import atomic_write, place_in

_FILE = "emulated.json"


@dataclass(frozen=True, slots=True)
class Ports:
    """Addresses of the two devices, as `open_lidar` and `open_servo` take them; `pid` is who emulates them, or 0."""

    lidar: str
    servo: str
    pid: int = 0


@contextmanager
def announced(out: Path, ports: Ports) -> Iterator[None]:
    """Leave the ports of an emulated scanner in its build folder, so that `scan` finds them; take them away after.

    Raises:
        DeviceError: the folder cannot be written, or this scanner is being emulated already.
    """
    running = emulated(out)
    if running is not None:
        raise DeviceError(f"{out}: process {running.pid} emulates this scanner already: stop it first")
    file = place_in(out, _FILE, DeviceError)
    with atomic_write(file, DeviceError) as part:
        part.write_text(json.dumps(asdict(ports), indent=2) + "\n", encoding="utf-8")
    try:
        yield
    finally:
        file.unlink(missing_ok=True)


def emulated(out: Path) -> Ports | None:
    """Ports of the emulated scanner of this folder; None where nobody emulates it now."""
    try:
        found = Ports(**json.loads((out / _FILE).read_text(encoding="utf-8")))
        if not (isinstance(found.lidar, str) and isinstance(found.servo, str)):
            return None
        os.kill(found.pid, 0)
    except (OSError, ValueError, TypeError, OverflowError, RecursionError):  # none, another program's, or its is gone
        return None
    return found


def lidar_ports() -> list[str]:
    """Serial ports that are plugged in and, by their USB ids, those of a lidar of the catalogue."""
    return _plugged(Lidar)


def servo_ports() -> list[str]:
    """Serial ports that are plugged in and, by their USB ids, adapters of a servo of the catalogue."""
    return _plugged(Servo)


def find_ports(out: Path, lidar: str | None, servo: str | None) -> Ports:
    """The ports that were named, else those of the emulated scanner, else the only ones that are plugged in.

    Raises:
        DeviceError: a port is not named, and not one but none or several could be meant.
    """
    twins = emulated(out)
    if twins is not None and lidar is None and servo is None:
        return twins
    return Ports(
        lidar=lidar or _only("--lidar", "lidar", lidar_ports()),
        servo=servo or _only("--servo", "serial adapter of a servo", servo_ports()),
    )


def _plugged(kind: type[Lidar] | type[Servo]) -> list[str]:
    known = {usb_id for product in load_catalogue() if isinstance(product, kind) for usb_id in product.usb_ids or ()}
    plugged = [port for port in list_ports.comports() if port.vid is not None and port.pid is not None]
    return sorted(port.device for port in plugged if f"{port.vid:04x}:{port.pid:04x}" in known)


def _only(option: str, what: str, found: list[str]) -> str:
    if len(found) == 1:
        return found[0]
    seen = f"found {', '.join(found)}" if found else "found none"
    raise DeviceError(f"{option}: which {what}? {seen}; name it, or run `scanwright emulate` for one without hardware")
