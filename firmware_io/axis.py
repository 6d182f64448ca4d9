"""The servo's side of a scan: a thread that gives its orders and asks, a hundred times a second, where it is."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Event, Thread

import numpy as np

from design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from design.motion import Motion
from firmware_io.course import Move, course
from firmware_io.samples import Scan
from firmware_io.servo import Servo, ServoState

SERVO_HZ = 100.0

_DEAF_S = 0.5  # as long as answers may fail; angles are interpolated over less than that
_WINDOW = 50  # samples: half a second
_STILL_RAD = math.radians(0.2)  # two steps of the encoder
_DOUBT_RAD = math.radians(0.05)  # below it an angle of uncertain time is as good as the encoder's step
_GAP_NS = 1_000_000_000  # beyond it a doubtful angle beats none


class Axis:
    """What the servo's thread tells, and what is made of it here."""

    def __init__(self, begins_ns: int) -> None:
        self.begins_ns = begins_ns
        self.told: SimpleQueue[ServoState | Exception] = SimpleQueue()
        self.window: deque[ServoState] = deque(maxlen=_WINDOW)
        self._bounds_ns: deque[int] = deque(maxlen=2 * _WINDOW)
        self.left_out: Counter[str] = Counter()

    def hear(self) -> list[ServoState]:
        """What is new and fit to be recorded.

        Raises:
            DeviceError: the servo failed.
        """
        good = []
        while not self.told.empty():
            state = self.told.get()
            if isinstance(state, Exception):
                raise state
            self._bounds_ns.append(state.time_bound_ns)
            if math.isnan(state.position_rad):
                self.left_out["servo angles in the dead sector"] += 1
            elif (  # where the axis turns back it is slow, and no angle is in doubt
                state.time_bound_ns > 2 * sorted(self._bounds_ns)[len(self._bounds_ns) // 10]
                and abs(state.velocity_rad_s) * state.time_bound_ns > _DOUBT_RAD * 1e9
                and self.window
                and state.time_ns - self.window[-1].time_ns < _GAP_NS
            ):
                self.left_out["servo angles of uncertain time"] += 1  # the host was busy during the transaction
            else:
                self.window.append(state)
                good.append(state)
        return good

    def moved(self, scan: Scan) -> bool:
        """Whether the axis turned while a scan was taken, from the angle before it to the angle after it."""
        first_ns, last_ns = scan.stamp_ns, int(scan.time_ns[-1])
        before = [state.position_rad for state in self.window if state.time_ns <= first_ns][-1:]
        during = [state.position_rad for state in self.window if first_ns < state.time_ns < last_ns]
        after = [state.position_rad for state in self.window if state.time_ns >= last_ns][:1]
        return not (before and after) or np.ptp(before + during + after) > _STILL_RAD

    def turning(self) -> tuple[float, float]:
        """Speed [deg/s] over the window, and the rms deviation from even turning [deg]."""
        if len(self.window) < _WINDOW:
            return math.nan, math.nan
        time_s = np.array([state.time_ns - self.window[0].time_ns for state in self.window]) / 1e9
        angle_deg = np.degrees([state.position_rad for state in self.window])
        speed, start = np.polyfit(time_s, angle_deg, 1)
        return float(speed), float(np.std(angle_deg - start - speed * time_s))


@contextmanager
def turning_servo(servo: Servo, motion: Motion) -> Iterator[Axis]:
    """The servo makes its motion, and is asked where it is, while the body runs.

    Raises:
        DeviceError: it stands where it cannot tell its angle.
    """
    stands_rad = servo.read().position_rad
    if math.isnan(stands_rad):
        raise DeviceError(
            f"{servo}: it stands in its dead sector and knows no angle: turn the head to the front by hand"
        )
    lead_s, moves = course(motion, stands_rad)
    axis, done = Axis(time.monotonic_ns() + round(lead_s * 1e9)), Event()
    thread = Thread(target=_follow, args=(servo, moves, axis.told, done), name="servo", daemon=True)
    thread.start()
    try:
        yield axis
    finally:
        done.set()
        thread.join()


def _follow(servo: Servo, moves: Iterator[Move], told: SimpleQueue[ServoState | Exception], done: Event) -> None:
    """The servo's thread: give each order at its time, ask for the state at `SERVO_HZ`, tell what goes wrong."""
    began_s = due_s = heard_s = time.monotonic()
    move = next(moves, None)
    try:
        while not done.wait(max(due_s - time.monotonic(), 0)):
            now_s = time.monotonic()
            due_s = max(due_s + 1 / SERVO_HZ, now_s)
            if move is not None and now_s - began_s >= move.at_s:
                if math.isinf(move.goal_rad):
                    servo.spin(move.rate_rad_s)
                else:
                    servo.sweep_to(move.goal_rad, move.rate_rad_s)
                move = next(moves, None)
            try:
                told.put(servo.read())
                heard_s = now_s
            except (DeviceTimeoutError, ProtocolError):
                if now_s - heard_s > _DEAF_S:
                    raise
    except Exception as error:  # whatever it is, the thread that waits for it raises it
        told.put(error)
