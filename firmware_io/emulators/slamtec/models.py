"""Models of RPLIDAR: identity, baud rate, motor and scan modes.

Sources: GET_LIDAR_CONF in sl_lidar_cmd.h of rplidar_sdk 2.1; the modes that rplidar_ros prints for real sensors (issues
68 and 84 of robopeak/rplidar_ros, 48, 150 and 155 of Slamtec/rplidar_ros), and another program for an S1. Undocumented
values are marked [assumed].
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Literal

STANDARD, EXPRESS, ULTRA, DENSE, ULTRA_DENSE = 0x81, 0x82, 0x84, 0x85, 0x86  # types of packets

_COUNT, _SAMPLE_US, _MAX_DISTANCE, _ANSWER, _TYPICAL, _NAME = 0x70, 0x71, 0x74, 0x75, 0x7C, 0x7F  # keys of GET_CONF
_DESIRED_SPEED = 0x01  # key of GET_CONF
_RPM, _PWM = 600, 660  # [assumed]: the SDK's defaults


@dataclass(frozen=True, slots=True)
class ScanMode:
    """One of its modes."""

    name: str  # as the sensor states it
    kind: int  # type of its packets
    point_us: float  # time between two points
    range_m: float  # longest range


@dataclass(frozen=True, slots=True)
class SlamtecIdentity:
    """A model."""

    model: int  # byte of INFO; its upper half is the series
    baud: int
    motor: Literal["scan", "pwm", "rpm"]  # started by a scan, the duty cycle of an accessory board, or a speed command
    modes: tuple[ScanMode, ...]  # by number; empty for firmware before 1.24, without GET_CONF
    typical: int  # number of the mode that the maker's programs choose
    legacy: ScanMode  # mode of EXPRESS_SCAN with number 0
    firmware: tuple[int, int] = (1, 29)  # major and minor version

    @property
    def usual(self) -> ScanMode:
        """The mode that the maker's programs choose."""
        return self.modes[self.typical] if self.modes else self.legacy

    def configuration(self, payload: bytes) -> bytes | None:
        """Return the reply to GET_CONF; None for an unsupported entry."""
        key, number = int.from_bytes(payload[:4], "little"), int.from_bytes(payload[4:6], "little")
        mode = self.modes[number] if number < len(self.modes) else None
        if not self.modes or (mode is None and key in (_SAMPLE_US, _MAX_DISTANCE, _ANSWER, _NAME)):
            return None
        values = {
            _COUNT: struct.pack("<H", len(self.modes)),
            _TYPICAL: struct.pack("<H", self.typical),
            _DESIRED_SPEED: struct.pack("<HH", _RPM, _PWM),
        }
        if mode is not None:
            values |= {
                _SAMPLE_US: struct.pack("<I", round(mode.point_us * 256)),
                _MAX_DISTANCE: struct.pack("<I", round(mode.range_m * 256)),
                _ANSWER: bytes([mode.kind]),
                _NAME: mode.name.encode() + b"\0",
            }
        return payload[:4] + values[key] if key in values else None


def _triangulating(point_us: float, range_m: float) -> tuple[ScanMode, ...]:
    """Return the five modes of the A series, of which Boost and Sensitivity measure every `point_us`."""
    return (
        ScanMode("Standard", STANDARD, 4 * point_us, range_m),
        ScanMode("Express", EXPRESS, 2 * point_us, range_m),
        ScanMode("Boost", ULTRA, point_us, range_m),
        ScanMode("Sensitivity", ULTRA, point_us, range_m),
        ScanMode("Stability", ULTRA, 1.6 * point_us, range_m),
    )


_A1, _A2, _A3 = _triangulating(127.0, 12.0), _triangulating(63.0, 12.0), _triangulating(63.0, 25.0)
_S1 = ScanMode("Standard", STANDARD, 244.0, 40.0), ScanMode("DenseBoost", DENSE, 108.0, 40.0)
_S1_EXPRESS = ScanMode("Express", EXPRESS, 108.0, 40.0)
_S2 = ScanMode("Standard", STANDARD, 125.0, 30.0), ScanMode("DenseBoost", DENSE, 31.25, 30.0)
_S2L = ScanMode("Standard", STANDARD, 125.0, 18.0), ScanMode("DenseBoost", DENSE, 31.25, 18.0)  # as the S2 [assumed]
_S3 = ScanMode("Standard", STANDARD, 62.5, 16.0), ScanMode("DenseBoost", ULTRA_DENSE, 31.25, 40.0)  # 0x86 [assumed]
_C1 = ScanMode("Standard", STANDARD, 200.0, 16.0), ScanMode("DenseBoost", DENSE, 200.0, 16.0)

IDENTITIES = {
    "RPLIDAR A1": SlamtecIdentity(0x18, 115_200, "scan", _A1, 3, _A1[1]),
    "RPLIDAR A2": SlamtecIdentity(0x2C, 256_000, "pwm", _A2, 3, _A2[1]),
    "RPLIDAR A3": SlamtecIdentity(0x31, 256_000, "pwm", _A3, 3, _A3[1]),
    "RPLIDAR S1": SlamtecIdentity(0x61, 256_000, "rpm", _S1, 1, _S1_EXPRESS, (1, 28)),
    "RPLIDAR S2": SlamtecIdentity(0x71, 1_000_000, "rpm", _S2, 1, _S2[0]),
    "RPLIDAR S2L": SlamtecIdentity(0x71, 1_000_000, "rpm", _S2L, 1, _S2L[0]),  # model of the S2 [assumed]
    "RPLIDAR S3": SlamtecIdentity(0x81, 1_000_000, "rpm", _S3, 1, _S3[0], (1, 2)),
    "RPLIDAR C1": SlamtecIdentity(0x41, 460_800, "scan", _C1, 0, _C1[0]),  # 4 for its series [assumed]
}
