"""Stiff and extreme cases of the emulated servo and of de-skewing with known results.

The servo, with any load, stiffness and loop gains, ends at the speed at which its torque equals friction, or at the
goal of its loop; a stalled one at the angle at which the springs of brake and gear balance. A point has the distance of
its range from the optical centre, from a millimetre to ten kilometres.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.trials.density_stress import StressRow, row
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.motion import Spin
from scanwright.design.scene.ray_caster import build_scene, cast
from scanwright.firmware_io.assembly.deskew_kernel import place_block
from scanwright.firmware_io.emulators.dynamics import HornMotion, Motion
from scanwright.firmware_io.emulators.servo_plant import Actuation, Load, Plant, equations
from scanwright.firmware_io.emulators.world import furnished_room
from scanwright.firmware_io.samples import JointLog, Scan, blocks

SETTLED = 25.0  # time constants of rotor and load
GOAL_RAD_S = 1.0  # a turn in 6.3 s
RINGS_S, RK_STEPS = 0.05, 25_000  # time of the reference, in steps of 2 us
BRAKE = 50.0  # stiffness of the brake of a blocked horn, in stall torques per radian
SIZES = 1e-3, 1.0, 1e3, 1e4  # metres of a beam, and scales of a room
ROTORS_KG_M2 = {"next to nothing": 1e-8, "a screw": 1e-6, "a lidar": 5e-4, "a machine": 0.5, "a car": 50.0}


def servo_rows(plant: Plant) -> Iterator[StressRow]:
    """Yield cases of the servo: rotors, stiffness, backlash, loop gains, stalls."""
    full = Actuation("share", 1.0)
    for name, inertia in ROTORS_KG_M2.items():
        yield _speed(f"servo at full duty, it turns {name} ({inertia:g} kg m2)", plant, Load(inertia), full)
    for factor in (1e-2, 1e2):
        teeth = replace(plant, stiffness_nm_rad=factor * plant.stiffness_nm_rad)
        yield _speed(f"servo at full duty, teeth {factor:g} times as stiff", teeth, Load(), full)
    for backlash_deg in (0.0, 5.0):
        loose = replace(plant, backlash_rad=math.radians(backlash_deg))
        yield _speed(f"servo at full duty, {backlash_deg:g} deg of play", loose, Load(), full)
    for factor in (0.1, 1.0):
        loop = replace(plant, velocity_p=factor * plant.velocity_p, velocity_i=factor * plant.velocity_i)
        end = _end(loop, Load(), Actuation("velocity", GOAL_RAD_S))
        yield row(f"servo's loop, gains {factor:g} times as high", "speed held", GOAL_RAD_S, end.rate_rad_s, 1e-3)
    for factor in (10.0, 100.0):  # oscillates against both flanks: compared with another integrator
        yield _ringing(f"servo's loop, gains {factor:g} times as high: it rings", plant, factor)
    for name, inertia in ROTORS_KG_M2.items():
        yield _stalled(f"servo stalled at full duty with {name}", plant, Load(inertia))


def range_rows() -> Iterator[StressRow]:
    """Yield cases of ranges and beams from a millimetre to ten kilometres."""
    directions = np.random.default_rng(0).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    walls_m = furnished_room()
    near = cast(build_scene(walls_m), np.zeros((2000, 3)), directions).range_m
    for size in SIZES:
        far = cast(build_scene(size * walls_m), np.zeros((2000, 3)), directions).range_m
        off = float(np.abs(far / (size * near) - 1).max())
        yield StressRow(f"a room {size:g} times as large", "ranges in it", 1.0, 1.0 + off, off, 1e-9)
    angles = AngleSet(
        task="stress",
        angles_deg=Angles(alpha_rot=10, beta_rot=-55, alpha_laser=-80, beta_laser=75),
        sensor="UTM-30LX",
        servo="MX-64R",
        motion=Spin(period_s=2.0),
    )
    log = JointLog(np.array([0, 10**9]), np.array([0.0, math.pi]))
    centre_m = angles.T_world_rot(0.0)[:3, 3]
    for size in SIZES:
        scan = Scan(
            stamp_ns=10**8,
            angle_min_rad=-2.0,
            angle_increment_rad=0.01,
            time_increment_s=1e-5,
            scan_time_s=0.025,
            range_min_m=0.0,
            range_max_m=1e5,
            range_m=np.full(400, size, np.float32),
            intensity=np.empty(0, np.float32),
        )
        long = np.linalg.norm(place_block(next(blocks([scan])), log, angles).points_m[0] - centre_m, axis=1)
        off = float(np.abs(long / np.float32(size) - 1).max())
        yield StressRow(f"beams of {size:g} m", "length of their points", 1.0, 1.0 + off, off, 1e-6)


def _speed(case: str, plant: Plant, load: Load, drive: Actuation) -> StressRow:
    """Compare the end speed with the no-load speed minus friction."""
    friction = (plant.friction_nm + load.bearing_nm) / plant.stall_torque_nm
    expected = plant.no_load_rad_s * (drive.goal - friction)
    return row(case, "end speed", expected, _end(plant, load, drive).rate_rad_s, 1e-4)


def _ringing(case: str, plant: Plant, factor: float) -> StressRow:
    """Compare the angle of the horn with the classical Runge-Kutta rule in steps of 2 us."""
    loop = replace(plant, velocity_p=factor * plant.velocity_p, velocity_i=factor * plant.velocity_i)
    drive = Actuation("velocity", GOAL_RAD_S)
    axis = HornMotion(loop, Load(), 0)
    axis.drive(0, drive)
    rhs, t, h = equations(loop, Load(), drive, 0.0, 0.0, 0.0), 0.0, RINGS_S / RK_STEPS
    y = np.array([0, 0, 0, 0, GOAL_RAD_S / plant.no_load_rad_s, 0])  # the integral begins at its final value
    for _ in range(RK_STEPS):
        a = np.array(rhs(t, y))
        b = np.array(rhs(t + h / 2, y + h / 2 * a))
        c = np.array(rhs(t + h / 2, y + h / 2 * b))
        d = np.array(rhs(t + h, y + h * c))
        y, t = y + h / 6 * (a + 2 * b + 2 * c + d), t + h
    return row(case, "angle after 50 ms", float(y[2]), axis.motion(round(1e9 * RINGS_S)).angle_rad, 1e-4)


def _stalled(case: str, plant: Plant, load: Load) -> StressRow:
    """Compare the angle of a blocked horn with the balance of the brake's spring and the motor."""
    end = _end(plant, load, Actuation("share", 1.0, blocked=True))
    return row(case, "way it gives", 1 / BRAKE, end.angle_rad, plant.friction_nm / plant.stall_torque_nm)


def _end(plant: Plant, load: Load, drive: Actuation) -> Motion:
    """Return the settled motion of the horn; NaN if the solver failed."""
    constant_s = (plant.inertia_kg_m2 + load.inertia_kg_m2) * plant.no_load_rad_s / plant.stall_torque_nm
    axis = HornMotion(plant, load, 0)
    axis.drive(0, drive)
    try:
        return axis.motion(round(1e9 * max(SETTLED * constant_s, 5.0)))
    except ArithmeticError:
        return Motion(math.nan, math.nan, math.nan, math.nan)
