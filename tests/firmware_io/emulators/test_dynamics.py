"""How the emulator's horn turns: closed forms, tolerances, laziness, and what the paper says of both servos (3.2)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanwright.firmware_io.emulators.dynamics import HornMotion, Solver
from scanwright.firmware_io.emulators.servo_plant import Actuation, Load, plant_of

SECOND = 1_000_000_000
MX, AX = plant_of("MX-64R"), plant_of("AX-12A")


def times(begin_s, end_s, step_s=0.005):
    return np.round(np.arange(begin_s, end_s, step_s) * SECOND).astype(np.int64)


def driven(drive, plant=MX, load=None, **options):
    axis = HornMotion(plant, Load() if load is None else load, 0, **options)
    axis.drive(0, drive)
    return axis


def test_a_position_loop_ends_as_near_as_the_makers_example_waits_for():
    """read_write.cpp of DynamixelSDK, protocol 1.0, tried on an MX-28, goes on at 10 counts from its goal."""
    goal_rad = (100 - 2048) * 2 * np.pi / 4096
    horn = driven(Actuation("position", goal_rad))
    assert abs(horn.motion(4 * SECOND).angle_rad - goal_rad) < 10 * 2 * np.pi / 4096


def test_a_share_of_the_voltage_gives_that_share_of_the_speed_less_friction():
    for plant in (MX, AX):
        axis = driven(Actuation("share", 0.6, supply=0.9), plant)
        braked = (plant.friction_nm + Load().bearing_nm) / plant.stall_torque_nm
        expected = plant.no_load_rad_s * (0.6 * 0.9 - braked)
        assert axis.motion(2 * SECOND).rate_rad_s == pytest.approx(expected, rel=1e-4)


def test_the_speed_loop_holds_its_rate_under_a_constant_brake():
    axis = driven(Actuation("velocity", -2.0), load=Load(bearing_nm=0.5))
    assert axis.motion(3 * SECOND).rate_rad_s == pytest.approx(-2.0, rel=1e-4)


def test_a_blocked_horn_stays_and_the_loop_pushes_with_all_it_has():
    axis = driven(Actuation("velocity", 2.0))
    here = axis.motion(SECOND)
    axis.change(SECOND, blocked=True)
    blocked = axis.motion(3 * SECOND)
    assert abs(blocked.angle_rad - here.angle_rad) < math.radians(3)
    assert (blocked.duty, blocked.torque) == (1.0, pytest.approx(1.0, abs=1e-3))
    axis.change(3 * SECOND, blocked=False)
    assert axis.motion(5 * SECOND).rate_rad_s == pytest.approx(2.0, rel=1e-3)


def test_a_goal_that_walks_is_followed_with_the_lag_of_a_proportional_loop():
    """Duty = gain x lag and speed = no-load speed x duty, less friction: lag = (rate / w0 + brake) / gain."""
    axis = driven(Actuation("position", 3.0, 1.0))
    lag_rad = 2.0 - float(axis.angle_rad(np.array(2 * SECOND)))
    brake = (MX.friction_nm + Load().bearing_nm) / MX.stall_torque_nm
    seen_late = MX.sensor_lag_s * 1.0  # the loop sees the horn that much behind where it is
    assert lag_rad == pytest.approx((1.0 / MX.no_load_rad_s + brake) / MX.position_p - seen_late, rel=1e-3)


def test_without_torque_an_off_axis_mass_hangs_only_if_it_overcomes_the_gear():
    held, falls = (
        driven(Actuation(), load=Load(gravity_nm=share * MX.friction_nm), history_s=30.0).angle_rad(times(0, 20, 1.0))
        for share in (0.5, 4.0)
    )
    assert np.ptp(held) < math.radians(1)
    assert falls[-1] == pytest.approx(math.pi / 2, abs=0.4)  # gravity cos(angle) pulls towards 90 degrees, and rests


def test_gravity_makes_a_ripple_once_a_turn_in_proportion():
    rate = 2 * math.pi / 2  # the paper's turn of 2 s
    ripples = []
    for gravity_nm in (0.2, 0.4):
        rigid = replace(MX, backlash_rad=0.0)
        axis = driven(Actuation("velocity", rate), rigid, Load(gravity_nm=gravity_nm))
        t = times(4, 12)
        deviation = axis.angle_rad(t) - rate * t / SECOND
        spectrum = np.abs(np.fft.rfft(deviation - deviation.mean())) / t.size * 2
        assert np.argmax(spectrum) == 4  # four turns in the eight seconds
        ripples.append(spectrum[4])
    assert ripples[1] == pytest.approx(2 * ripples[0], rel=0.02)


def test_gravity_crosses_the_play_once_a_turn():
    """With a mass heavier than the bearing's friction the horn falls ahead of the gear by the whole play."""
    t, swings = times(4, 12), []
    for backlash_rad in (0.0, math.radians(2)):
        axis = driven(Actuation("share", 0.3), replace(MX, backlash_rad=backlash_rad), Load(gravity_nm=0.1))
        angle = axis.angle_rad(t)
        swings.append(np.ptp(angle - np.polyval(np.polyfit(t / SECOND, angle, 1), t / SECOND)))
    assert 0.5 * math.radians(2) < swings[1] - swings[0] < 1.5 * math.radians(2)


