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
    """One turn as it was measured, on the host's clock.

    Attributes:
        scan: its times are those of `time.monotonic_ns`; bearings and times of its own beams where the sensor's speed
            wanders.
        arrival_ns: `time.monotonic_ns` when its last byte came.
        uncertainty_ns: standard uncertainty of its time.
        warning: what the sensor says of itself that a person should mend, and how; empty if all is well.
    """

    scan: Scan
    arrival_ns: int
    uncertainty_ns: int
    warning: str = ""


class LidarDriver(Protocol):
    """A lidar, opened, its laser off if it can be put out. `with` leaves it stopped and its port closed.

    Whatever goes wrong is a DeviceError: DeviceTimeoutError where nothing came in time. A broken packet is counted and
    passed over, never raised. After an error of `read`, `reconnect` is what may help.

    Attributes:
        address: where it was found last: a serial port, or HOST:PORT.
        model: name of its type, as in the catalogue. A sensor that does not tell is what it was opened as.
        serial_number: by which it is found again; empty if the sensor tells none.
        firmware: version, as the sensor writes it; empty if it tells none.
        scan_rate_hz: turns per second that it should make.
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
        """Return what it reports of its age and state, one line each; call before `start` only."""
        ...

    def set_filters(self, echo: Echo | None, *, mean_filter_off: bool) -> None:
        """Set filters of the sensor at the next `start`, until its power is switched off; call before `start`.

        Args:
            echo: echo that a beam reports; None leaves it as it is.
            mean_filter_off: do not average several scans.

        Raises:
            DeviceError: the sensor has no such filter.
        """
        ...

    def start(self, *, intensity: bool = False, cluster: int = 1, skip: int = 0) -> None:
        """Scan until `stop`; a DeviceError if it refuses or cannot do that.

        Args:
            intensity: measure it too.
            cluster: beams that share one value, the least range among them.
            skip: turns to leave out between two.
        """
        ...

    def read(self, timeout_s: float | None = None) -> TimedScan:
        """Return the next turn; without a time it is waited for as long as this sensor may take."""
        ...

    def stop(self) -> None:
        """Laser off, or if a sensor cannot do that: listen no more."""
        ...

    def reconnect(self, timeout_s: float = 3.0) -> None:
        """Find the sensor again after an unplug or a reset, and scan on if it did; its clock is learnt anew."""
        ...


@dataclass(frozen=True, slots=True)
class LidarFamily:
    """Lidars that speak one protocol. A product of the catalogue says `family` to be driven by one.

    Attributes:
        name: as in the catalogue's `family`.
        title: maker and protocol, in words.
        open: address, name of the model (None: whatever answers), beam of its timestamps (None: default) -> the lidar;
            DeviceError if none of this family answers there.
        emulator: "package.module:function" that makes an emulated device of (catalogue record,
            `emulators.lidar_line.Ranging`, seed) -> `emulators.lidar_line.LidarLine`; drivers import no emulators.
        stamp_choices: values of `stamp_at` that it accepts, if documents differ.
    """

    name: str
    title: str
    open: Callable[[str, str | None, StampAt | None], LidarDriver]
    emulator: str
    stamp_choices: tuple[StampAt, ...] = ()
