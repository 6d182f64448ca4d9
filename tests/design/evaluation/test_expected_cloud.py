"""The error of a point against random scans through the frame chain; the widest gap against all beams of a scan."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from scanwright.design.catalogue.servo import Servo
from scanwright.design.density.beams import scan_at
from scanwright.design.evaluation.expected_cloud import expected_cloud, expected_error
from scanwright.design.evaluation.gaps import WIDE, gaps
from scanwright.design.evaluation.missed_object import missed_object
from scanwright.design.findings import Finding
from scanwright.design.frames import rotvec_to_matrix
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.sphere.directions import spiral, weighted_samples
from scanwright.design.task.task import load_task

SPIN = {"period_s": 18.0}
SWEEP = {"mode": "sweep", "limits_deg": [-90, 90], "period_s": 12.0, "accel_deg_s2": 200.0}
SHAPES = [
    {"shape": "all"},
    {"shape": "cone", "axis": [1, 0, -1], "half_angle_deg": 40},
    {"shape": "ground", "from_m": 0.5, "to_m": 5, "width_m": 4, "height_m": 0.4},
]
BEND = Finding("deflection_turning", "ok", "alignment_linkage", "bend", 0.05, 0.06, "deg")
HELD = Finding("flanks", "ok", "servo", "gravity", 0.1)
FRICTION = Finding("flanks", "ok", "servo", "gravity", 0.001, 0.005)
LOOSE = Finding("flanks", "warning", "servo", "gravity", 0.1, 0.005)


def task(motion=SPIN, servo="MX-64R", sensor="UTM-30LX", weight=SHAPES[0], **keys):
    ring = {"slip_ring": "SNU11-P0210"} if motion is SPIN else {}
    table = {"name": "t", "sensor": sensor, "servo": servo, "motion": motion, "weight": [weight]} | ring | keys
    return load_task(table)


def expected(loaded, angles_deg, checks=(), **keys):
    return expected_error(loaded, problem_of(loaded), np.radians(angles_deg), checks, **keys)


@pytest.mark.parametrize("seed", range(3))
def test_errors_are_those_of_points_moved_through_the_frame_chain(seed):
    rng = np.random.default_rng(seed)
    loaded = task(SWEEP, rng.choice(["MX-64R", "STS3215"]), rng.choice(["UTM-30LX", "LD19"]), SHAPES[seed % 3])
    angles = loaded.angle_set(rng.uniform(-90, 90, 4).round(1))
    servo, lidar, at_m = loaded.servo, loaded.lidar, float(rng.uniform(1, 6))
    result = expected(loaded, [getattr(angles.angles_deg, n) for n in ORDER], (BEND, FRICTION), at_m=at_m)

    field = problem_of(loaded).field
    drawn = spiral(20_000)
    drawn = drawn[field.weight_at(drawn) > 0]
    drawn = drawn[rng.integers(len(drawn), size=4000)]
    joint = rng.uniform(-1.5, 1.5, len(drawn))
    true = angles.T_world_laser(joint)
    beams = np.einsum("nji,nj->ni", true[:, :3, :3], drawn)

    def rms(joint_error=0.0, range_error_m=0.0, tilt_rad=0.0):
        ranges = at_m + range_error_m * np.ones(len(drawn))
        moved = beams
        if tilt_rad:
            across = np.cross(beams, rng.normal(size=beams.shape))
            across /= np.linalg.norm(across, axis=1, keepdims=True)
            turns = np.array([rotvec_to_matrix(tilt_rad * each) for each in across])
            moved = np.einsum("nij,nj->ni", turns, beams)
        wrong = angles.T_world_laser(joint + joint_error)
        points = np.einsum("nij,nj->ni", wrong[:, :3, :3], moved * ranges[:, None])
        return 1000 * float(np.sqrt(np.mean(np.sum((points - at_m * drawn) ** 2, axis=1))))

    n = len(drawn)
    noise = rng.normal(size=n) * lidar.sigma_mm(1000 * at_m) / 1000
    steps = np.radians(servo.position_step_deg) * rng.uniform(-0.5, 0.5, n)
    play = np.radians(servo.backlash_deg) / 2 * rng.choice([-1, 1], n)
    assert result.range_noise_mm == pytest.approx(rms(range_error_m=noise), rel=0.03)
    assert result.encoder_mm == pytest.approx(rms(steps), rel=0.03)
    assert result.backlash_mm == pytest.approx(rms(play), rel=0.03)
    assert result.bending_mm == pytest.approx(rms(tilt_rad=np.radians(BEND.value)), rel=0.01)
    assert result.total_mm == pytest.approx(rms(steps + play, noise, np.radians(BEND.value)), rel=0.03)


ORDER = "alpha_rot", "beta_rot", "alpha_laser", "beta_laser"


@pytest.mark.parametrize(
    ("motion", "checks", "counts", "calibrated"),
    [
        (SPIN, (), False, False),
        (SPIN, (FRICTION,), False, False),
        (SPIN, (LOOSE,), True, False),
        (SWEEP, (), True, True),
        (SWEEP, (FRICTION,), True, True),
        (SWEEP, (HELD,), False, False),
        (SWEEP, (LOOSE,), True, False),
    ],
)
def test_backlash_counts_if_the_servo_turns_both_ways_or_gravity_changes_the_flank(motion, checks, counts, calibrated):
    result = expected(task(motion), (0, 45, 90, 0), checks)
    assert (result.backlash_mm > 0, result.backlash_calibrated) == (counts, calibrated)
    assert ("until calibrated" in result.words()) == calibrated


def test_an_unknown_backlash_is_named_and_bounded_by_the_largest_known_one():
    assert task(servo="XL430-W250", motion=SWEEP).products.get("XL430-W250", Servo).backlash_deg is None
    result = expected(task(SWEEP, "XL430-W250", "LD19"), (0, 0, 0, 45))
    assert result.backlash_mm is None and result.bending_mm is None
    assert result.words().startswith("expect 10 to 22 mm at 3 m (range noise 10, servo backlash unknown, ")
    known = expected(task(SWEEP, "STS3215", "LD19"), (0, 0, 0, 45))
    assert result.most_mm == pytest.approx(known.total_mm, rel=0.01)  # STS3215 has the largest one
    near = replace(result, backlash_mm=0.0, backlash_calibrated=False)
    assert near.words().startswith("expect about 10 mm at 3 m (range noise 10, encoder steps ")


def widest_deg(loaded, angles_rad):
    """Largest angle across from a direction of the region to its nearest beam and as far again, by brute force."""
    problem = problem_of(loaded)
    joint = problem.lines.angles_rad if problem.sweep is None else problem.sweep.angles_rad(0.5)
    beams = scan_at(problem.bearings_rad, joint, angles_rad)
    drawn = spiral(40_000)  # a degree apart
    drawn = drawn[problem.field.weight_at(drawn) > 0]
    near = [float((beams @ each).max()) for each in drawn]
    return 2 * float(np.degrees(np.arccos(min(near))))


@pytest.mark.parametrize(
    ("angles_deg", "weight", "warns"),
    [
        ((0, 90, 0, -90), {"shape": "cone", "axis": [0, 0, -1], "half_angle_deg": 6}, False),
        ((0, -55.68, -78.49, 80), {"shape": "cone", "axis": [1, 0, -0.69], "half_angle_deg": 6}, True),
    ],
)
def test_a_gap_much_wider_than_the_lines_is_a_finding(angles_deg, weight, warns):
    loaded, angles_rad = task(weight=weight), np.radians(angles_deg)
    problem = problem_of(loaded)
    gap = expected_cloud(loaded, problem, angles_rad, score(problem, angles_rad)).wide_gap
    wide = widest_deg(loaded, angles_rad)
    assert (gap is not None) == warns == (wide > WIDE * 0.5)
    if gap is not None:
        assert (gap.code, gap.severity, gap.unit) == ("wide_gap", "warning", "deg")
        assert gap.limit == pytest.approx(WIDE * 0.5, rel=0.01)
        cone = gaps(problem_of(loaded), angles_rad).blind_cones[-1]
        assert wide <= gap.value == pytest.approx(2 * cone.half_angle_deg, rel=0.05)


def test_a_ball_as_wide_as_the_smallest_object_turns_the_gap_into_a_blind_spot():
    """`new --see thing:SIZE:DISTANCE` sets this ball: the search then avoids such gaps, and reports what is left."""
    weight = {"shape": "cone", "axis": [1, 0, -0.69], "half_angle_deg": 6}
    loaded = task(weight=weight, density={"ball_radius_deg": 1.0})
    problem, angles_rad = problem_of(loaded), np.radians((0, -55.68, -78.49, 80))
    cloud = expected_cloud(loaded, problem, angles_rad, score(problem, angles_rad))
    assert cloud.wide_gap is None and cloud.missed_object is None, "its blind spot is stated elsewhere"


def fewest(loaded, angles_rad, rng):
    """Return the lowest count of beams in a ball over random directions of the region and random start phases."""
    problem, lowest = problem_of(loaded), np.inf
    directions = weighted_samples(problem.field, 4000, turn_rad=rng.uniform(0, 6)).directions
    for start in rng.uniform(0, 1, 6):
        joint_rad = problem.lines.angles_rad + start * problem.lines.step_rad
        if problem.sweep is not None:
            joint_rad = problem.sweep.angles_rad(start)
        tree = cKDTree(scan_at(problem.bearings_rad, joint_rad, angles_rad, problem.lever))
        counts = tree.query_ball_point(directions, 2 * np.sin(problem.ball_rad / 2), return_length=True)
        lowest = min(lowest, counts.min())
    return lowest


@pytest.mark.parametrize("motion", [{"period_s": 2.5}, SWEEP | {"period_s": 5.0}])
def test_an_object_that_can_be_missed_is_named_with_the_period_that_hits_it(motion):
    rng, missed = np.random.default_rng(7), 0
    ring = {} if "mode" in motion else {"slip_ring": "SNU11-P0210"}
    for radius_deg in rng.permutation([0.8, 1.2, 6.0, 15.0]):
        density = {"ball_radius_deg": float(radius_deg)}
        loaded = task(motion, sensor="LD19", weight=SHAPES[2], density=density, **ring)
        angles_rad = np.radians((0, 0, *rng.uniform(40, 60, 2)))
        problem = problem_of(loaded)
        own = score(problem, angles_rad)
        warning = missed_object(loaded, angles_rad, own)
        if warning is None:
            assert own.blind_weight > 1e-9 or fewest(loaded, angles_rad, rng) > 0
            continue
        missed += 1
        assert (warning.code, warning.severity, warning.value) == ("missed_object", "warning", 0)
        assert f"({2 * radius_deg:.2g} deg)" in warning.message
        period_s = float(warning.hint.split("period_s = ")[1].split()[0])
        slower = task(motion | {"period_s": period_s}, sensor="LD19", weight=SHAPES[2], density=density, **ring)
        assert fewest(slower, angles_rad, rng) > 0
    assert 0 < missed < 4
    usual = task(motion, sensor="LD19", weight=SHAPES[2], **ring)
    assert missed_object(usual, angles_rad, replace(own, least=0, blind_weight=0.0)) is None, "it states no size"
