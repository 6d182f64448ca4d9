"""Emulated scanner of `scanwright emulate`: the lidar on the horn of the servo, in a scene."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pkgutil import resolve_name

import numpy as np

from scanwright.design.angles import AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import SceneError
from scanwright.design.motion import Spin
from scanwright.design.scene.ray_caster import Scene, cast
from scanwright.firmware_io.device_ports import Ports
from scanwright.firmware_io.emulators.lidar_line import LidarLine, Machine
from scanwright.firmware_io.emulators.servo.emulator import ServoEmulator
from scanwright.firmware_io.emulators.servo_plant import Load
from scanwright.firmware_io.emulators.world import range_model, rays, scene_ranging
from scanwright.firmware_io.lidar.families import family_of


@dataclass(frozen=True, slots=True)
class EmulatedScanner:
    """A running emulated scanner."""

    ports: Ports
    lidar: LidarLine[Machine]
    servo: ServoEmulator


@contextmanager
def emulated_scanner(
    angles: AngleSet,
    scene: Scene,
    *,
    load: Load | None = None,
    protocol: str | None = None,
    sigma_mm: float | None = None,
    seed: int = 0,
    factory_servo: bool = False,
) -> Iterator[EmulatedScanner]:
    """Run the emulators of a scanner's devices during the body.

    Args:
        angles: angle set of the scanner.
        scene: surroundings, in the world frame.
        load: of the servo; None for a light, balanced head.
        protocol: of the servo; None for the factory setting.
        sigma_mm: replaces the range noise of the data sheet.
        seed: of the noise.
        factory_servo: whether the servo has factory settings instead of those for the motion of the angle set.

    Raises:
        SceneError: no surface is in range.
        TaskError: sensor or servo are not in the catalogue.
        DeviceError: sensor or servo has no emulator.
    """
    lidar = load_catalogue().get(angles.sensor, Lidar)
    make_emulator = resolve_name(family_of(lidar.name).emulator)
    model, bearing_rad = range_model(lidar, sigma_mm), lidar.bearings_rad()
    for turn_rad in np.linspace(0, 2 * np.pi, 12, endpoint=False):
        hits = cast(scene, *rays(angles, bearing_rad, np.full(bearing_rad.size, turn_rad)))
        if (hits.range_m < model.range_max_m).any():
            break
    else:
        raise SceneError(
            f"no surface within {model.range_max_m:g} m of the scanner: check unit_m (0.001 for a mesh in mm) and at_m"
        )
    with ExitStack() as stack:
        servo = stack.enter_context(ServoEmulator(angles.servo, protocol, load=load, seed=seed))
        if not factory_servo:
            servo.set_up(spins=None if angles.motion is None else isinstance(angles.motion, Spin))
        ranging = scene_ranging(scene, angles, servo.axis.angle_rad, model, seed)
        emulator = stack.enter_context(make_emulator(lidar, ranging, seed))
        yield EmulatedScanner(Ports(emulator.port, servo.port, os.getpid()), emulator, servo)