def test_an_ax_12a_rings_in_joint_mode_and_an_mx_64r_does_not():
    """The paper, 3.2: "it tends to oscillate in Joint Mode", where the MX-64R "showed to work stable"."""
    head = Load(inertia_kg_m2=1e-3)
    overshoot_deg, ringing_deg = {}, {}
    for name, plant in (("AX", AX), ("MX", MX)):
        axis = driven(Actuation("position", 1.0, 1.0), plant, head)
        angle = axis.angle_rad(times(0, 3))
        overshoot_deg[name] = math.degrees(angle.max() - 1.0)
        sweep = axis.angle_rad(times(0.15, 0.9))
        line = np.polyval(np.polyfit(np.arange(sweep.size), sweep, 1), np.arange(sweep.size))
        ringing_deg[name] = math.degrees(np.std(sweep - line))
    assert overshoot_deg["AX"] > 1.0 and overshoot_deg["MX"] < 0.01
    assert ringing_deg["AX"] > 10 * ringing_deg["MX"]


@pytest.mark.parametrize("method", ["LSODA", "BDF", "Radau"])
def test_methods_agree_within_their_tolerance(method):
    t = times(0, 2, 0.01)
    load = Load(gravity_nm=0.2)
    reference = driven(Actuation("velocity", 3.0), load=load, solver=Solver("Radau", 1e-9)).angle_rad(t)
    errors = [
        np.abs(
            driven(Actuation("velocity", 3.0), load=load, solver=Solver(method, rtol)).angle_rad(t) - reference
        ).max()
        for rtol in (1e-4, 1e-6)
    ]
    assert errors[1] < errors[0] < 1e-2
    assert errors[1] < 1e-4


@settings(max_examples=15, deadline=None)
@given(asked=st.lists(st.integers(0, 2 * SECOND), min_size=1, max_size=8))
def test_the_motion_does_not_depend_on_when_it_is_asked(asked):
    """Steps are taken on demand, in any order; the answers are those of one long run."""
    whole, lazy = (driven(Actuation("velocity", 3.0), load=Load(gravity_nm=0.1)) for _ in range(2))
    whole.angle_rad(np.array(2 * SECOND))
    for time_ns in asked:
        assert lazy.angle_rad(np.array(time_ns)) == whole.angle_rad(np.array(time_ns))


def test_a_drive_changes_the_future_and_not_the_past():
    """Also where the motion had been integrated beyond the change: that part is forgotten."""
    far, near = (driven(Actuation("velocity", 3.0), load=Load(gravity_nm=0.3)) for _ in range(2))
    soon = times(0, 1.2, 0.01)
    before = far.angle_rad(times(0, 2, 0.01))[: soon.size]
    for axis in (far, near):
        axis.drive(SECOND, Actuation("velocity", -3.0))
    after = far.angle_rad(soon)
    assert np.allclose(after[soon <= SECOND], before[soon <= SECOND], rtol=0, atol=1e-12)
    assert np.allclose(after, near.angle_rad(soon), rtol=0, atol=1e-12)
    assert far.motion(2 * SECOND).rate_rad_s == pytest.approx(-3.0, rel=0.05)


def test_the_past_is_forgotten_and_never_invented():
    axis = driven(Actuation("velocity", 3.0), history_s=1.0, solver=Solver("LSODA", 1e-8))
    for second in range(1, 60):
        axis.angle_rad(np.array(second * SECOND))
        axis.change(second * SECOND, goal=3.0 + second % 2)
    with pytest.raises(ValueError, match="before the history"):
        axis.angle_rad(np.array(SECOND))
    assert axis.angle_rad(times(58, 59)).shape == (200,)


@pytest.mark.parametrize(
    ("begin_ns", "stall_ns", "rate_deg_s"),
    [(39742314, 163489261, 200), (362466, 100311909, 120), (47020837, 111850730, 120), (8651027, 78702149, 200)],
)
def test_a_stalled_loop_at_its_limit_is_no_work_for_the_solver(begin_ns, stall_ns, rate_deg_s):
    axis = HornMotion(plant_of("MX-64R"), Load(), 0)
    drive = Actuation("velocity", np.radians(rate_deg_s))
    axis.drive(begin_ns, drive)
    axis.drive(stall_ns, replace(drive, blocked=True))
    end_ns = stall_ns + 500_000_000
    while axis._integrator.t < end_ns / 1e9:
        axis.angle_rad(np.array([int(1e9 * axis._integrator.t) + 1000]))
        assert len(axis._steps) < 5000  # it crawled along its limit in steps of 10 ns, for ever
    assert axis.motion(end_ns).duty == pytest.approx(1.0)
