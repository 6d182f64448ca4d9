"""Counts in closed form against brute force: every beam of every line, one dot product each."""

from itertools import product
from math import cos, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from quick_tests import samples
from scans import count_at, simulated_scan
from scipy.spatial.transform import Rotation

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.density.beams import ScanLines, beam_directions_rot, polar_and_azimuth, scan_lines
from scanwright.design.density.phase_walk import sort_by_buckets
from scanwright.design.density.spin import ball_search, mean_count, phase_statistics
from scanwright.design.frames import R_world_rot
from scanwright.design.objective import ball_search as oracle
from scanwright.design.objective.named_objectives import log_density
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.sphere import directions
from scanwright.design.sphere.directions import weighted_samples
from scanwright.design.task.task import load_task

GIMBAL = [(0, 90), (0, -90), (90, 0), (0, 0), (45, 0), (90, 90), (-90, -90), (30, 90)]


@pytest.fixture(scope="module")
def utm():
    return load_catalogue().get("UTM-30LX", Lidar).bearings_rad()


def around(polar, azimuth):
    polar, azimuth = np.broadcast_arrays(polar, azimuth)
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)


def angles_between(beams, directions):
    """All angles, from chords: exact for small angles too. Shape (directions, beams)."""
    chords = np.linalg.norm(directions[:, None, :] - beams[None, :, :], axis=2)
    return 2 * np.arcsin(np.minimum(chords / 2, 1))


def brute_counts(beam_polar, beam_azimuth, lines, directions, ball_rad):
    """Beams within the ball of each direction, one scan line and one beam after the other; and the doubtful ties."""
    scan = around(beam_polar[None, :], beam_azimuth[None, :] + lines.angles_rad[:, None]).reshape(-1, 3)
    angle = angles_between(scan, directions)
    return (angle <= ball_rad).sum(axis=1), (np.abs(angle - ball_rad) < 1e-9).sum(axis=1)


def random_beams(rng):
    """Polar angles and azimuths of some fan: symmetrical or not, of a few beams or many, gimbal-locked or not."""
    count = int(rng.integers(1, 40))
    bearings = np.sort(rng.uniform(-pi, pi, count)) if rng.random() < 0.5 else np.linspace(-2.3, 2.3, count)
    plane = GIMBAL[rng.integers(len(GIMBAL))] if rng.random() < 0.4 else rng.uniform(-90, 90, 2)
    return polar_and_azimuth(beam_directions_rot(bearings, *np.radians(plane)))


def random_lines(rng):
    """From one line, also less than one, to 40; every second time T f is no integer."""
    turns = rng.uniform(0.3, 40)
    return scan_lines(max(round(turns), 1) if rng.random() < 0.5 else turns, 1.0)


def random_ball(rng):
    return float(np.radians(np.exp(rng.uniform(np.log(0.01), np.log(90)))))


@pytest.mark.parametrize("seed", samples(range(30), range(4)))
def test_floor_and_ceil_count_what_the_ball_search_counts(seed):
    rng = np.random.default_rng(seed)
    polar, azimuth = random_beams(rng)
    lines, ball = random_lines(rng), random_ball(rng)
    # half of the directions sit close to a beam, so that small balls are not all empty
    b, k = rng.integers(len(polar), size=20), rng.integers(lines.count, size=20)
    t = np.concatenate([rng.uniform(0, pi, 20), np.abs(polar[b] + rng.normal(0, ball, 20)) % pi])
    p = np.concatenate([rng.uniform(-pi, pi, 20), azimuth[b] + lines.step_rad * k + rng.normal(0, ball, 20)])
    expected, ties = brute_counts(polar, azimuth, lines, around(t, p), ball)
    counted = np.array([count_at(ti, pi_, polar, azimuth, lines, ball) for ti, pi_ in zip(t, p, strict=True)])
    assert expected.max() > 0
    np.testing.assert_array_less(np.abs(counted - expected), ties + 1)


