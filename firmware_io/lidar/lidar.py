"""Interface of all lidar drivers; `families` lists the implementations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Literal, Protocol, Self

from scanwright.firmware_io.samples import Scan

StampAt = Literal["step_0", "rear", "first_beam", "last_beam"]
Echo = Literal["first", "last"]


@dataclass(frozen=True, slots=True, eq=False)
class TimedScan:
    """One turn of the mirror, with times of `time.monotonic_ns`."""

    scan: Scan  # with bearings and times of each beam if the sensor's speed varies
    arrival_ns: int  # of its last byte
    uncertainty_ns: int  # standard uncertainty of its time
    warning: str = ""  # reported fault and its remedy


class LidarDriver(Protocol):
    """An open lidar, its laser off if that is possible. `with` stops it and closes its port.

    All failures raise DeviceError; DeviceTimeoutError if nothing arrives in time. Broken packets are only counted.
    After an error of `read`, call `reconnect`.

    Attributes:
        address: last known serial port, or HOST:PORT.
        model: catalogue name; the requested one if the sensor does not report its model.
        serial_number: used to identify it after a reconnection; empty if unreported.
        firmware: version as reported; empty if unreported.
        scan_rate_hz: nominal turns per second.
        dropped: missing turns between those read.
        bad_packets: packets dropped.
    """

    address: str
    serial_number: str
    firmware: str

    @property
    def model(self) -> str: ...  # noqa: D102

    @property
    def scan_rate_hz(self) -> float: ...  # noqa: D102

    @property
    def dropped(self) -> int: ...  # noqa: D102

    @property
    def bad_packets(self) -> int: ...  # noqa: D102

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def condition(self) -> tuple[str, ...]:
        """Return the reported age and state, one line each; call before `start` only."""
        ...

    def set_filters(self, echo: Echo | None, *, mean_filter_off: bool) -> None:
        """Set filters of the sensor at the next `start`, until its power is switched off; call before `start`.

        Args:
            echo: echo that a beam reports; None leaves it unchanged.
            mean_filter_off: do not average several scans.

        Raises:
            DeviceError: the sensor has no such filter.
        """
        ...

    def start(self, *, intensity: bool = False, cluster: int = 1, skip: int = 0) -> None:
        """Scan until `stop`; DeviceError if the sensor rejects or does not support that.

        Args:
            intensity: measure it too.
            cluster: beams that share one value, the smallest range among them.
            skip: turns to skip after each returned one.
        """
        ...

    def read(self, timeout_s: float | None = None) -> TimedScan:
        """Return the next turn; the default timeout is the longest time that this sensor needs."""
        ...

    def stop(self) -> None:
        """Switch the laser off, or if that is impossible, stop reading."""
        ...

    def reconnect(self, timeout_s: float = 3.0) -> None:
        """Find the sensor again after an unplug or a reset, and continue to scan with a new clock."""
        ...


@dataclass(frozen=True, slots=True)
class LidarFamily:
    """Lidars with one protocol.

    Attributes:
        name: value of `family` in the catalogue.
        title: maker and protocol, for messages.
        open: (address, catalogue name or None for any, beam of its timestamps or None) -> driver; DeviceError if no
            lidar of this family answers.
        emulator: "package.module:function" with arguments (catalogue record, `emulators.lidar_line.Ranging`, seed)
            that returns an `emulators.lidar_line.LidarLine`; drivers import no emulators.
        stamp_choices: accepted values of `stamp_at`, if documents differ.
    """

    name: str
    title: str
    open: Callable[[str, str | None, StampAt | None], LidarDriver]
    emulator: str
    stamp_choices: tuple[StampAt, ...] = ()
