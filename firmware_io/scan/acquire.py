"""Scan: turn the lidar, record both devices, and stop them on every exit.

Order: open and check both devices; laser on until its clock is known; servo on until it turns steadily; record the
requested turns. One thread reads the servo a hundred times a second, the other the scans.

A full scan in which the lidar was lost (`lidar_scans.py`) is recorded again.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from scanwright.design.angles import AngleSet
from scanwright.design.errors import DeviceError
from scanwright.design.motion import Motion, Spin, StopAndGo
from scanwright.design.progress import Progress, no_progress
from scanwright.firmware_io.lidar.families import open_lidar
from scanwright.firmware_io.lidar.lidar import LidarDriver
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.import_checks.stream import StreamChecks
from scanwright.firmware_io.samples import Scan
from scanwright.firmware_io.scan.axis_thread import AxisThread, turning_servo
from scanwright.firmware_io.scan.lidar_scans import LidarScans, settle_clock
from scanwright.firmware_io.scan.live_feed import UNWATCHED, Reporter, Watch
from scanwright.firmware_io.scan.plan import ScanPlan
from scanwright.firmware_io.scan.recorder import Recorder, recorder_of
from scanwright.firmware_io.scan.scan_end import BETWEEN_STOPS, ScanSummary
from scanwright.firmware_io.servo.progress import ServoState
from scanwright.firmware_io.servo.servo import open_servo

_STEADY_PATIENCE_S = 15.0  # a heavy head needs some seconds
_MOST_SPEEDS = 3600  # one hour, for the mean


def acquire(plan: ScanPlan, progress: Progress = no_progress, watch: Watch = UNWATCHED) -> ScanSummary:
    """Record a scan; stop both devices and close the recording on every exit.

    An exception has notes with the state that the devices reported when they were stopped.

    Args:
        plan: of the scan.
        progress: called with each step; the fraction is the completed part of the recording.
        watch: receives scans, angles and messages.

    Raises:
        ServoSetupError: permanent settings of the servo must change first; nothing was moved.
        DeviceError: a device is absent, not the one of the angle set, or fails.
        RecordingError: the recording cannot be written.
    """
    reporter = Reporter(progress, watch)
    ros_messages.definition(ros_messages.LASER_SCAN)  # loads the message types for half a second, not while recording
    with ExitStack() as stack:
        try:
            lidar = stack.enter_context(open_lidar(plan.ports.lidar, plan.angles.sensor, plan.stamp_at))
            lidar.set_filters(plan.echo, mean_filter_off=plan.mean_filter_off)
            spins = isinstance(plan.motion, Spin)
            servo = stack.enter_context(open_servo(plan.ports.servo, plan.angles.servo, plan.servo_id, spins=spins))
        except KeyboardInterrupt as stop:
            stop.add_note("the servo was not started")
            raise
        check_model(plan.angles, lidar)
        reporter.step(f"{lidar.model} {lidar.serial_number} and {servo.model}, {servo.read().voltage_V:.1f} V")
        for warning in servo.warnings():
            reporter.warn(f"{servo.model}: {warning}")
        scans = LidarScans(lidar, reporter)
        lidar.start(intensity=plan.intensity, cluster=plan.cluster, skip=plan.every - 1)
        settle_clock(scans, reporter)
        axis = scans.axis = stack.enter_context(turning_servo(servo, plan.motion))
        reporter.step("starting the servo")
        _wait_until_steady(scans, axis, plan.motion, reporter)
        before = servo.lost_replies
        axis.longest_gap_ns = 0
        summary = _record(plan, scans, axis, reporter)
        return replace(summary, lost_replies=servo.lost_replies - before, longest_gap_s=axis.longest_gap_ns / 1e9)


def check_model(angles: AngleSet, lidar: LidarDriver) -> None:
    """Raise DeviceError if the lidar is not that of the angle set."""
    if lidar.model != angles.sensor:
        raise DeviceError(f"{lidar.address}: this is a {lidar.model}, but the angle set is for a {angles.sensor}")


def _wait_until_steady(
    scans: LidarScans,
    axis: AxisThread,
    motion: Motion,
    reporter: Reporter,
    keep: Callable[[ServoState], None] = lambda _: None,
) -> int:
    """Read scans until the motion begins and a spin is even; return their number. `keep` gets the angles."""
    read = 0

    def patience_s() -> float:  # restarts with the motion after a loss of the lidar
        return axis.begins_ns / 1e9 + _STEADY_PATIENCE_S

    def wait() -> None:
        nonlocal read
        scans.next()
        read += 1
        for state in axis.receive():
            keep(state)

    while time.monotonic_ns() < axis.begins_ns or math.isnan(axis.turning()[0]):
        if time.monotonic() > patience_s():
            raise DeviceError("the servo reports no angle: it may be in its dead sector all the time")
        wait()
    if not isinstance(motion, Spin):
        return read
    goal = 360 / motion.period_s
    while True:
        speed, ripple = axis.turning()
        reached = abs(speed - goal) < max(0.1 * goal, 0.5) and axis.window[0].time_ns > axis.begins_ns
        if reached and ripple < max(0.002 * goal, 0.2):
            return read
        if time.monotonic() > patience_s():
            break
        wait()
    uneven = f"speed of the servo: {speed:.1f} deg/s (goal {goal:.1f}), rms deviation {ripple:.2f} deg"
    if not reached:
        raise DeviceError(f"{uneven}: check its supply and the friction of the head")
    reporter.warn(f"{uneven}: check the balance of the head")
    return read


def _record(plan: ScanPlan, scans: LidarScans, axis: AxisThread, reporter: Reporter) -> ScanSummary:
    """Record the requested full scans; a scan is written when an angle after its last beam is known."""
    reporter.step("scanning until Ctrl-C" if plan.endless else f"recording {plan.duration_s:g} s")
    axis.left_out.clear()
    note = {"source": "scanwright scan", "hold": "true" if isinstance(plan.motion, StopAndGo) else "false"}
    with recorder_of(None if plan.endless else plan.recording, note, plan.attached) as recorder:
        run = _Run(plan, scans, axis, reporter, recorder)
        while run.done < run.requested or run.waiting:
            run.read_scan()
    return run.summary()


class _Run:
    """State of a recording."""

    def __init__(
        self, plan: ScanPlan, scans: LidarScans, axis: AxisThread, reporter: Reporter, recorder: Recorder | Watch
    ) -> None:
        self._plan, self._scans, self._axis, self._reporter, self._recorder = plan, scans, axis, reporter, recorder
        self.done, self.requested = 0.0, math.inf if plan.endless else float(plan.turns)  # full scans
        self.waiting: deque[Scan] = deque()  # scans whose last beam is later than the last angle
        self._began_s = self._reported_s = time.monotonic()
        self._dropped, self._bad = scans.lidar.dropped, scans.lidar.bad_packets
        self._speeds = deque([axis.turning()], maxlen=_MOST_SPEEDS)
        self._recorded = self._angles = self._first_ns = self._last_ns = 0
        self._checks = StreamChecks(at_rest=isinstance(plan.motion, StopAndGo))
        for state in axis.window:
            self._keep(state)
        self._begin_turns()

    def read_scan(self) -> None:
        """Wait for a scan, and write the complete ones; restart the full scan in which the lidar was lost."""
        try:
            scan = self._scans.next()
        except DeviceError:
            self._write_complete()
            raise
        if self._scans.away > self._away:
            resting = 1 + _wait_until_steady(self._scans, self._axis, self._plan.motion, self._reporter, self._keep)
            self._axis.left_out["scans until the servo turned again"] += resting
            self._begin_turns()
            return
        for finding in self._checks.scan(scan, time.monotonic_ns()):
            self._reporter.warn(finding.message)  # its hints are options of `import`
        if self.done < self.requested:
            self.waiting.append(scan)
        self._write_complete()
        motion = self._plan.motion
        if isinstance(motion, Spin):
            turns = abs(self._axis.window[-1].position_rad - self._from_rad) / (2 * math.pi)
            self.done = self._earlier + max(turns - scan.scan_time_s / motion.period_s, 0.0)
        else:
            self.done = self._earlier + (time.monotonic() - self._begin_s) / motion.duration_s
        if time.monotonic() - self._reported_s > 1:
            self._report()

    def summary(self) -> ScanSummary:
        """Check the last scans and return the summary; DeviceError without a scan."""
        for finding in self._checks.check():
            self._reporter.warn(finding.message)  # its hints are options of `import`
        if not self._recorded:
            raise DeviceError("not one scan was recorded: the axis did not stand still at a stop; make dwell_s longer")
        lidar = self._scans.lidar
        why = "scans that the sensor lost, or that waited because this computer was busy"
        lost = {why: lidar.dropped - self._dropped, "bad packets": lidar.bad_packets - self._bad}
        speeds = np.array(self._speeds) if isinstance(self._plan.motion, Spin) else np.zeros((1, 2))
        return ScanSummary(
            recording=self._plan.recording,
            scans=self._recorded,
            joint_samples=self._angles,
            duration_s=(self._last_ns - self._first_ns) / 1e9,
            speed_deg_s=float(speeds[:, 0].mean()),
            ripple_deg=float(speeds[:, 1].max()),
            clock_ns=self._scans.clock_ns,
            reconnects=self._scans.away,
            left_out={reason: number for reason, number in {**lost, **self._axis.left_out}.items() if number},
        )

    def _begin_turns(self) -> None:
        self._earlier, self._away = math.floor(self.done), self._scans.away
        self._begin_s, self._from_rad = time.monotonic(), self._axis.window[-1].position_rad

    def _keep(self, state: ServoState) -> None:
        for receiver in (self._recorder, self._reporter.watch, self._checks):
            receiver.joint(state.time_ns, state.position_rad)
        self._angles += 1

    def _write_complete(self) -> None:
        """Write the scans with an angle after their last beam."""
        for state in self._axis.receive():
            self._keep(state)
        while self.waiting and self.waiting[0].time_ns[-1] <= self._axis.window[-1].time_ns:
            ready = self.waiting.popleft()
            if isinstance(self._plan.motion, StopAndGo) and self._axis.moved(ready):
                self._axis.left_out[BETWEEN_STOPS] += 1
                continue
            self._recorder.scan(ready)
            self._reporter.watch.scan(ready)
            self._first_ns = self._first_ns or ready.stamp_ns
            self._recorded += 1
            self._last_ns = int(ready.time_ns[-1])

    def _report(self) -> None:
        plan, lidar = self._plan, self._scans.lidar
        self._reported_s = time.monotonic()
        self._speeds.append(self._axis.turning())
        rate_hz = self._recorded / (self._reported_s - self._began_s)
        even = f", {self._speeds[-1][0]:.1f} deg/s, rms deviation {self._speeds[-1][1]:.2f} deg"
        step = f"full scan {math.floor(self.done) + 1:,}" if plan.endless else "recording"
        self._reporter.step(
            f"{step}: {rate_hz:.1f} scans/s, {lidar.dropped - self._dropped} dropped, "
            f"{lidar.bad_packets - self._bad} bad packets" + (even if isinstance(plan.motion, Spin) else ""),
            self.done % 1 if plan.endless else min(self.done / plan.turns, 1),
        )
