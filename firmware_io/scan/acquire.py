"""Scan: turn the lidar, record both devices, and stop them on every exit.

The order of a run: open and check both devices; the laser on, until the sensor's clock is known on the host's; the
servo turns, until it turns steadily; then, and only then, the recording begins, and lasts for the turns that were asked
for. Two threads: one asks the servo for its angle a hundred times a second, the other reads the scans as they come.

Where the lidar was away (`firmware_io/scan/lidar_scans.py`) the full scan in which it was lost is taken again, whole.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from threading import Event

import numpy as np

from scanwright.design.angles import AngleSet
from scanwright.design.errors import DeviceError
from scanwright.design.findings import sentence
from scanwright.design.motion import Motion, Spin, StopAndGo
from scanwright.design.progress import Progress, no_progress
from scanwright.firmware_io.lidar.families import open_lidar
from scanwright.firmware_io.lidar.lidar import LidarDriver
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.import_checks.stream import StreamChecks
from scanwright.firmware_io.samples import Scan
from scanwright.firmware_io.scan.axis_thread import AxisThread, turning_servo
from scanwright.firmware_io.scan.lidar_scans import LidarScans, settle_clock
from scanwright.firmware_io.scan.live_feed import UNWATCHED, Watch
from scanwright.firmware_io.scan.plan import ScanPlan
from scanwright.firmware_io.scan.recorder import recorder_of
from scanwright.firmware_io.scan.reporter import Reporter
from scanwright.firmware_io.scan.scan_summary import BETWEEN_STOPS, ScanSummary
from scanwright.firmware_io.servo.progress import ServoState
from scanwright.firmware_io.servo.servo import open_servo

_STEADY_PATIENCE_S = 15.0  # a heavy head takes some seconds
_MOST_SPEEDS = 3600  # an hour of them, for the mean


def acquire(plan: ScanPlan, progress: Progress = no_progress, watch: Watch = UNWATCHED) -> ScanSummary:
    """Record a scan; stop both devices and close the recording on every exit.

    An exception that ends it early has notes with the state that the devices reported when they were stopped.

    Args:
        plan: of the scan.
        progress: gets each step; the fraction is the share of the recording that is done.
        watch: gets scans, angles and messages.

    Raises:
        ServoSetupError: settings of the servo that outlast the power must change first; nothing was moved.
        DeviceError: a device is absent, another one than the angle set names, or fails.
        RecordingError: the recording cannot be written.
    """
    reporter = Reporter(progress, watch)
    ros_messages.definition(
        ros_messages.LASER_SCAN
    )  # loads the message types: half a second that must not fall into the recording
    with _unturned_until_opened() as opened, ExitStack() as stack:
        lidar = stack.enter_context(open_lidar(plan.ports.lidar, plan.angles.sensor, plan.stamp_at))
        servo = stack.enter_context(
            open_servo(plan.ports.servo, plan.angles.servo, plan.servo_id, spins=isinstance(plan.motion, Spin))
        )
        opened.set()
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


@contextmanager
def _unturned_until_opened() -> Iterator[Event]:
    """Note at a Ctrl-C that comes before the servo is opened (the event is set) that it was not turned."""
    opened = Event()
    try:
        yield opened
    except KeyboardInterrupt as stop:
        if not opened.is_set():
            stop.add_note("the servo was not started")
        raise


def check_model(angles: AngleSet, lidar: LidarDriver) -> None:
    """Refuse a lidar that is not the one of the angle set.

    Raises:
        DeviceError: it is another model.
    """
    if lidar.model != angles.sensor:
        raise DeviceError(f"{lidar.address}: this is a {lidar.model}, but the angle set is for a {angles.sensor}")


def _wait_until_steady(
    scans: LidarScans,
    axis: AxisThread,
    motion: Motion,
    reporter: Reporter,
    keep: Callable[[ServoState], None] = lambda _: None,
) -> int:
    """Read scans until the servo is at the start of the motion, and a spin is even and at its speed.

    Args:
        scans: of the lidar.
        axis: of the servo.
        motion: to begin.
        reporter: of the scan.
        keep: gets the angles meanwhile.

    Returns:
        The number of scans that were read.
    """
    read = 0

    def patience_s() -> float:  # begins anew with the motion, where the lidar is lost meanwhile
        return axis.begins_ns / 1e9 + _STEADY_PATIENCE_S

    def wait() -> None:
        nonlocal read
        scans.next()
        read += 1
        for state in axis.hear():
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
    """Record until the turns are full; a scan is written as soon as the angle after its last beam is known."""
    reporter.step("scanning until Ctrl-C" if plan.endless else f"recording {plan.duration_s:g} s")
    watch = reporter.watch
    wanted = math.inf if plan.endless else plan.turns
    lidar, dropped, bad = scans.lidar, scans.lidar.dropped, scans.lidar.bad_packets
    axis.left_out.clear()
    recorded_s = reported_s = time.monotonic()
    earlier, done, away = 0, 0.0, scans.away  # full scans: before the lidar was lost last, until now; its losses
    begin_s, from_rad = recorded_s, axis.window[-1].position_rad
    turned = deque([axis.turning()], maxlen=_MOST_SPEEDS)
    waiting: deque[Scan] = deque()
    recorded, angles, first_ns, last_ns = 0, 0, 0, 0
    checks = StreamChecks(at_rest=isinstance(plan.motion, StopAndGo))
    note = {"source": "scanwright scan", "hold": "true" if isinstance(plan.motion, StopAndGo) else "false"}
    with recorder_of(None if plan.endless else plan.recording, note, plan.attached) as recorder:

        def keep(state: ServoState) -> None:
            nonlocal angles
            recorder.joint(state.time_ns, state.position_rad)
            watch.joint(state.time_ns, state.position_rad)
            checks.joint(state.time_ns, state.position_rad)
            angles += 1

        def write_complete() -> None:
            """Write the scans after whose last beam an angle is known."""
            nonlocal recorded, first_ns, last_ns
            for state in axis.hear():
                keep(state)
            while waiting and waiting[0].time_ns[-1] <= axis.window[-1].time_ns:
                ready = waiting.popleft()
                if isinstance(plan.motion, StopAndGo) and axis.moved(ready):
                    axis.left_out[BETWEEN_STOPS] += 1
                    continue
                recorder.scan(ready)
                watch.scan(ready)
                first_ns = first_ns or ready.stamp_ns
                recorded += 1
                last_ns = int(ready.time_ns[-1])

        for state in axis.window:
            keep(state)
        while done < wanted or waiting:
            try:
                scan = scans.next()
            except DeviceError:
                write_complete()
                raise
            if scans.away > away:
                resting = 1 + _wait_until_steady(scans, axis, plan.motion, reporter, keep)
                axis.left_out["scans until the servo turned again"] += resting
                earlier, away = math.floor(done), scans.away
                begin_s, from_rad = time.monotonic(), axis.window[-1].position_rad
                continue
            for finding in checks.scan(scan, time.monotonic_ns()):
                reporter.warn(sentence(finding))
            if done < wanted:
                waiting.append(scan)
            write_complete()
            if isinstance(plan.motion, Spin):
                turns = abs(axis.window[-1].position_rad - from_rad) / (2 * math.pi)
                done = earlier + max(turns - scan.scan_time_s / plan.motion.period_s, 0.0)
            else:
                done = earlier + (time.monotonic() - begin_s) / plan.motion.duration_s
            if time.monotonic() - reported_s > 1:
                reported_s = time.monotonic()
                turned.append(axis.turning())
                rate_hz = recorded / (reported_s - recorded_s)
                even = f", {turned[-1][0]:.1f} deg/s, rms deviation {turned[-1][1]:.2f} deg"
                step = f"full scan {math.floor(done) + 1:,}" if plan.endless else "recording"
                reporter.step(
                    f"{step}: {rate_hz:.1f} scans/s, {lidar.dropped - dropped} dropped, "
                    f"{lidar.bad_packets - bad} bad packets" + (even if isinstance(plan.motion, Spin) else ""),
                    done % 1 if plan.endless else min(done / plan.turns, 1),
                )
    for finding in checks.check():
        reporter.warn(sentence(finding))
    if not recorded:
        raise DeviceError("not one scan was recorded: the axis did not stand still at a stop; make dwell_s longer")
    dropped_why = "scans that the sensor lost, or that waited because this computer was busy"
    lost = {dropped_why: lidar.dropped - dropped, "bad packets": lidar.bad_packets - bad}
    even_turning = np.array(turned) if isinstance(plan.motion, Spin) else np.zeros((1, 2))
    return ScanSummary(
        recording=plan.recording,
        scans=recorded,
        joint_samples=angles,
        duration_s=(last_ns - first_ns) / 1e9,
        speed_deg_s=float(even_turning[:, 0].mean()),
        ripple_deg=float(even_turning[:, 1].max()),
        clock_ns=scans.clock_ns,
        reconnects=scans.away,
        left_out={reason: number for reason, number in {**lost, **axis.left_out}.items() if number},
    )
