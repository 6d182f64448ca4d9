"""Servo thread of a scan: gives its orders and reads its angle a hundred times a second, at uneven times.

At even times an axis can turn nearly whole encoder steps between reads (an AX-12A at 30 deg/s): all readings are then
rounded alike, which no smoothing removes. Uneven times average it out. Failures raise DeviceError.
"""

from __future__ import annotations

import math
import random
import time
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from threading import Event, Thread

import numpy as np

from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from scanwright.design.motion import Motion
from scanwright.firmware_io.samples import Scan
from scanwright.firmware_io.scan.setpoints import Move, course
from scanwright.firmware_io.servo.progress import ServoState
from scanwright.firmware_io.servo.servo import ServoDriver

SERVO_HZ = 100.0  # an angle every 0.6 deg at 60 deg/s

_STOP_ANSWER_S = 5.0  # three tries of two orders take 1.5 s
_DEAF_S = 0.5  # as long as answers may fail; angles are interpolated over less than that
_WINDOW = 50  # samples: half a second
_STILL_RAD = math.radians(0.2)  # two steps of the encoder
_UNCERTAIN_STEPS = 0.6  # of the encoder; up to it an angle of uncertain time is about as good as any other
_GAP_NS = 1_000_000_000  # beyond it a doubtful angle beats none
_GAP_BOUNDS = 4  # unless its time is as uncertain as the gap is long: one transaction in which this process was stopped


class AxisThread:
    """What the servo's thread is told and tells, and what is made of it here.

    Attributes:
        begins_ns: when the motion proper begins; before it the axis is on its way to the start.
        orders: courses for the thread, None if the axis shall stand.
        stop_answers: from the thread, whether the servo answered the order to stand; False from one that has failed.
    """

    def __init__(self, motion: Motion, start_rad: float, step_rad: float) -> None:
        self.orders: SimpleQueue[Iterator[Move] | None] = SimpleQueue()
        self.received: SimpleQueue[ServoState | Exception] = SimpleQueue()  # states and errors from the thread
        self.window: deque[ServoState] = deque(maxlen=_WINDOW)  # the good angles of the last half second
        self.left_out: Counter[str] = Counter()  # angles that are not recorded, reason -> count
        self.longest_gap_ns = 0  # between two good angles
        self._bounds_ns: deque[int] = deque(maxlen=2 * _WINDOW)
        self._unread: list[ServoState] = []  # heard by `go`, for the next who hears
        self._failure: Exception | None = None
        self._motion = motion
        self._uncertain_rad = _UNCERTAIN_STEPS * step_rad
        self.stop_answers: SimpleQueue[bool] = SimpleQueue()
        self._order(start_rad)

    def stop(self) -> bool:
        """Stand, with torque on, until `go`; whether the servo has answered that it was told so."""
        self.orders.put(None)
        try:
            return self.stop_answers.get(timeout=_STOP_ANSWER_S)
        except Empty:
            return False

    def go(self) -> None:
        """Make the motion anew from where the axis stands; `begins_ns` tells when it begins."""
        self._unread = self.hear()
        self._order(self.window[-1].position_rad if self.window else 0.0)

    def _order(self, from_rad: float) -> None:
        lead_s, moves = course(self._motion, from_rad)
        self.begins_ns = time.monotonic_ns() + round(lead_s * 1e9)
        self.orders.put(moves)

    def hear(self) -> list[ServoState]:
        """Return what is new and fit to be recorded."""
        good, self._unread = self._unread, []
        while not self.received.empty() and self._failure is None:
            state = self.received.get()
            if isinstance(state, Exception):
                self._failure = state
                break
            self._bounds_ns.append(state.time_bound_ns)
            if math.isnan(state.position_rad):
                self.left_out["servo angles in the dead sector"] += 1
            elif (  # where the axis turns back it is slow, and no angle is in doubt
                state.time_bound_ns > 2 * sorted(self._bounds_ns)[len(self._bounds_ns) // 10]
                and abs(state.velocity_rad_s) * state.time_bound_ns > self._uncertain_rad * 1e9
                and self.window
                and state.time_ns - self.window[-1].time_ns < max(_GAP_NS, _GAP_BOUNDS * state.time_bound_ns)
            ):
                self.left_out["servo angles with uncertain timestamp"] += 1  # the host was busy during the transaction
            else:
                if self.window:
                    self.longest_gap_ns = max(self.longest_gap_ns, state.time_ns - self.window[-1].time_ns)
                self.window.append(state)
                good.append(state)
        if self._failure is not None and not good:
            raise self._failure
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
def turning_servo(servo: ServoDriver, motion: Motion) -> Iterator[AxisThread]:
    """The servo makes its motion, and is asked where it is, during the body."""
    start_rad = servo.read().position_rad
    if math.isnan(start_rad):
        raise DeviceError(
            f"{servo}: it is in its dead sector and reports no angle: turn the head to the front manually"
        )
    axis, done = AxisThread(motion, start_rad, servo.step_rad), Event()
    thread = Thread(target=_follow, args=(servo, axis, done), name="servo", daemon=True)
    thread.start()
    try:
        yield axis
    finally:
        done.set()
        _join(thread)


def _join(thread: Thread) -> None:
    """Wait for the end of the thread, also where Ctrl-C comes again: it might turn a servo that was just stopped."""
    again: KeyboardInterrupt | None = None
    while thread.is_alive():
        try:
            thread.join()
        except KeyboardInterrupt as interrupt:
            again = interrupt
    if again is not None:
        raise again


def _follow(servo: ServoDriver, axis: AxisThread, done: Event) -> None:
    """The servo's thread: give each order at its time, ask for the state at `SERVO_HZ`, tell what goes wrong."""
    began_s = due_s = answered_s = time.monotonic()
    moves: Iterator[Move] = iter(())
    move, to_hold = None, False
    try:
        while not done.wait(max(due_s - time.monotonic(), 0)):
            now_s = time.monotonic()
            due_s = max(due_s + random.uniform(0.5, 1.5) / SERVO_HZ, now_s)
            if not axis.orders.empty():
                ordered = axis.orders.get()
                to_hold = ordered is None
                began_s, moves = now_s, iter(()) if ordered is None else ordered
                move = next(moves, None)
            try:  # an order that was not answered is given again
                if to_hold:
                    servo.hold()
                    to_hold = False
                    axis.stop_answers.put(True)
                if move is not None and now_s - began_s >= move.at_s:
                    if math.isinf(move.goal_rad):
                        servo.spin(move.rate_rad_s)
                    else:
                        servo.sweep_to(move.goal_rad, move.rate_rad_s)
                    move = next(moves, None)
                axis.received.put(servo.read())
                answered_s = now_s
            except (DeviceTimeoutError, ProtocolError):
                if now_s - answered_s > _DEAF_S:
                    raise
    except Exception as error:  # whatever it is, the thread that waits for it raises it
        axis.received.put(error)
        axis.stop_answers.put(False)
