"""The calibration's model: against the assembler, against finite differences, against one big dense least squares."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.firmware_io.recordings.deskew import deskew, place
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.beam_outcome import Verdict
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.calibration.model import (
    BACKLASH,
    COUNT,
    LAG,
    PARAMETERS,
    Mount,
    ReturnedBeams,
    backlash_rad,
    beam_rays,
    gather,
    start_vector,
)
from scanwright.firmware_io.calibration.solve import WIDTH, Grouping, bulge_m, covariance, reduced, sums
from scanwright.firmware_io.calibration.surfaces import group
from scanwright.firmware_io.calibration.tiles import flat_tiles
from scanwright.firmware_io.samples import JointLog, Scan, straight

START = 1_700_000_000_000_000_000
SIZES = np.array([0.1, 0.1, 0.05, 0.05, 0.02, 0.02, 0.02, 0.02, 0.02, 0.03, 0.02])
NAMES = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")
seeds = st.integers(0, 2**32 - 1)


def an_angle_set(rng):
    angles = Angles(**dict(zip(NAMES, rng.uniform(-180, 180, 4).tolist(), strict=True)))
    offset = tuple(rng.uniform(-300, 300, 3).tolist())
    tilt = tuple(rng.uniform(-6, 6, 2).tolist())
    return AngleSet(
        task="t", angles_deg=angles, sensor="s", servo="s", delta_rotvec_rot_deg=tilt, t_rot_laser_mm=offset
    )


def some_beams(rng, count=40):
    log = JointLog(START + np.arange(0, 2_000_000_001, 4_000_000), 0.7 * np.linspace(0, 2, 501) ** 2)
    time_ns = START + np.sort(rng.integers(300_000_000, 1_700_000_000, count))
    none = np.zeros(count, np.int64)
    columns = (rng.uniform(1, 9, count), rng.uniform(-2, 2, count), np.zeros(count), np.zeros(count))
    return ReturnedBeams(*columns, none, none, time_ns, (straight(log),)).late_by(0.0)


class Recorded:
    """A recording that was never a file."""

    path = "r.mcap"
    at_rest = False

    def __init__(self, scans, joint_log):
        self.joint_log = joint_log
        self._scans = scans

    def scans(self):
        return iter(self._scans)


@settings(deadline=None, max_examples=30)
@given(seed=seeds)
def test_it_places_points_where_the_assembler_does(seed):
    rng = np.random.default_rng(seed)
    angles = an_angle_set(rng)
    scan = Scan(
        stamp_ns=START + 10**9,
        angle_min_rad=-2.0,
        angle_increment_rad=0.1,
        time_increment_s=1e-3,
        scan_time_s=0.1,
        range_min_m=0.1,
        range_max_m=30.0,
        range_m=rng.uniform(0.2, 29, 40).astype(np.float32),
        intensity=np.empty(0, np.float32),
    )
    log = JointLog(START + np.array([0, 2 * 10**9]), np.array([0.0, 5.0]))
    beams, left_out = gather([Recorded([scan], log)], one_place=True)
    assert left_out == {}
    origin, direction = beam_rays(Mount.of(angles), start_vector(angles), beams)
    T_world_rot = angles.T_world_rot(0.0)
    points = (origin + beams.range_m[:, None] * direction) @ T_world_rot[:3, :3].T + T_world_rot[:3, 3]
    np.testing.assert_allclose(points, deskew(scan, log, angles), atol=1e-7)


@settings(deadline=None, max_examples=10)
@given(seed=seeds)
def test_it_leaves_out_the_beams_that_the_assembler_does(seed):
    rng = np.random.default_rng(seed)
    angles = an_angle_set(rng)
    turned = angles.angles_deg.model_copy(update={"gamma_rot": float(rng.uniform(-180, 180))})
    angles = angles.model_copy(update={"angles_deg": turned})
    range_m = rng.choice([0.0, 0.01, np.nan, np.inf, 40.0, 1.0, 2.0, 3.0, 5.0, 8.0], 60).astype(np.float32)
    scan = Scan(
        stamp_ns=START + 10**9,
        angle_min_rad=-2.0,
        angle_increment_rad=0.05,
        time_increment_s=2e-2,
        scan_time_s=2.0,
        range_min_m=0.1,
        range_max_m=30.0,
        range_m=range_m,
        intensity=np.empty(0, np.float32),
    )
    log = JointLog(START + np.array([0, 2 * 10**9]), np.array([0.0, 5.0]))
    own_body = OwnBody(np.linspace(-2, 1, 50), rng.random(50) < 0.3, rng.random((50, 24)) < 0.5)
    placed = next(place([scan], log, angles, own_body=own_body))
    keep = placed.verdict == Verdict.POINT
    gamma_rot_rad = np.radians(angles.angles_deg.gamma_rot)
    beams, left_out = gather([Recorded([scan], log)], one_place=True, own_body=own_body, gamma_rot_rad=gamma_rot_rad)
    np.testing.assert_array_equal(beams.time_ns, scan.time_ns[keep])
    assert left_out["own_body"] == np.sum(placed.verdict == Verdict.OWN_BODY) > 0
    assert sum(left_out.values()) == 60 - keep.sum()


def residuals(mount, x, beams, q):
    late = beams.late_by(x[LAG[0]])
    origin, direction = beam_rays(mount, x, late)
    return late.range_m + x[4] - (1 - origin @ q) / (direction @ q)


@settings(deadline=None, max_examples=30)
@given(seed=seeds)
def test_its_derivatives_are_those_of_finite_differences(seed):
    rng = np.random.default_rng(seed)
    mount, x, beams = Mount.of(an_angle_set(rng)), rng.uniform(-1, 1, COUNT) * SIZES, some_beams(rng, 1)
    q = beam_rays(mount, x, beams)[1][0] + rng.uniform(-0.5, 0.5, 3)  # a plane that the beam meets at no grazing angle
    q /= 5
    rows = sums(mount, x, beams.late_by(x[LAG[0]]), np.zeros(1, np.int64), np.ones(1), q[None], np.inf)[0]
    e = residuals(mount, x, beams, q)[0]
    np.testing.assert_allclose(rows[-1, -1], e**2, rtol=1e-6)
    for k in range(COUNT):
        h = 1e-6 if k not in LAG else 1e-4
        low, high = (residuals(mount, x + s * h * np.eye(COUNT)[k], beams, q)[0] for s in (-1, 1))
        # the joint's speed is a mean over 40 ms, and its angle is logged every 4 ms
        np.testing.assert_allclose(rows[k, -1] / e, (high - low) / (2 * h), rtol=0.02 if k in LAG else 1e-4, atol=1e-4)
    for k in range(3):
        low, high = (residuals(mount, x, beams, q + s * 1e-6 * np.eye(3)[k])[0] for s in (-1, 1))
        np.testing.assert_allclose(rows[COUNT + k, -1] / e, (high - low) / 2e-6, rtol=1e-4, atol=1e-4)


@settings(deadline=None, max_examples=30)
@given(seed=seeds)
def test_at_even_speed_the_derivative_by_the_lag_is_exact(seed):
    """Where the log is straight no mean of its speed blurs it, and each harmonic shows."""
    rng = np.random.default_rng(seed)
    log = JointLog(START + np.array([0, 2 * 10**9]), np.array([0.0, 1.4]))
    beam, none = some_beams(rng, 1), np.zeros(1, np.int64)
    beams = ReturnedBeams(
        beam.range_m, beam.bearing_rad, np.zeros(1), np.zeros(1), none, none, beam.time_ns, (straight(log),)
    ).late_by(0.0)
    mount, x = Mount.of(an_angle_set(rng)), rng.uniform(-1, 1, COUNT) * SIZES
    x[5:9] = rng.uniform(-0.2, 0.2, 4)
    q = beam_rays(mount, x, beams)[1][0] + rng.uniform(-0.5, 0.5, 3)
    q /= 5
    rows = sums(mount, x, beams.late_by(x[LAG[0]]), np.zeros(1, np.int64), np.ones(1), q[None], np.inf)[0]
    step = 1e-4 * np.eye(COUNT)[LAG[0]]
    low, high = (residuals(mount, x + sign * step, beams, q)[0] for sign in (-1, 1))
    derivative = rows[LAG[0], -1] / residuals(mount, x, beams, q)[0]
    np.testing.assert_allclose(derivative, (high - low) / 2e-4, rtol=1e-4, atol=1e-5)


@settings(deadline=None, max_examples=30)
@given(seed=seeds, bulge=st.sampled_from([0.0, 0.003, 1.0]))
def test_eliminating_planes_and_bulges_is_one_dense_least_squares(seed, bulge):
    rng = np.random.default_rng(seed)
    surface, spot = np.array([0, 0, 0, 0, 1, 1, 1, -1]), np.array([0, 1, 1, 2, 3, 3, 4, 9])
    A = rng.normal(size=(8, 30, WIDTH))
    normal = np.einsum("tni,tnj->tij", A, A)
    free = np.array([0, 1, 3])
    part = reduced(normal, Grouping(surface, spot, np.ones((2, 3))), free, bulge)
    rows, right = [], []
    for t in np.flatnonzero(surface >= 0):
        wide = np.zeros((30, 3 + 6 + 5))
        wide[:, :3] = A[t][:, free]
        wide[:, 3 + 3 * surface[t] : 6 + 3 * surface[t]] = A[t][:, COUNT : COUNT + 3]
        if bulge:
            wide[:, 9 + spot[t]] = A[t][:, COUNT + 3]
        rows.append(wide)
        right.append(A[t][:, -1])
    J, e = np.concatenate(rows), np.concatenate(right)
    whole = J.T @ J + np.diag([0.0] * 9 + [1 / bulge**2 if bulge else 1.0] * 5)
    np.testing.assert_allclose(covariance(part), np.linalg.inv(whole)[:3, :3], rtol=1e-6, atol=1e-12)
    solution = -np.linalg.solve(whole, J.T @ e)
    dx = np.linalg.solve(part.information, -part.right)
    np.testing.assert_allclose(dx, solution[:3], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose((part.plane_rows @ np.append(dx, 1.0)).ravel(), solution[3:9], rtol=1e-5, atol=1e-9)


def test_what_is_not_known_at_all_is_infinite_and_the_rest_is_not():
    part = replace(
        reduced(
            np.zeros((3, WIDTH, WIDTH)),
            Grouping(np.zeros(3, int), np.zeros(3, int), np.ones((1, 3))),
            np.array([0]),
            0.0,
        ),
        information=np.array([[4.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, 1.0]]),
        right=np.zeros(3),
    )
    np.testing.assert_allclose(np.diag(covariance(part)), [0.25, np.inf, np.inf])


@pytest.mark.parametrize("true_m", [0.0, 0.002, 0.01])
def test_the_bulge_of_walls_is_found_through_the_noise(true_m):
    rng = np.random.default_rng(1)
    noise_m, spots = 0.001, 2000
    height = rng.normal(0, np.hypot(true_m, noise_m), spots)
    normal = np.zeros((spots, WIDTH, WIDTH))
    normal[:, COUNT + 3, COUNT + 3] = 1 / noise_m**2
    normal[:, COUNT + 3, -1] = normal[:, -1, COUNT + 3] = height / noise_m**2
    grouping = Grouping(np.zeros(spots, int), np.arange(spots), np.ones((1, 3)))
    assert bulge_m(normal, grouping) == pytest.approx(true_m, rel=0.1, abs=0.0004)


def test_tiles_hold_flat_looks_of_one_pass():
    rng = np.random.default_rng(3)
    angles = AngleSet(
        task="t", angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=90, beta_laser=0), sensor="s", servo="s"
    )
    mount, x = Mount.of(angles), np.zeros(COUNT)
    time_s = np.arange(0, 8, 2e-4)
    joint = 0.3 * (4 - np.abs(time_s - 4))  # there and back
    bearing = np.tile(np.linspace(0.2, 1.2, 200), 200)
    log = JointLog(START + np.rint(time_s * 1e9).astype(np.int64), joint)
    none = np.zeros(time_s.size, np.int64)
    beams = ReturnedBeams(
        np.ones(time_s.size), bearing, joint, joint, none, none, log.time_ns, (straight(log),)
    ).late_by(0.0)
    _, direction = beam_rays(mount, x, beams)
    range_m = np.where(joint < 0.6, 3 / direction[:, 0], 1 / direction[:, 0]) + rng.normal(0, 0.01, time_s.size)
    tiles = flat_tiles(replace(beams, range_m=range_m), mount, x)
    assert tiles.noise_m == pytest.approx(0.01, rel=0.1)
    assert tiles.dropped < 0.2 * time_s.size
    edge = np.add.reduceat(tiles.beams.joint_rad < 0.6, tiles.start[:-1]) / tiles.count
    assert np.isin(edge, [0.0, 1.0]).all()
    there = np.add.reduceat(tiles.beams.time_ns < START + 4 * 10**9, tiles.start[:-1]) / tiles.count
    assert np.isin(there, [0.0, 1.0]).all()
    # the wall's normal is x of the world, towards the laser
    turned = tiles.normal_laser @ angles.R_rot_laser().T
    facing = np.cos(tiles.middle.joint_rad) * turned[:, 0] - np.sin(tiles.middle.joint_rad) * turned[:, 1]
    assert (facing < -np.cos(5 * tiles.normal_sd_rad + 1e-3)).all()
    with pytest.raises(RecordingError, match="no flat patches lie in one plane"):  # as of scans far apart
        group(replace(tiles, normal_sd_rad=np.full(tiles.count.size, 1.0)), mount, x, 0.02, 0.1, 0.1)


def test_every_parameter_is_named_once():
    assert len({p.name for p in PARAMETERS}) == COUNT == BACKLASH[0] + 1


def test_the_play_that_may_hide_in_a_lag_is_that_of_the_servo():
    plays = {servo: np.degrees(backlash_rad(servo)) for servo in ("MX-64R", "STS3215", "XL330-M288", "home-made")}
    assert plays["MX-64R"] == pytest.approx(0.333)
    assert plays["STS3215"] == pytest.approx(0.9)
    assert plays["XL330-M288"] == plays["home-made"] == pytest.approx(0.9)  # nobody tells it: the most of any
