"""Check by the gyros of a bag whether the platform moved."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from scanwright.design.arrays import Floats, Times
from scanwright.design.findings import Finding
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.bags import Bag
from scanwright.firmware_io.recording.import_checks.headers import AT_M

_BIAS_RAD_S = math.radians(2.0)  # above that of any MEMS gyro
_LEAST_RAD, _DRIFT_RAD_S = math.radians(2.0), math.radians(0.05)  # after the bias is removed
_LONG_GAP = 5.0  # times the median gap between two rates
_FEWEST = 20  # rates
_ON_AXIS = (0.9, 1.1)  # turns of an IMU that rides on the axis, per turn of it


def imu_findings(bag: Bag, angle_ns: Times, position_rad: Floats) -> Iterator[Finding]:
    """Report IMUs that turned otherwise than the axis; `angle_ns`: receive times."""
    topics = {topic for topic, kind in bag.topics.items() if kind == ros_messages.IMU}
    rows: dict[str, list[tuple[int, float, float, float]]] = {topic: [] for topic in topics}
    for message in bag.messages(topics) if topics else ():
        rate = message.body.angular_velocity
        rows[message.topic].append((message.receive_ns, rate.x, rate.y, rate.z))
    order = np.argsort(angle_ns, kind="stable")
    for topic, samples in rows.items():
        table = np.array([row for row in samples if np.isfinite(row).all()], dtype=float)
        if len(table) < _FEWEST:
            continue
        turned_rad, seconds = _turned_rad(table, angle_ns[order], position_rad[order])
        if turned_rad > _LEAST_RAD + _DRIFT_RAD_S * seconds:
            cost_mm = 2000 * AT_M * math.sin(min(turned_rad, math.pi) / 2)
            text = f"{topic}: by its gyro it turned by {math.degrees(turned_rad):.0f} deg, and not with the axis: "
            cost = f"the platform moved, and points are up to {cost_mm:,.0f} mm off at {AT_M:g} m"
            hint = "record again with the base at rest, or give `assemble` the poses of the base"
            yield Finding("platform_moved", "warning", topic, text + cost, cost_mm, unit="mm", hint=hint)


def _turned_rad(rates: Floats, angle_ns: Times, position_rad: Floats) -> tuple[float, float]:
    """Return the largest rotation besides that of the axis, and the time [s] in common.

    `rates`: time [ns] and rate [rad/s] about three axes, shape (n, 4); `angle_ns`, `position_rad`: of the axis, shape
    (m,).
    """
    inside = (rates[:, 0] >= angle_ns[0]) & (rates[:, 0] <= angle_ns[-1])
    time_s, rate = (rates[inside, 0] - float(angle_ns[0])) / 1e9, rates[inside, 1:]
    if time_s.size < _FEWEST:
        return 0.0, 0.0
    step_s = np.diff(time_s)
    step_s = np.minimum(step_s, _LONG_GAP * np.median(step_s))
    axis = np.interp(time_s[1:], (angle_ns - angle_ns[0]) / 1e9, position_rad)
    turned = np.cumsum(rate[1:] * step_s[:, None], axis=0)
    of_axis = np.stack([axis, time_s[1:], np.ones_like(axis)], axis=1)
    fit = np.linalg.lstsq(of_axis, turned, rcond=None)[0]
    if _ON_AXIS[0] < np.linalg.norm(fit[0]) < _ON_AXIS[1]:
        turned = turned - of_axis @ fit
    else:
        bias = np.clip(np.median(rate, axis=0), -_BIAS_RAD_S, _BIAS_RAD_S)
        turned = turned - np.cumsum(step_s)[:, None] * bias
    return float(np.linalg.norm(turned - turned[0], axis=1).max()), float(time_s[-1] - time_s[0])
