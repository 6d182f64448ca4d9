"""Lidar, servo and scans, real or simulated."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from scanwright.api.arguments import AnglesLike, as_angle_set, with_say
from scanwright.api.recordings import assemble
from scanwright.design.progress import Progress, no_progress
from scanwright.firmware_io.posix import require_posix

if TYPE_CHECKING:
    from scanwright.firmware_io.assembly.assemble import AssembleSummary
    from scanwright.firmware_io.lidar.lidar import LidarDriver
    from scanwright.firmware_io.recording.arrays import RecordingArrays
    from scanwright.firmware_io.scan.scan_end import ScanSummary
    from scanwright.firmware_io.servo.servo import ServoDriver


def open_servo(
    port: str,
    model: str | None = None,
    servo_id: int | None = None,
    *,
    spins: bool | None = None,
    undo_folder: str | Path | None = None,
) -> ServoDriver:
    """Open the servo on a port, at any baud rate and protocol; it is at rest, without torque. Use it with `with`.

    Args:
        port: such as "/dev/serial/by-id/...".
        model: required model; None accepts any known one.
        servo_id: its id on the bus; None if it is the only one.
        spins: whether it will spin (True) or sweep (False), to reject a wrong mode at once; None if unknown.
        undo_folder: allows writing permanent settings, and gets a file to undo them; None changes nothing.

    Raises:
        ServoSetupError: such settings must change, and `undo_folder` is None; see `set_up_servo`.
        DeviceError: no port, no servo, several servos, another model, or settings that cannot be made.

    Example:
        >>> import scanwright as sw
        >>> with sw.open_servo(servo_port) as servo:  # such as "/dev/serial/by-id/..."
        ...     servo.model
        'MX-64R'
    """
    require_posix()
    from scanwright.firmware_io.servo.servo import open_servo

    folder = None if undo_folder is None else Path(undo_folder)
    return open_servo(port, model, servo_id, spins=spins, undo_folder=folder)


@with_say
def set_up_servo(
    port: str,
    undo_folder: str | Path,
    *,
    spins: bool | None = None,
    model: str | None = None,
    servo_id: int | None = None,
    progress: Progress = no_progress,
) -> Path | None:
    """Write the permanent settings that a scan needs to a servo.

    Args:
        port: such as "/dev/serial/by-id/...".
        undo_folder: gets the file that undoes the changes.
        spins: whether the servo will spin (True) or sweep (False); None does not change its mode.
        model: required model; None accepts any known one.
        servo_id: its id on the bus; None if it is the only one.
        progress: progress callback.

    Returns:
        The undo file, for `scanwright servo-setup PORT --undo FILE`; None if every setting was right.

    Raises:
        DeviceError: no such servo, its torque is on, a setting does not stay, or the file cannot be written.

    Example:
        >>> import scanwright as sw
        >>> sw.set_up_servo(servo_port, ".", spins=True)  # None: every setting was right
    """
    require_posix()
    from scanwright.firmware_io.servo.settings import set_up

    undo: Path | None = None
    for step in set_up(port, model, servo_id, Path(undo_folder), spins=spins):
        if isinstance(step, Path):
            undo = step
        else:
            progress(step)
    return undo


def open_lidar(address: str, model: str | None = None) -> LidarDriver:
    """Open a lidar at a serial port or HOST:PORT, in any state. Use it with `with`.

    Args:
        address: serial port or HOST:PORT.
        model: name in the catalogue, for sensors that do not report theirs; None tries all protocols.

    Raises:
        DeviceError: no such port, it is in use, or it is not a known sensor.

    Example:
        >>> import scanwright as sw
        >>> with sw.open_lidar(lidar_port) as lidar:  # such as "192.168.0.10:10940"
        ...     lidar.model
        'UTM-30LX'
    """
    require_posix()
    from scanwright.firmware_io.lidar.families import open_lidar

    return open_lidar(address, model)


@dataclass(frozen=True, slots=True)
class Scanned:
    """A scan: its recording and its cloud."""

    recorded: ScanSummary
    assembled: AssembleSummary


@with_say
def scan(
    folder: str | Path,
    *,
    turns: int = 1,
    period_s: float | None = None,
    lidar: str | None = None,
    servo: str | None = None,
    servo_id: int | None = None,
    recording: str | Path | None = None,
    intensity: bool = False,
    cluster: int = 1,
    every: int = 1,
    stamp_at: Literal["step_0", "rear", "first_beam", "last_beam"] | None = None,
    echo: Literal["first", "last"] | None = None,
    mean_filter_off: bool = False,
    progress: Progress = no_progress,
) -> Scanned:
    """Record a full scan with the scanner of a build folder, and assemble the cloud next to the recording.

    Args:
        folder: build folder; only its `angles.json` is required.
        turns: number of full scans.
        period_s: time of one full scan; None for that of the task. `calibrate` needs two to find the backlash.
        lidar: serial port or HOST:PORT; None detects the emulated or connected one, as for `servo`.
        servo: serial port.
        servo_id: id of the servo, if several share its bus.
        recording: file to write, `.mcap`; None writes one into the folder, named by date and time.
        intensity: also record intensities.
        cluster: merge this many steps into one range, the smallest.
        every: use every Nth scan of the lidar.
        stamp_at: beam of the lidar's timestamps. Hokuyo: step_0 (the specification) or rear; SICK: first_beam or
            last_beam. None chooses step_0, or for a SICK what its telegrams show.
        echo: echo that a beam of a SICK reports, until its power is switched off.
        mean_filter_off: switch a SICK's mean filter off, which smears a turning scan, until power-off.
        progress: progress callback.

    Raises:
        ServoSetupError: permanent settings of the servo must change first (`set_up_servo` writes them); nothing was
            written, nothing moved.
        DeviceError: no port, or a device fails; both devices are stopped, and what was recorded is intact.
        ScanwrightError: no angle set, no motion, or an unusable file name.

    Example:
        >>> import scanwright as sw
        >>> scanned = sw.scan(".", lidar=lidar_port, servo=servo_port, recording="scan.mcap")
        >>> scanned.assembled.out
        PosixPath('scan.ply')
    """
    require_posix()
    from scanwright.firmware_io.scan.acquire import acquire
    from scanwright.firmware_io.scan.plan import plan_scan

    named = None if recording is None else Path(recording)
    plan = plan_scan(
        Path(folder),
        turns=turns,
        period_s=period_s,
        lidar=lidar,
        servo=servo,
        servo_id=servo_id,
        recording=named,
        intensity=intensity,
        cluster=cluster,
        every=every,
        stamp_at=stamp_at,
        echo=echo,
        mean_filter_off=mean_filter_off,
    )
    recorded = acquire(plan, progress)
    return Scanned(recorded, assemble(plan.recording, plan.angles_path, plan.recording.with_suffix(".ply")))


def simulate(
    angles: AnglesLike,
    scene: str | Path | None = None,
    *,
    turns: int = 1,
    noise_mm: float | None = None,
    seed: int = 0,
) -> RecordingArrays:
    """Simulate a recording of a scene, faster than real time: exact servo motion, ranges with noise.

    Args:
        angles: angle set of the scanner, with its motion.
        scene: mesh in metres, STL, PLY, OBJ, DAE or GLB, the scanner's world frame at its origin; None for a furnished
            room.
        turns: number of full scans.
        noise_mm: range noise; None for the value of the data sheet.
        seed: random seed of the noise.

    Raises:
        SceneError: the mesh is unusable.
        TaskError: the sensor is not in the catalogue.
        DeviceError: the angle set has no motion.

    Example:
        >>> import scanwright as sw
        >>> recorded = sw.simulate("angles.json")
        >>> recorded.range_m.shape == recorded.bearing_rad.shape == recorded.joint_rad.shape
        True
    """
    from scanwright.firmware_io.emulators.simulated import simulated_recording
    from scanwright.firmware_io.emulators.world import room

    place = room(None if scene is None else Path(scene))
    return simulated_recording(as_angle_set(angles), place, turns=turns, sigma_mm=noise_mm, seed=seed)