@pytest.mark.parametrize("seed", range(10))
def test_the_kd_tree_counts_what_the_double_loop_counts(seed):
    rng = np.random.default_rng(seed)
    beams = Rotation.random(300, random_state=seed).apply([0, 0, 1.0])
    directions = Rotation.random(50, random_state=seed + 1).apply([0, 0, 1.0])
    ball = float(rng.choice([radians(0.5), radians(20), radians(90), radians(150)]))
    expected = (angles_between(beams, directions) <= ball).sum(axis=1)
    np.testing.assert_array_equal(ball_search(beams, directions, ball), expected)


@pytest.mark.parametrize("setting_deg", [(0, 90, 0, -90), (30, -50, 20, 70)])
@pytest.mark.parametrize("ball_deg", [0.01, 2.0])
def test_the_whole_chain_counts_what_the_paper_s_ball_search_counts(utm, setting_deg, ball_deg):
    """World directions, a full simulated scan of the UTM-30LX, the kd-tree: against `count_at` about the axis."""
    setting, lines, ball = np.radians(setting_deg), scan_lines(0.73, 40.0), radians(ball_deg)
    scan = simulated_scan(utm, lines, setting)
    rng = np.random.default_rng(7)
    some = scan[rng.integers(len(scan), size=30)] + rng.normal(0, ball / 2, (30, 3))
    directions = some / np.linalg.norm(some, axis=1)[:, None]
    polar, azimuth = polar_and_azimuth(beam_directions_rot(utm, *setting[2:]))
    t, p = polar_and_azimuth(directions @ R_world_rot(*setting[:2]))
    counted = [count_at(ti, pi_, polar, azimuth, lines, ball) for ti, pi_ in zip(t, p, strict=True)]
    np.testing.assert_array_equal(counted, ball_search(scan, directions, ball))


def exact_over_phases(t, polar, azimuth, lines, ball, g):
    """mean g, mean, least and most count: the turn is cut at every window edge, each piece counted by dot products."""
    start = azimuth[None, :] + lines.angles_rad[:, None]
    across = np.cos(ball) - np.cos(t) * np.cos(polar)
    along = np.sin(t) * np.sin(polar)
    met = np.abs(across) < along
    half = np.arccos(across[met] / along[met])
    cuts = np.concatenate([[0, 2 * pi], *((start[:, met] + sign * half) % (2 * pi) for sign in (-1, 1))], axis=None)
    cuts = np.unique(cuts)
    widths = np.diff(cuts)
    pieces = widths > 1e-9
    counts, _ = brute_counts(polar, azimuth, lines, around(t, (cuts[:-1] + widths / 2)[pieces]), ball)
    share = widths[pieces] / widths[pieces].sum()
    return share @ g[counts], share @ counts, counts.min(), counts.max()


