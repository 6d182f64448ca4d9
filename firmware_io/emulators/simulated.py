"""Simulated recording, faster than real time: exact motion, without packets, clocks, ripple or faults."""

from __future__ import annotations

import numpy as np

from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Floats
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError
from scanwright.design.motion import Motion, Spin, Sweep
from scanwright.design.scene.ray_caster import Scene
from scanwright.firmware_io.emulators.world import measure_ranges, range_model, see
from scanwright.firmware_io.recording.arrays import RecordingArrays
from scanwright.firmware_io.samples import JointLog

JOINT_HZ = 200.0  # twice as often as a scan reads the servo


def simulated_recording(
    angles: AngleSet, scene: Scene, *, turns: int = 1, sigma_mm: float | None = None, seed: int = 0
) -> RecordingArrays:
    """Cast each beam of full scans at the axis angle of its time.

    Args:
        angles: angle set of the scanner, with its motion.
        scene: surroundings, in the world frame.
        turns: full scans.
        sigma_mm: replaces the range noise of the data sheet.
        seed: of the noise.

    Raises:
        DeviceError: the angle set has no motion.
        TaskError: the sensor is not in the catalogue.
    """
    if angles.motion is None:
        raise DeviceError(f"{angles.task}: motion = null: this angle set has no motion of the servo")
    lidar = load_catalogue().get(angles.sensor, Lidar)
    bearing_rad, model, rng = lidar.bearings_rad(), range_model(lidar, sigma_mm), np.random.default_rng(seed)
    scans = int(np.ceil(turns * angles.motion.duration_s * lidar.scan_rate_hz))
    within_s = (bearing_rad - bearing_rad[0]) / (2 * np.pi * lidar.scan_rate_hz)
    time_s = np.arange(scans)[:, None] / lidar.scan_rate_hz + within_s
    joint_rad = _commanded_rad(angles.motion, time_s)
    rows = [measure_ranges(see(scene, angles, bearing_rad, row), model, rng) for row in joint_rad]
    log_s = np.arange(0.0, time_s[-1, -1] + 1 / JOINT_HZ, 1 / JOINT_HZ)
    return RecordingArrays(
        time_ns=np.rint(time_s * 1e9).astype(np.int64),
        bearing_rad=np.tile(bearing_rad, (scans, 1)),
        range_m=np.array([row.range_m for row in rows], np.float32),
        intensity=np.array([row.intensity for row in rows], np.float32),
        joint_log=JointLog(np.rint(log_s * 1e9).astype(np.int64), _commanded_rad(angles.motion, log_s)),
    )


def _commanded_rad(motion: Motion, time_s: Floats) -> Floats:
    """Return the commanded joint angle at times since the start; a spin counts turns."""
    if isinstance(motion, Spin):
        return 2 * np.pi * time_s / motion.period_s
    if isinstance(motion, Sweep):
        return motion.angle_rad(time_s)
    slot_s = motion.dwell_s + motion.move_s
    stop, into_s = np.divmod(time_s, slot_s)
    moved = np.clip((into_s - motion.dwell_s) / motion.move_s, 0.0, 1.0)
    return 2 * np.pi * (stop + moved) / motion.stops
