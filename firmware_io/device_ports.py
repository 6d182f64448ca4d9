"""Ports of the devices, of an emulated scanner or of connected hardware."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from serial.tools import list_ports

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import DeviceError
from scanwright.design.files.atomic_file import atomic_write, place_in

_FILE = "emulated.json"


@dataclass(frozen=True, slots=True)
class Ports:
    """Addresses of the two devices; `pid` is the process that emulates them, or 0."""

    lidar: str
    servo: str
    pid: int = 0


@contextmanager
def announced(out: Path, ports: Ports) -> Iterator[None]:
    """Write the ports of an emulated scanner to its build folder during the body, for `scan`.

    DeviceError if the folder cannot be written, or this scanner is already emulated.
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
    """Return the ports of the emulated scanner of this folder; None if it is not emulated."""
    try:
        ports = Ports(**json.loads((out / _FILE).read_text(encoding="utf-8")))
        if not (isinstance(ports.lidar, str) and isinstance(ports.servo, str)):
            return None
        os.kill(ports.pid, 0)
    except (OSError, ValueError, TypeError, OverflowError, RecursionError):  # no file, or of another or ended program
        return None
    return ports


def lidar_ports() -> list[str]:
    """Return the serial ports with the USB id of a lidar of the catalogue."""
    return _plugged(Lidar)


def servo_ports() -> list[str]:
    """Return the serial ports with the USB id of an adapter of a servo of the catalogue."""
    return _plugged(Servo)


def find_ports(out: Path, lidar: str | None, servo: str | None) -> Ports:
    """Return the given ports, those of the emulated scanner, or the only connected ones; DeviceError if ambiguous."""
    emulators = emulated(out)
    if emulators is not None and lidar is None and servo is None:
        return emulators
    return Ports(
        lidar=lidar or _only("lidar", lidar_ports()),
        servo=servo or _only("servo", servo_ports()),
    )


def known_usb_ids(kind: type[Lidar] | type[Servo] | tuple[type[Lidar], type[Servo]] = (Lidar, Servo)) -> set[str]:
    """Return the USB ids ("0403:6014") of lidars and servo adapters of the catalogue."""
    return {usb_id for product in load_catalogue() if isinstance(product, kind) for usb_id in product.usb_ids or ()}


def _plugged(kind: type[Lidar] | type[Servo]) -> list[str]:
    known = known_usb_ids(kind)
    plugged = [port for port in list_ports.comports() if port.vid is not None and port.pid is not None]
    return sorted(port.device for port in plugged if f"{port.vid:04x}:{port.pid:04x}" in known)


def _only(field: str, ports: list[str]) -> str:
    if len(ports) == 1:
        return ports[0]
    number = f"{len(ports)} ports could be meant: {', '.join(ports)}" if ports else "no port with a known USB id"
    raise DeviceError(f"{field}: {number}; name the port, or run `scanwright emulate` to work without hardware")