@pytest.mark.parametrize("seed", samples(range(40), range(6)))
def test_zones_are_exact_over_all_start_phases(seed):
    rng = np.random.default_rng(1000 + seed)
    polar, azimuth = random_beams(rng)
    lines, ball = random_lines(rng), random_ball(rng)
    g = log_density(np.arange(lines.count * len(polar) + 1.0))
    near = np.clip(polar[rng.integers(len(polar), size=4)] + rng.uniform(-1, 1, 4) * ball, 0, pi)
    t = np.concatenate([rng.uniform(0, pi, 3), near, [1e-9, pi - 1e-9]])
    z = phase_statistics(t, polar, azimuth, lines, ball, log_density)
    for i, ti in enumerate(t):
        mean_g, mean, least, most = exact_over_phases(ti, polar, azimuth, lines, ball, g)
        assert z.mean_g[i] == pytest.approx(mean_g, abs=2e-6), np.degrees(ti)
        assert z.mean[i] == pytest.approx(mean, rel=1e-6, abs=1e-6)
        assert (z.least[i], z.most[i]) == (least, most)
    np.testing.assert_allclose(z.mean, mean_count(t, polar, lines, ball), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("plane_deg", GIMBAL)
@pytest.mark.parametrize("turns", samples([720, 80, 68, 12.4, 1, 0.8], [720, 68, 12.4, 0.8]))
@pytest.mark.parametrize("ball_deg", [1.0, 2.0])
def test_polar_angles_where_window_edges_meet_lines_are_no_exception(utm, plane_deg, turns, ball_deg):
    """Round angles, round beams, round lines: edges tie with lines by the hundred, and their mean must still add up.

    With g the identity, the mean of g of the count is the mean count.
    """
    polar, azimuth = polar_and_azimuth(beam_directions_rot(utm, *np.radians(plane_deg)))
    lines = scan_lines(turns, 1.0)
    t = np.radians(np.arange(0, 181.0))
    z = phase_statistics(t, polar, azimuth, lines, radians(ball_deg), np.positive)
    expected = mean_count(t, polar, lines, radians(ball_deg))
    np.testing.assert_allclose(z.mean_g, expected, rtol=1e-6, atol=1e-6)
    assert (z.least <= expected + 1e-6).all()
    assert (z.most >= expected - 1e-6).all()


def test_the_scan_plane_across_the_axis_has_its_mean_count_in_closed_form(utm):
    """All beams on the equator: within the ball of an equatorial direction lie 2 * ball of every beam's circle."""
    lines = scan_lines(18.0, 40.0)
    polar, _ = polar_and_azimuth(beam_directions_rot(utm, 0.0, 0.0))
    t = np.array([pi / 2, pi / 2 + radians(1.2), pi / 2 + radians(2.1)])
    off = np.arccos(cos(radians(2)) / cos(radians(1.2)))
    expected = 1081 * 720 * np.array([radians(2), off, 0]) / pi
    np.testing.assert_allclose(mean_count(t, polar, lines, radians(2)), expected, rtol=1e-9)


@pytest.mark.parametrize("ball_deg", [0.5, 2.0, 30.0, 90.0])
def test_a_beam_on_the_axis_counts_with_every_line_near_it_and_with_none_elsewhere(ball_deg):
    lines, ball = ScanLines(count=7, step_rad=2 * pi / 7), radians(ball_deg)
    t = np.array([0.0, 0.999 * ball, min(1.001 * ball, pi), pi])
    z = phase_statistics(t, np.zeros(1), np.zeros(1), lines, ball, log_density)
    np.testing.assert_array_equal(z.mean, [7, 7, 0, 0])
    np.testing.assert_array_equal(z.least, [7, 7, 0, 0])
    np.testing.assert_array_equal(z.most, [7, 7, 0, 0])
    np.testing.assert_allclose(z.mean_g, log_density(np.array([7, 7, 0, 0])))


@pytest.mark.parametrize("seed", samples(range(40), range(4)))
def test_all_counts_together_are_all_beams_times_the_share_of_a_cap(utm, seed):
    """`int <d> dO / 4 pi = beams * lines * (1 - cos ball) / 2`: the cap of each beam is that share."""
    rng = np.random.default_rng(seed)
    plane = GIMBAL[seed] if seed < len(GIMBAL) else rng.uniform(-90, 90, 2)
    polar, _ = polar_and_azimuth(beam_directions_rot(utm, *np.radians(plane)))
    lines = scan_lines(float(rng.choice([18.0, 2.0, 1.234])), 40.0)
    ball = radians(float(rng.choice([1.0, 2.0, 10.0, 60.0])))
    t = pi * (np.arange(20_000) + 0.5) / 20_000
    total = (mean_count(t, polar, lines, ball) * np.sin(t)).sum() * pi / 20_000 / 2
    assert total == pytest.approx(len(utm) * lines.count * (1 - cos(ball)) / 2, rel=1e-4)


def test_another_start_phase_is_the_same_scan_turned_about_the_axis(utm):
    setting, lines = np.radians([30, -50, 20, 70]), scan_lines(0.73, 40.0)
    axis = R_world_rot(*setting[:2])[:, 2]
    turned = Rotation.from_rotvec(0.3 * axis).apply(simulated_scan(utm, lines, setting))
    np.testing.assert_allclose(simulated_scan(utm, lines, setting, 0.3), turned, atol=1e-12)


# ---- three weights, two periods, two balls ----

SETTINGS = np.random.default_rng(2016).uniform([-180, -90, -90, -90], [180, 90, 90, 90], (12, 4))
SETTINGS[:8] = [
    (0, 90, 0, -90),
    (-90, 0, 90, 0),
    (20, 30, 0, 0),
    (20, 90, 35, 0),
    (20, -90, 35, 10),
    (-50, 10, 35, 90),
    (-50, 10, 35, -90),
    (180, 0, 0, 90),
]  # the standard alignments, the scan plane across the axis, both kinds of gimbal lock
CHUNKS = 4
TASK = """name = "t"
sensor = "UTM-30LX"
servo = "MX-64R"
slip_ring = "UH1256-02-0610-06S"
[motion]
period_s = {period_s}
[density]
ball_radius_deg = {ball_deg}
"""
FIELDS = {
    "ground_ahead": '[[weight]]\nshape = "band"\ntheta_deg = [95, 150]\nphi_deg = [-60, 60]\n'
    '[[mask]]\nshape = "cone"\naxis = [-1.0, 0.0, -0.5]\nhalf_angle_deg = 25\n',
    "uniform": '[[weight]]\nshape = "all"\n',
    "one degree": '[[weight]]\nshape = "cone"\naxis = [0.7, -0.2, -0.3]\nhalf_angle_deg = 0.5\n',
}


@pytest.fixture(scope="module")
def problems(tmp_path_factory):
    made = {}
    for field, period_s, ball_deg in product(FIELDS, (18.0, 2.0), (1.0, 2.0)):
        path = tmp_path_factory.mktemp("tasks") / "task.toml"
        path.write_text(TASK.format(period_s=period_s, ball_deg=ball_deg) + FIELDS[field], encoding="utf-8")
        made[field, period_s, ball_deg] = problem_of(load_task(path))
    return made


@pytest.fixture(scope="module")
def samples_are_kept():
    """The oracle's directions depend on the weight alone: find them once, a region of one degree takes a long look."""
    kept = {}

    def once(field, wanted, **moved):
        key = (field.weight.rows.tobytes(), wanted, *moved.values())
        if key not in kept:
            kept[key] = weighted_samples(field, wanted, **moved)
        return kept[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(directions, "weighted_samples", once)
        yield


def directions_within(name, field):
    """48 random directions of a field; but for the region of one degree, each independent of the others."""
    rng = np.random.default_rng(len(name))
    if name == "one degree":
        centre = np.array([0.7, -0.2, -0.3]) / np.linalg.norm([0.7, -0.2, -0.3])
        d = centre + rng.normal(0, radians(0.2), (3000, 3))
    else:
        d = rng.normal(size=(6000, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    return d[field.weight_at(d) > 0][:48]


def check_mean_counts(tree, problems, setting, period_s):
    """Mean of the ball search over the 8 start phases `step * (whole + (i + 1/2) / 8)` against the closed form.

    The noise: T f is whole here, so 8 scans at those phases are one lattice of lines, `step / 8` apart. A beam whose
    window at the polar angle of the direction is `2 delta` wide holds `m = 16 delta / step` points of that lattice on
    average, and in fact floor(m) or ceil(m) of them. So its part of the mean of the 8 counts is off by less than 1/8:
    never more than `n / 8` in all, n the number of beams whose circle about the axis meets the edge of the ball
    (one polar angle apart by no more than the ball).
    Where the lattice starts is random to a random direction, so each part is off by 0 on average, with a variance of
    `f (1 - f) / 64 <= 1/256`, f the broken part of m. Neighbouring beams err together at worst: the standard deviation
    of one direction is at most `n / 16`. The sum over many independent directions then stays within 5 standard
    deviations, `5 sqrt(sum (n / 16)^2)`. (Directions of the region of one degree share most of their beams and of
    their phases: they are no independent draws, so for them the first bound stands alone.)
    """
    axis = R_world_rot(*setting[:2])[:, 2]
    utm, lines = problems["uniform", period_s, 1.0].bearings_rad, problems["uniform", period_s, 1.0].lines
    polar, _ = polar_and_azimuth(beam_directions_rot(utm, *setting[2:]))
    phases = lines.step_rad * (np.arange(8) * (lines.count // 8) + (np.arange(8) + 0.5) / 8)
    for name in FIELDS:
        d = directions_within(name, problems[name, period_s, 1.0].field)
        turned = np.concatenate([Rotation.from_rotvec(-phase * axis).apply(d) for phase in phases])
        t = np.arccos(np.clip(d @ axis, -1, 1))
        for ball in (radians(1), radians(2)):
            found = tree.query_ball_point(turned, 2 * sin(ball / 2), return_length=True)
            error = found.reshape(8, -1).mean(axis=0) - mean_count(t, polar, lines, ball)
            met = (np.abs(polar[None, :] - t[:, None]) <= ball + 1e-9).sum(axis=1)
            assert (np.abs(error) <= met / 8 + 1e-6).all()
            if name != "one degree":
                assert abs(error.sum()) <= 5 * np.sqrt(((met / 16) ** 2).sum()) + 1e-6


def check_J(tree, problem, setting, directions):
    """J of the closed form against the ball search, within both stated errors."""
    exact = score(problem, setting)
    ball = oracle.ball_score_on(tree, problem, setting, directions)
    assert np.isfinite([exact.J, exact.J_error, exact.J_lower, ball.J, ball.J_error]).all()
    assert abs(exact.J - ball.J) <= exact.J_error + ball.J_error
    assert exact.J_lower <= exact.J + exact.J_error


@pytest.mark.parametrize("period_s", [18.0, 2.0])
@pytest.mark.parametrize("chunk", samples(range(CHUNKS), range(2)))
@pytest.mark.usefixtures("samples_are_kept")
def test_mean_counts_and_J_agree_with_the_ball_search(problems, chunk, period_s):
    """All settings; at 18 s, where a ball search takes long, the first half, and the two balls take turns with them.

    Hundreds more: `python -m benchmarks.design.claims errors`.
    """
    settings = SETTINGS if period_s == 2.0 else SETTINGS[: len(SETTINGS) // 2]
    for i, setting in enumerate(np.radians(settings[chunk::CHUNKS])):
        tree = oracle.scan_tree(problems["uniform", period_s, 1.0], setting)
        check_mean_counts(tree, problems, setting, period_s)
        for name, ball_deg in product(FIELDS, (1.0, 2.0)):
            if period_s == 2.0:
                check_J(tree, problems[name, period_s, ball_deg], setting, directions=400)
            elif ball_deg == 1.0 + i % 2:
                check_J(tree, problems[name, period_s, ball_deg], setting, directions=160)


def test_the_oracle_sees_a_density_that_is_a_tenth_off(problems):
    """The test above must be able to fail: J of 10 % more lines is further away than the stated errors."""
    problem = problems["uniform", 2.0, 2.0]
    setting = np.radians(SETTINGS[10])
    lines = ScanLines(problem.lines.count + 8, problem.lines.step_rad * 80 / 88)
    wrong = problem.with_beams(problem.bearings_rad, lines)
    ball = oracle.ball_score(problem, setting, directions=400)
    assert abs(score(problem, setting).J - ball.J) < 0.5 * abs(score(wrong, setting).J - ball.J)
    assert abs(score(wrong, setting).J - ball.J) > score(wrong, setting).J_error + ball.J_error


def test_directions_in_rings_about_the_axis_tell_of_the_error_they_share(problems):
    """An upright axis: the density is zonal about the spiral itself, and what one ring misses, all miss."""
    problem, setting = problems["uniform", 2.0, 2.0], np.radians([0, 0, 30, 0])
    exact, ball = score(problem, setting), oracle.ball_score(problem, setting, directions=400)
    assert abs(exact.J - ball.J) <= exact.J_error + ball.J_error
    assert ball.J_error < 0.02


@given(
    places=st.lists(st.floats(0, 1, exclude_max=True), max_size=200),
    crowded=st.booleans(),
)
def test_places_are_sorted_however_they_crowd(places, crowded):
    at = np.array(places) * (1e-4 if crowded else 1.0)
    order, starts = np.empty(len(at) + 3, np.int64), np.empty(len(at) + 4, np.int64)
    sort_by_buckets(at, len(at), order, starts)
    assert sorted(order[: len(at)]) == list(range(len(at)))
    assert (np.diff(at[order[: len(at)]]) >= 0).all()
