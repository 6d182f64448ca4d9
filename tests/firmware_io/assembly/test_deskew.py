"""The compiled de-skew: against its description, and against a scanner simulated by other means."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from benchmarks.firmware_io.recordings.deskew import place
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.beam_outcome import Verdict
from scanwright.firmware_io.assembly.deskew_kernel import _sin_cos, place_block
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.clouds.ply import read_ply
from scanwright.firmware_io.poses.trajectory import Trajectory
from scanwright.firmware_io.recording.recording import recording_writer
from scanwright.firmware_io.samples import JointLog, Scan, blocks

START = 1_436_377_047_737_469_125
angle_deg = st.floats(-180, 180)
length_mm = st.floats(-300, 300)


def angle_set(alpha_rot, beta_rot, gamma_rot, alpha_laser, beta_laser, delta, lever, mount):
    angles = Angles(
        alpha_rot=alpha_rot, beta_rot=beta_rot, gamma_rot=gamma_rot, alpha_laser=alpha_laser, beta_laser=beta_laser
    )
    moved = {"delta_rotvec_rot_deg": delta, "t_rot_laser_mm": lever, "t_world_rot_mm": mount}
    return AngleSet(task="test", angles_deg=angles, sensor="any", servo="any", **moved)


angle_sets = st.builds(
    angle_set,
    *[angle_deg] * 5,
    st.tuples(angle_deg, angle_deg),
    st.tuples(length_mm, length_mm, length_mm),
    st.tuples(length_mm, length_mm, length_mm),
)


def a_scan(rng, stamp_ns, beams=70, increment_s=1e-4):
    range_m = rng.uniform(0.05, 31, beams)
    strange = rng.random(beams) < 0.2
    range_m[strange] = rng.choice([np.nan, np.inf, -np.inf, 0.0], strange.sum())
    return Scan(
        stamp_ns=stamp_ns,
        angle_min_rad=-2.0,
        angle_increment_rad=4.0 / beams,
        time_increment_s=increment_s,
        scan_time_s=0.1,
        range_min_m=0.1,
        range_max_m=30.0,
        range_m=range_m.astype(np.float32),
        intensity=np.empty(0, np.float32),
    )


def a_trajectory(rng, time_ns):
    walk = rng.normal(0, 0.1, (time_ns.size, 6)).cumsum(axis=0)
    pauses = np.maximum.accumulate(np.where(rng.random(time_ns.size) < 0.7, np.arange(time_ns.size), 0))
    walk = walk[pauses]  # sometimes the platform stands still
    sign = rng.choice([1, -1], (time_ns.size, 1))  # a quaternion and its negative are one orientation
    return Trajectory(time_ns, walk[:, :3], sign * Rotation.from_rotvec(walk[:, 3:]).as_quat())


def some_times(rng, count):
    """Increasing times that begin and end inside the scans, and fall anywhere among their beams."""
    return START + np.unique(rng.integers(3_000_000, 47_000_000, count))


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32),
    angles=angle_sets,
    lag_s=st.sampled_from([0.0, 0.003, -0.01]),
    increment_s=st.sampled_from([0.0, 1e-6, 1e-4]),
    moving=st.booleans(),
    mask=st.sampled_from([None, 0, 7]),
)
def test_the_kernel_does_what_its_description_says(seed, angles, lag_s, increment_s, moving, mask):
    rng = np.random.default_rng(seed)
    scans = [a_scan(rng, START + k * 10_000_000, increment_s=increment_s) for k in range(5)]
    log_ns = some_times(rng, 12)
    log = JointLog(log_ns, rng.normal(0, 2, log_ns.size).cumsum() + rng.choice([0, 4000.0]))
    poses = a_trajectory(rng, some_times(rng, 9)) if moving else None
    own_body = None
    if mask is not None:
        own_body = OwnBody(np.linspace(-2, 1, 90), rng.random(90) < 0.1, rng.random((90, mask)) < 0.3)
    (block,) = blocks(scans)
    fast = place_block(block, log, angles, lag_s, poses=poses, own_body=own_body)
    slow = list(place(scans, log, angles, lag_s, poses=poses, own_body=own_body))
    described = np.stack([placed.points_m for placed in slow])
    np.testing.assert_array_equal(fast.verdict, [placed.verdict for placed in slow])
    np.testing.assert_array_equal(np.isnan(fast.points_m).any(axis=2), fast.verdict != Verdict.POINT)
    np.testing.assert_allclose(fast.joint_rad, [placed.joint_rad for placed in slow], rtol=0, atol=1e-11)
    # half a step of float32 at 32 m, and the rest of the 10 um that are allowed is not needed
    np.testing.assert_allclose(fast.points_m, described, rtol=0, atol=2.5e-6)


def test_every_verdict_is_met_by_the_kernel():
    rng = np.random.default_rng(4)
    scans = [a_scan(rng, START + k * 10_000_000) for k in range(5)]
    log = JointLog(START + np.array([8_000_000, 60_000_000]), np.array([0.0, 1.0]))
    poses = a_trajectory(rng, START + np.arange(0, 40_000_000, 1_000_000))
    own_body = OwnBody(np.array([-2.0, 2.0]), np.array([True, False]), np.zeros((2, 0), bool))
    (block,) = blocks(scans)
    angles = angle_set(10, 20, 30, 40, 50, (1, 2), (3, 4, 5), (6, 7, 8))
    verdict = place_block(block, log, angles, poses=poses, own_body=own_body).verdict
    assert set(np.unique(verdict)) == set(Verdict) - {
        Verdict.BETWEEN_SURFACES,
        Verdict.OTHER_ECHO,
    }  # no matters of one beam


@given(st.floats(-1e5, 1e5))
def test_sine_and_cosine_are_as_good_as_they_say(angle):
    # beside the polynomials' 2e-11, an angle of 1e5 rad is itself rounded by 1e-11
    np.testing.assert_allclose(_sin_cos.py_func(angle), (np.sin(angle), np.cos(angle)), rtol=0, atol=3.5e-11)


def test_blocks_keep_order_and_split_where_the_scans_change():
    rng = np.random.default_rng(0)
    sizes = [5, 5, 5, 6, 5, 5]
    found = list(blocks((a_scan(rng, k, beams) for k, beams in enumerate(sizes)), most=2))
    assert [block.stamp_ns.tolist() for block in found] == [[0, 1], [2], [3], [4, 5]]


@pytest.mark.parametrize("increment_s", [-1e-4, np.nan])
def test_beams_that_go_back_in_time_are_refused(increment_s):
    with pytest.raises(RecordingError, match="time_increment_s = "):
        a_scan(np.random.default_rng(0), START, increment_s=increment_s)


# A scanner simulated by other means: rotations of scipy in the order of the paper's section 4.1, motions as formulas.
BEAMS = 180
INCREMENT_S = float(np.float32(1e-4))
FIRST_RAD, STEP_RAD = float(np.float32(-2.2)), float(np.float32(0.0245))


def simulate(seed, speed_deg_s, moving):
    """The angle set as JSON, joint angle and platform as functions of seconds, ranges, and every true point."""
    rng = np.random.default_rng(seed)
    a_rot, b_rot, a_laser, b_laser, gamma_rot = rng.uniform(-180, 180, 5).round(3)
    delta, lever, mount = rng.uniform(-3, 3, 2), rng.uniform(-200, 200, 3), rng.uniform(-500, 500, 3)
    phase = rng.uniform(0, 6, 7)
    ahead = np.radians(speed_deg_s)

    def joint(t):
        return phase[0] + ahead * t + 0.005 * np.sin(ahead * t + phase[1])

    def platform(t):
        if not moving:
            return np.zeros((t.size, 3)), Rotation.identity(t.size)
        p = np.stack([0.8 * t, 0.3 * np.sin(2 * t + phase[2]), 0.05 * np.sin(5 * t + phase[3])], axis=1)
        turn = [0.5 * np.sin(1.5 * t + phase[4]), 0.05 * np.sin(3 * t + phase[5]), 0.04 * np.sin(4 * t + phase[6])]
        return p, Rotation.from_euler("ZYX", np.stack(turn, axis=1))

    scans = 40
    range_m = rng.uniform(0.2, 29.9, (scans, BEAMS)).astype(np.float32)
    t = (np.arange(scans)[:, None] * 0.025 + np.arange(BEAMS) * INCREMENT_S).ravel()
    bearing = np.tile(FIRST_RAD + STEP_RAD * np.arange(BEAMS), scans)
    r = range_m.ravel().astype(float)
    p = np.stack([r * np.cos(bearing), r * np.sin(bearing), np.zeros_like(r)], axis=1)
    laser = Rotation.from_rotvec(np.radians([*delta, 0])) * Rotation.from_euler("YX", [b_laser, a_laser], degrees=True)
    p = laser.apply(p) + lever / 1000
    p = Rotation.from_euler("z", joint(t)[:, None] + np.radians(gamma_rot)).apply(p)
    p = Rotation.from_euler("XY", [a_rot, b_rot], degrees=True).apply(p) + mount / 1000
    where, attitude = platform(t)
    text = {
        "schema": "scanwright/angles/1",
        "task": "simulated",
        "source": "calibration",
        "angles_deg": {
            "alpha_rot": a_rot,
            "beta_rot": b_rot,
            "gamma_rot": gamma_rot,
            "alpha_laser": a_laser,
            "beta_laser": b_laser,
        },
        "delta_rotvec_rot_deg": delta.tolist(),
        "t_rot_laser_mm": lever.tolist(),
        "t_world_rot_mm": mount.tolist(),
        "sensor": "any",
        "servo": "any",
    }
    return json.dumps(text), joint, platform, range_m, attitude.apply(p) + where


@pytest.mark.parametrize(
    ("seed", "speed_deg_s", "moving"), [(1, 20, False), (2, 720, False), (3, -180, True), (4, 720, True), (5, 0, True)]
)
def test_a_simulated_recording_is_within_a_tenth_of_a_millimetre(tmp_path, command, seed, speed_deg_s, moving):
    angles, joint, platform, range_m, true_m = simulate(seed, speed_deg_s, moving)
    (tmp_path / "angles.json").write_text(angles)
    with recording_writer(tmp_path / "r.mcap", {}) as writer:
        for k in range(len(range_m) + 2):
            begin_ns = k * 25_000_000
            for late_ns in range(begin_ns - 25_000_000, begin_ns, 2_500_000):
                writer.joint(START + late_ns, float(joint(late_ns / 1e9)))
            if k < len(range_m):
                writer.scan(a_plain_scan(START + begin_ns, range_m[k]))
    options = []
    if moving:
        late_ns = np.arange(-10_000_000, 1_100_000_000, 2_500_000)  # slower, and going straight is 0.1 mm off
        where, attitude = platform(late_ns / 1e9)
        lines = ["# t x y z qx qy qz qw"]
        for t, p, q in zip((START + late_ns).tolist(), where.tolist(), attitude.as_quat().tolist(), strict=True):
            lines.append(f"{t // 10**9}.{t % 10**9:09} " + " ".join(f"{value:.9f}" for value in [*p, *q]))
        (tmp_path / "poses.txt").write_text("\n".join(lines) + "\n")
        options = ["--poses", tmp_path / "poses.txt"]
    code, printed, complaints = command(
        "assemble", tmp_path / "r.mcap", "--angles", tmp_path / "angles.json", "-o", tmp_path / "c.ply", *options
    )
    assert (code, complaints) == (0, []), complaints
    rows = read_ply(tmp_path / "c.ply")
    found = np.stack([rows[name] for name in "xyz"], axis=1)
    assert np.linalg.norm(found - true_m, axis=1).max() < 1e-4, printed


def a_plain_scan(stamp_ns, ranges):
    return Scan(
        stamp_ns=stamp_ns,
        angle_min_rad=FIRST_RAD,
        angle_increment_rad=STEP_RAD,
        time_increment_s=INCREMENT_S,
        scan_time_s=0.025,
        range_min_m=0.1,
        range_max_m=30.0,
        range_m=ranges,
        intensity=ranges[:0],
    )
