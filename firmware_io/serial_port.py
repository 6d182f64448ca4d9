"""A serial port, opened for one program alone, without touching what its control lines say."""

from __future__ import annotations

import errno
import termios
from pathlib import Path

import serial
from serial.tools.list_ports import comports

from scanwright.design.errors import DeviceError

_WRITE_S = 10.0  # only a port that nobody serves any more takes longer; a busy computer can take seconds
_ADAPTERS = Path("/sys/bus/usb-serial/devices")


class _UntouchedLines(serial.Serial):  # type: ignore[misc]
    """A port whose DTR and RTS stay as they are: pyserial always raises them, which resets boards."""

    def _update_dtr_state(self) -> None:
        """Leave it."""

    def _update_rts_state(self) -> None:
        """Leave it."""


def open_serial_port(port: str, baud: int, read_timeout_s: float | None = None) -> serial.Serial:
    """Open a port, which nobody else can open meanwhile.

    DTR and RTS are left as they are. (Linux itself raises them where it opens a port that nobody had open.)

    Args:
        port: such as /dev/ttyUSB0; /dev/serial/by-id/... stays the same after a re-plug.
        baud: bits per second.
        read_timeout_s: how long reading waits; None for ever.

    Raises:
        DeviceError: no such port, it is in use, or may not be opened.
    """
    try:
        return _UntouchedLines(port, baud, exclusive=True, timeout=read_timeout_s, write_timeout=_WRITE_S)
    except (OSError, ValueError) as error:  # pyserial's own are OSErrors
        raise DeviceError(_why_not_opened(port, error)) from error


def latency_timer(port: str) -> Path | None:
    """The file with the time [ms] for which a USB adapter gathers bytes; None for ports that have no such timer."""
    file = _ADAPTERS / Path(port).resolve().name / "latency_timer"
    return file if file.is_file() else None


def _why_not_opened(port: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        there = ", ".join(sorted(other.device for other in comports())) or "none"
        return f"{port}: no such port; serial ports here: {there}"
    if number in (errno.EACCES, errno.EPERM):
        return f"{port}: you may not open it; become a member of its group (often 'dialout'), then log in again"
    if number in (errno.EAGAIN, errno.EBUSY):
        return f"{port}: another program has it open; end that one first"
    if number in (errno.ENODEV, errno.ENXIO) or isinstance(error.__context__, termios.error):
        return f"{port}: this is no serial port, or its device is gone"
    return f"{port}: cannot be opened: {error}"
