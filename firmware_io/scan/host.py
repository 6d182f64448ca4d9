"""Diagnosis of serial ports of this computer, and udev rules for them (Linux)."""

from __future__ import annotations

import getpass
import os
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from serial.tools import list_ports

from scanwright.design.findings import Finding
from scanwright.firmware_io.device_ports import known_usb_ids

BRIDGES = {
    "10c4:ea60": "CP210x, of RPLIDAR and LDROBOT",
    "1a86:7523": "CH340",
    "1a86:55d3": "CH343, of Feetech's boards",
    "0403:6001": "FT232R",
}
"""USB to serial bridges of lidars and servo adapters, also used in other devices; ids of the makers."""

CURED_BY_RULES = ("brltty", "modem_manager", "latency_timer")
"""Codes of the findings that `udev_rules` solve."""

_ROOT = Path("/")
_RULE_FOLDERS = ("etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d")  # man udev
_SLOWEST_MS = 1  # latency timer: below the 10 ms between two readings of a servo


def examine_host(ports: Iterable[str]) -> Iterator[Finding]:
    """Examine permissions of the ports, and programs and settings that disturb serial ports."""
    yield from _permissions(ports)
    if rule := _brltty_rule():
        hint = "remove the package brltty, or install the udev rules"
        yield Finding("brltty", "warning", str(rule), f"{rule}: brltty takes CP210x and CH340 adapters away", hint=hint)
    if _runs("ModemManager"):
        hint = "install the udev rules, or stop it: sudo systemctl disable --now ModemManager"
        message = "ModemManager opens each new serial port for about 10 s"
        yield Finding("modem_manager", "warning", "ModemManager", message, hint=hint)
    yield from _latency_timers()
    yield from _shared_serial_numbers()


def udev_rules() -> str:
    """Return udev rules for the adapters of lidars and servos: access, no probing by other programs, low latency."""
    lines = [
        "# Serial adapters of lidars and servos. Save as /etc/udev/rules.d/60-scanwright.rules, then run",
        "# sudo udevadm control --reload && sudo udevadm trigger, and plug the adapters in again.",
    ]
    for usb_id in sorted(known_usb_ids() | set(BRIDGES)):
        vendor, product = usb_id.split(":")
        matched = f'ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}"'
        ignored = 'ENV{ID_MM_DEVICE_IGNORE}="1", ENV{BRLTTY_BRAILLE_DRIVER}=""'
        lines.append(f'SUBSYSTEM=="tty", {matched}, MODE="0660", GROUP="dialout", TAG+="uaccess", {ignored}')
        lines.append(f'SUBSYSTEM=="usb", {matched.replace("ATTRS", "ATTR")}, {ignored}')
    lines.append('ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"')
    return "\n".join(lines) + "\n"


def _permissions(ports: Iterable[str]) -> Iterator[Finding]:
    for port in ports:
        path = Path(port)
        if path.is_char_device() and not os.access(path, os.R_OK | os.W_OK):
            message = f"{port}: only the group '{path.group()}' may open it"
            hint = f"sudo usermod -aG {path.group()} {getpass.getuser()}, then log in again"
            yield Finding("port_access", "error", port, message, hint=hint)


def _brltty_rule() -> Path | None:
    """Return the rule by which brltty claims common adapters; None without one, or if another file masks it."""
    seen: set[str] = set()
    for folder in _RULE_FOLDERS:
        for file in sorted((_ROOT / folder).glob("*brltty*.rules")):
            if file.name in seen:
                continue
            seen.add(file.name)
            with suppress(OSError):
                lines = [line.lower() for line in file.read_text(errors="replace").splitlines()]
                rules = [line for line in lines if not line.lstrip().startswith("#")]
                if any("10c4/ea60" in line or "1a86/7523" in line for line in rules):
                    return file
    return None


def _runs(name: str) -> bool:
    for comm in (_ROOT / "proc").glob("[0-9]*/comm"):
        with suppress(OSError):
            if comm.read_text().strip() == name:
                return True
    return False


def _latency_timers() -> Iterator[Finding]:
    for file in sorted((_ROOT / "sys/bus/usb-serial/devices").glob("*/latency_timer")):
        with suppress(OSError, ValueError):
            timer_ms, port = int(file.read_text()), f"/dev/{file.parent.name}"
            if timer_ms > _SLOWEST_MS:
                message = f"{port}: latency timer of the adapter: {timer_ms} ms"
                hint = f"echo 1 | sudo tee {file}, or install the udev rules"
                yield Finding("latency_timer", "warning", port, message, timer_ms, _SLOWEST_MS, "ms", hint)


def _shared_serial_numbers() -> Iterator[Finding]:
    """Find adapters that `/dev/serial/by-id` does not distinguish."""
    ports: defaultdict[tuple[int, int, str], list[str]] = defaultdict(list)
    for port in list_ports.comports():
        if port.vid is not None and port.pid is not None:
            ports[port.vid, port.pid, port.serial_number or ""].append(port.device)
    for (_, _, number), same in ports.items():
        if len(same) > 1:
            message = f"{' and '.join(sorted(same))}: adapters with the same serial number '{number}'"
            hint = "name their ports by the USB socket: /dev/serial/by-path/..."
            yield Finding("same_serial_number", "warning", same[0], message, hint=hint)
