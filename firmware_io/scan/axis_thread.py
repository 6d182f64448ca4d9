"""Servo thread of a scan: commands the motion and reads the angle a hundred times a second, at uneven times.

Beams are de-skewed with the measured angle, so the servo only approximates the motion: it moves from goal to goal at a
rate, with the ramps of its control loop.

At even times an axis can turn nearly integer encoder steps between reads (an AX-12A at 30 deg/s): all readings then
have the same rounding error, which no smoothing removes. Uneven times average it out. Failures raise DeviceError.
"""

from __future__ import annotations

import math
import random
import time
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import cycle
from queue import Empty, SimpleQueue
from threading import Event, Thread

import numpy as np

from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from scanwright.design.motion import Motion, Spin, Sweep
from scanwright.firmware_io.samples import Scan
from scanwright.firmware_io.servo.progress import ServoState
from scanwright.firmware_io.servo.servo import ServoDriver

SERVO_HZ = 100.0  # an angle every 0.6 deg at 60 deg/s

_LEAD_S = 0.5  # to come to rest at the start
_STOP_REPLY_S = 5.0  # three tries of two requests take 1.5 s
_FAILING_S = 0.5  # longest time without replies; angles are interpolated over less than that
_WINDOW = 50  # samples: half a second
_STILL_RAD = math.radians(0.2)  # two steps of the encoder
_UNCERTAIN_STEPS = 0.6  # of the encoder; up to it an angle of uncertain time is about as good as any other
_GAP_NS = 1_000_000_000  # beyond it an uncertain angle is better than none
_GAP_BOUNDS = 4  # unless its time is as uncertain as the gap is long: this process was stopped in the transaction


@dataclass(frozen=True, slots=True)
class Move:
    """One command to the servo."""

    at_s: float  # since the first command
    goal_rad: float  # inf for continuous rotation
    rate_rad_s: float


def course(motion: Motion, from_rad: float) -> tuple[float, Iterator[Move]]:
    """Return the start of the motion [s] and its endless moves, for a servo at `from_rad`."""
    if isinstance(motion, Spin):
        return 0.0, iter([Move(0.0, math.inf, 2 * math.pi / motion.period_s)])
    if isinstance(motion, Sweep):
        goals_rad = [math.radians(limit) for limit in motion.limits_deg]
        rate_rad_s, slot_s, ahead_s = math.radians(motion.cruise_deg_s), motion.period_s / 2, motion.period_s / 2
    else:
        goals_rad = [2 * math.pi * stop / motion.stops - math.pi for stop in range(motion.stops)]
        # four fifths of the time to move, the rest to come to rest
        rate_rad_s = 2 * math.pi / motion.stops / (0.8 * motion.move_s)
        slot_s, ahead_s = motion.dwell_s + motion.move_s, motion.move_s
    begin_s = abs(goals_rad[0] - from_rad) / rate_rad_s + _LEAD_S
    return begin_s, _back_and_forth(goals_rad, rate_rad_s, begin_s, slot_s, ahead_s)


def _back_and_forth(
    goals_rad: list[float], rate_rad_s: float, begin_s: float, slot_s: float, ahead_s: float
) -> Iterator[Move]:
    """Yield the goals back and forth; each has a slot, and is commanded `ahead_s` before that.

    A stop at either end belongs to both directions and has two slots; a sweep (two goals, commanded an entire slot
    ahead) has one.
    """
    yield Move(0.0, goals_rad[0], rate_rad_s)
    there_and_back = [*goals_rad, *reversed(goals_rad)] if ahead_s < slot_s else goals_rad
    for slot, goal_rad in enumerate(cycle(there_and_back)):
        if slot:
            yield Move(begin_s + slot * slot_s - ahead_s, goal_rad, rate_rad_s)


