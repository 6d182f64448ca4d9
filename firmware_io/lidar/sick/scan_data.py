"""LMDscandata, the telegram of a scan: channels, encoders, times and state of the sensor.

Layout: SICK TiM5xx technical information 8015883; LMS4000 manual 8023198 for CoLa B. Fields after the 8-bit channels
(position, name, comment, time of day, event) are not read. Invalid bytes raise ProtocolError.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from scanwright.design.errors import ProtocolError
from scanwright.firmware_io.lidar.sick.cola import Telegram, Writer
from scanwright.firmware_io.lidar.sick.values import Reader

WRAP_US = 1 << 32  # 32 bits
_ANGLE_UNIT_DEG = 1e-4  # telegram listing: angles in 1/10,000 deg
_FRONT_DEG = 90.0  # the sensor's angle of straight ahead
_MOST_CHANNELS = 16  # more are damage: no sensor has half of them
_MOST_ENCODERS = 4  # more are damage
_NAME = 5  # bytes of a channel's name, such as DIST1

DIRT_WARNING = 0x02  # bit of the device status
FAULT = 0x01  # bit of the device status
DIRT = 0x04  # bit of the device status


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """One number per beam."""

    name: str  # DIST1: range of the first echo, RSSI1: its intensity
    scale: float  # of the numbers; mm for DIST
    offset: float  # added to the scaled numbers
    start: int  # angle of the first beam, 1e-4 deg, 90 deg straight ahead, counter-clockwise from above
    step: int  # between two beams, 1e-4 deg
    raw: ndarray  # unscaled, shape (n,)

    @property
    def bearing_deg(self) -> tuple[float, float]:
        """Bearing of the first beam, 0 straight ahead, and step between two beams."""
        return self.start * _ANGLE_UNIT_DEG - _FRONT_DEG, self.step * _ANGLE_UNIT_DEG

    def range_m(self) -> Float32[ndarray, " n"]:
        """Return the ranges of a DIST channel, NaN without a return (0), shape (n,)."""
        range_mm = self.raw * self.scale + self.offset
        return np.where(self.raw == 0, np.nan, range_mm / 1e3).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class ScanData:
    """One scan as sent."""

    serial_number: int
    status: int  # second byte of its state: bits FAULT, DIRT_WARNING, DIRT (with FAULT)
    telegram_count: int  # 16 bits
    scan_count: int  # turns, 16 bits
    scan_us: int  # time of the scan since power-up, 32 bits
    sent_us: int  # time of sending since power-up, 32 bits
    layer: int  # angle of the scan plane, 1/200 deg or a unit of the model; 0 for one plane
    scan_rate_hz: float  # turns per second
    measuring_rate_hz: float  # beams per second of a full circle
    encoders: tuple[tuple[int, int], ...]  # position and speed of each
    wide: tuple[Channel, ...]  # channels of 16 bits
    narrow: tuple[Channel, ...]  # channels of 8 bits

    def channel(self, name: str) -> Channel | None:
        """Return a channel by its name."""
        return next((channel for channel in (*self.wide, *self.narrow) if channel.name == name), None)

    @property
    def beam_us(self) -> float:
        """Time between two beams of the first channel."""
        return self.wide[0].step * _ANGLE_UNIT_DEG / 360 / self.scan_rate_hz * 1e6

    @property
    def sent_after_us(self) -> float:
        """Time from the scan to the sending of the telegram."""
        return (self.sent_us - self.scan_us) % WRAP_US


def scan_data(telegram: Telegram) -> ScanData:
    """Decode an sSN or sRA LMDscandata."""
    if telegram.word not in (b"sSN", b"sRA") or telegram.name != b"LMDscandata":
        raise ProtocolError("no LMDscandata")
    values = telegram.values()
    values.numbers("u16", 2)  # version, device
    serial_number = values.number("u32")
    _, status = values.numbers("u8", 2)
    telegram_count, scan_count = values.numbers("u16", 2)
    scan_us, sent_us = values.numbers("u32", 2)
    values.numbers("u8", 4)  # inputs, outputs
    layer = values.number("i16")
    scan_rate_hz, measuring_rate_hz = values.number("u32") / 100, values.number("u32") * 100
    if not 0.1 <= scan_rate_hz <= 1e4:
        raise ProtocolError(f"a scan rate of {scan_rate_hz:g} Hz")
    encoders = tuple(
        (values.number("u32"), values.number("u16")) for _ in range(_count(values, _MOST_ENCODERS, "encoders"))
    )
    wide = tuple(_channel(values, "u16") for _ in range(_count(values, _MOST_CHANNELS, "channels")))
    narrow = tuple(_channel(values, "u8") for _ in range(_count(values, _MOST_CHANNELS, "channels of 8 bits")))
    if not wide:
        raise ProtocolError("a scan without ranges")
    return ScanData(
        serial_number, status, telegram_count, scan_count, scan_us, sent_us, layer, scan_rate_hz,
        measuring_rate_hz, encoders, wide, narrow,
    )  # fmt: skip


def telegram_of(scan: ScanData, *, binary: bool) -> Telegram:
    """Encode a scan; raises ValueError if a number does not fit."""
    out = Writer("sSN LMDscandata", binary=binary).numbers("u16", [1, 1]).number("u32", scan.serial_number)
    out.numbers("u8", [0, scan.status]).numbers("u16", [scan.telegram_count, scan.scan_count])
    out.numbers("u32", [scan.scan_us, scan.sent_us]).numbers("u8", [0, 0, 0, 0]).number("i16", scan.layer)
    out.numbers("u32", [round(scan.scan_rate_hz * 100), round(scan.measuring_rate_hz / 100)])
    out.number("u16", len(scan.encoders))
    for position, speed in scan.encoders:
        out.number("u32", position).number("u16", speed)
    for kind, channels in (("u16", scan.wide), ("u8", scan.narrow)):
        out.number("u16", len(channels))
        for channel in channels:
            out.name(channel.name).number("f32", channel.scale).number("f32", channel.offset)
            out.number("i32", channel.start).numbers("u16", [channel.step, channel.raw.size])
            out.numbers("u16" if kind == "u16" else "u8", channel.raw.tolist())
    return out.numbers("u16", [0, 0, 0, 0, 0]).telegram()


def _count(values: Reader, most: int, what: str) -> int:
    count = values.number("u16")
    if count > most:
        raise ProtocolError(f"{count} {what}: at most {most}")
    return count


def _channel(values: Reader, kind: str) -> Channel:
    name = values.name(_NAME)
    scale, offset = values.real(), values.real()
    start, step, count = values.number("i32"), values.number("u16"), values.number("u16")
    if not step > 0 or not abs(start) <= 7_200_000:
        raise ProtocolError(f"{name}: angles of {start} and {step} ten-thousandths of a degree")
    if not count:
        raise ProtocolError(f"{name}: no beams")
    wide = kind == "u16"
    raw = np.array(values.numbers("u16" if wide else "u8", count), np.uint16 if wide else np.uint8)
    return Channel(name, scale, offset, start, step, raw)
