"""Serial port, opened exclusively, with unchanged control lines."""

from __future__ import annotations

import errno
import termios
from pathlib import Path

import serial
from serial.tools.list_ports import comports

from scanwright.design.errors import DeviceError
from scanwright.firmware_io.capture import captured

_WRITE_S = 10.0  # a busy computer can need seconds
_ADAPTERS = Path("/sys/bus/usb-serial/devices")


class _UntouchedLines(serial.Serial):  # type: ignore[misc]
    """A port with unchanged DTR and RTS: pyserial always raises them, which resets boards."""

    def read(self, size: int = 1) -> bytes:
        """Read up to so many bytes."""
        return captured(str(self.port), "<", super().read(size))

    def write(self, data: bytes) -> int:
        """Send all bytes."""
        return int(super().write(captured(str(self.port), ">", data)))

    def _update_dtr_state(self) -> None:
        pass

    def _update_rts_state(self) -> None:
        pass


def open_serial_port(port: str, baud: int, read_timeout_s: float | None = None) -> serial.Serial:
    """Open a port exclusively; DeviceError if it is absent, in use, or not permitted.

    DTR and RTS are unchanged, also when the port is closed: by default the system would drop DTR then, which starts the
    motor of an RPLIDAR A1. (Linux itself raises them when it opens a port.) `read_timeout_s` None waits forever.
    """
    try:
        opened = _UntouchedLines(port, baud, exclusive=True, timeout=read_timeout_s, write_timeout=_WRITE_S)
        _keep_lines_on_close(opened.fileno())
        return opened
    except (OSError, ValueError, termios.error) as error:  # pyserial's own are OSErrors
        raise DeviceError(_why_not_opened(port, error)) from error


def _keep_lines_on_close(fd: int) -> None:
    modes = termios.tcgetattr(fd)
    modes[2] &= ~termios.HUPCL
    termios.tcsetattr(fd, termios.TCSANOW, modes)


def latency_timer(port: str) -> Path | None:
    """Return the file with the latency timer [ms] of a USB adapter; None for a port without one."""
    file = _ADAPTERS / Path(port).resolve().name / "latency_timer"
    return file if file.is_file() else None


def latency_ms(port: str) -> int:
    """Return the latency of a USB adapter [ms]; 0 for a port without a latency timer."""
    timer = latency_timer(port)
    try:
        return 0 if timer is None else int(timer.read_text())
    except (OSError, ValueError):
        return 0


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