class AxisThread:
    """Queues to and from the servo thread, with the accepted angles."""

    def __init__(self, motion: Motion, start_rad: float, step_rad: float) -> None:
        self.orders: SimpleQueue[Iterator[Move] | None] = SimpleQueue()  # moves for the thread; None: hold
        self.received: SimpleQueue[ServoState | Exception] = SimpleQueue()  # states and errors from the thread
        self.stop_replies: SimpleQueue[bool] = SimpleQueue()  # whether the servo confirmed a stop
        self.window: deque[ServoState] = deque(maxlen=_WINDOW)  # accepted angles of the last half second
        self.left_out: Counter[str] = Counter()  # rejected angles, reason -> count
        self.longest_gap_ns = 0  # between two accepted angles
        self._bounds_ns: deque[int] = deque(maxlen=2 * _WINDOW)
        self._unread: list[ServoState] = []  # received by `go`, for the next `receive`
        self._failure: Exception | None = None
        self._motion = motion
        self._uncertain_rad = _UNCERTAIN_STEPS * step_rad
        self._order(start_rad)

    def stop(self) -> bool:
        """Hold, with torque on, until `go`; return whether the servo confirmed that."""
        self.orders.put(None)
        try:
            return self.stop_replies.get(timeout=_STOP_REPLY_S)
        except Empty:
            return False

    def go(self) -> None:
        """Restart the motion from the present angle, and set `begins_ns`."""
        self._unread = self.receive()
        self._order(self.window[-1].position_rad if self.window else 0.0)

    def _order(self, from_rad: float) -> None:
        lead_s, moves = course(self._motion, from_rad)
        self.begins_ns = time.monotonic_ns() + round(lead_s * 1e9)  # until then the axis moves to the start
        self.orders.put(moves)

    def receive(self) -> list[ServoState]:
        """Return the new accepted angles."""
        good, self._unread = self._unread, []
        while not self.received.empty() and self._failure is None:
            state = self.received.get()
            if isinstance(state, Exception):
                self._failure = state
                break
            self._bounds_ns.append(state.time_bound_ns)
            if math.isnan(state.position_rad):
                self.left_out["servo angles in the dead sector"] += 1
            elif (  # a slow axis, as at the ends of a sweep, makes no angle uncertain
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
        """Whether the axis turned between the last angle before a scan and the first one after it."""
        first_ns, last_ns = scan.stamp_ns, int(scan.time_ns[-1])
        before = [state.position_rad for state in self.window if state.time_ns <= first_ns][-1:]
        during = [state.position_rad for state in self.window if first_ns < state.time_ns < last_ns]
        after = [state.position_rad for state in self.window if state.time_ns >= last_ns][:1]
        return not (before and after) or np.ptp(before + during + after) > _STILL_RAD

    def turning(self) -> tuple[float, float]:
        """Return the speed [deg/s] over the window, and the rms deviation from uniform rotation [deg]."""
        if len(self.window) < _WINDOW:
            return math.nan, math.nan
        time_s = np.array([state.time_ns - self.window[0].time_ns for state in self.window]) / 1e9
        angle_deg = np.degrees([state.position_rad for state in self.window])
        speed, start = np.polyfit(time_s, angle_deg, 1)
        return float(speed), float(np.std(angle_deg - start - speed * time_s))


@contextmanager
def turning_servo(servo: ServoDriver, motion: Motion) -> Iterator[AxisThread]:
    """Run the motion and the readings of a servo during the body."""
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
    """Wait for the end of the thread, also at a second Ctrl-C: it could turn a servo after its stop."""
    again: KeyboardInterrupt | None = None
    while thread.is_alive():
        try:
            thread.join()
        except KeyboardInterrupt as interrupt:
            again = interrupt
    if again is not None:
        raise again


def _follow(servo: ServoDriver, axis: AxisThread, done: Event) -> None:
    """Run the servo thread: command each move at its time, read the state at `SERVO_HZ`, report errors."""
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
            try:  # a command without a reply is repeated
                if to_hold:
                    servo.hold()
                    to_hold = False
                    axis.stop_replies.put(True)
                if move is not None and now_s - began_s >= move.at_s:
                    if math.isinf(move.goal_rad):
                        servo.spin(move.rate_rad_s)
                    else:
                        servo.sweep_to(move.goal_rad, move.rate_rad_s)
                    move = next(moves, None)
                axis.received.put(servo.read())
                answered_s = now_s
            except (DeviceTimeoutError, ProtocolError):
                if now_s - answered_s > _FAILING_S:
                    raise
    except Exception as error:  # raised by the receiving thread
        axis.received.put(error)
        axis.stop_replies.put(False)
