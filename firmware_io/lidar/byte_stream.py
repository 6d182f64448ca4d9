"""Byte streams to a sensor, over a serial port or TCP; OSError if the connection breaks."""

from __future__ import annotations

import contextlib
import fcntl
import select
import socket
import struct
import termios

from scanwright.design.errors import DeviceError
from scanwright.firmware_io.capture import captured
from scanwright.firmware_io.serial_port import open_serial_port

FIRST_BAUD = 115_200  # until a driver sets its own


class SerialStream:
    """A serial port, with or without USB."""

    def __init__(self, port: str) -> None:
        self._port = open_serial_port(port, FIRST_BAUD)
        with contextlib.suppress(OSError, ValueError, AttributeError, NotImplementedError):  # unsupported by drivers
            self._port.set_low_latency_mode(True)  # otherwise an FTDI adapter collects bytes for 16 ms
        self._port.reset_input_buffer()

    @property
    def baud(self) -> int:
        """Baud rate; USB and pseudo-terminals ignore it."""
        return self._port.baudrate

    @baud.setter
    def baud(self, baud: int) -> None:
        self._port.baudrate = baud
        self._port.reset_input_buffer()

    def set_dtr(self, up: bool) -> None:
        """Raise or lower DTR, if the port has that line."""
        with contextlib.suppress(OSError):
            request = termios.TIOCMBIS if up else termios.TIOCMBIC
            fcntl.ioctl(self._port.fileno(), request, struct.pack("I", termios.TIOCM_DTR))

    def can(self, baud: int) -> bool:
        """Whether the port supports a baud rate; the present one is restored."""
        usual = self._port.baudrate
        try:
            self._port.baudrate = baud
        except (OSError, ValueError):
            return False
        finally:
            self._port.baudrate = usual
        return True

    def read(self, timeout_s: float) -> bytes:
        """Return all received bytes, at least one; none after the timeout."""
        self._port.timeout = max(timeout_s, 0.0)
        first = self._port.read(1)
        return first + self._port.read(self._port.in_waiting) if first else b""

    def write(self, data: bytes) -> None:
        """Send all bytes."""
        self._port.write(data)

    def close(self) -> None:
        """Close the port."""
        self._port.close()


class SocketStream:
    """A TCP connection."""

    def __init__(self, host: str, port: int) -> None:
        self._address = f"{host}:{port}"
        self._socket = socket.create_connection((host, port), timeout=2.0)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def read(self, timeout_s: float) -> bytes:
        """Return all received bytes, at least one; none after the timeout."""
        if not select.select([self._socket], [], [], max(timeout_s, 0.0))[0]:
            return b""
        received = self._socket.recv(1 << 16)
        if not received:
            raise ConnectionError("the sensor closed the connection")
        return captured(self._address, "<", received)

    def write(self, data: bytes) -> None:
        """Send all bytes."""
        self._socket.sendall(captured(self._address, ">", data))

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


Stream = SerialStream | SocketStream


def open_stream(address: str) -> Stream:
    """Open "/dev/ttyACM0" or "192.168.0.10:10940".

    Raises:
        DeviceError: the port or host does not exist or is in use.
    """
    host, colon, port = address.rpartition(":")
    if not (colon and port.isdigit()):
        return SerialStream(address)
    try:
        return SocketStream(host, int(port))
    except (OSError, ValueError, OverflowError) as error:
        why = "no answer in 2 s" if isinstance(error, TimeoutError) else getattr(error, "strerror", None) or error
        raise DeviceError(f"{address}: cannot connect: {why}: check address, cable and power") from error
