"""The verdict of a calibration on itself: crispness that weighs areas, platforms that moved, people that walked."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from benchmarks.firmware_io.calibration import designed, faulty, mount_of
from benchmarks.firmware_io.calibration_errors import BEAMS, STEP_DEG, case
from benchmarks.firmware_io.rooms import FURNISHED, NAMES, Setup, Truth, Unrest, simulate, write
from scanwright.design.angles import STANDARD_DEG
from scanwright.firmware_io.calibration import entropy
from scanwright.firmware_io.calibration.calibrate import calibrate_recordings
from scanwright.firmware_io.calibration.entropy import _areas, _between, witness
from scanwright.firmware_io.calibration.estimate import estimate
from scanwright.firmware_io.calibration.model import beam_rays, gather, start_vector
from scanwright.firmware_io.calibration.report import lines
from scanwright.firmware_io.calibration.scene_motion.overlapping_views import overlapping_views
from scanwright.firmware_io.calibration.tiles import fan_side
from scanwright.firmware_io.recording.recording import open_recording

ALPHA_ROT, BETA_ROT, ALPHA_LASER, BETA_LASER = STANDARD_DEG["pitching"]
PITCHING = Setup(
    rot_deg=(ALPHA_ROT, BETA_ROT), laser_deg=(ALPHA_LASER, BETA_LASER), beams=BEAMS, step_deg=STEP_DEG
)  # fmt: skip
TRUE = np.array([getattr(faulty(2), name) for name in NAMES])


def calibrated(folder, scene_motion, setup=PITCHING):
    recording = write(folder / "r.mcap", simulate(FURNISHED, setup, faulty(2), 7, scene_motion))
    return calibrate_recordings([recording], designed(setup), folder / "a.json").record


@pytest.fixture(autouse=True)
def few_points(monkeypatch):
    """The entropy of fewer points: the pairs of them grow with the square."""
    monkeypatch.setattr(entropy, "_SAMPLE", 1500)


@pytest.fixture(scope="module")
def beams(tmp_path_factory):
    path = tmp_path_factory.mktemp("r") / "r.mcap"
    recording = open_recording(write(path, simulate(FURNISHED, PITCHING, faulty(2), 7)))
    return gather([recording], one_place=True)[0]


@pytest.fixture(scope="module")
def crept(tmp_path_factory):
    """The record of a platform that crept by a millimetre a second."""
    return calibrated(tmp_path_factory.mktemp("crept"), Unrest(velocity_m_s=(1e-3, 0.0, 0.0)))


def test_a_pitching_scanner_that_is_right_is_not_warned_of(tmp_path):
    record = calibrated(tmp_path, Unrest())
    assert record["notes"] == record["faults"] == []
    assert (tmp_path / "a.json").is_file()
    assert record["drift"][0]["chi2_of_6"] < chi2.isf(1e-4, 6)
    assert record["second_looks"]["seen_through"] == 0
    entropy = record["entropy"]
    assert entropy["after"] < entropy["before"] - 3 * entropy["change_sd"]


def moved(record):
    (fault,) = record["faults"]
    return "platform moved during recording 1" in fault and f"error: {fault}" in list(lines(record))


def test_a_platform_that_creeps_is_named_with_its_speed(crept):
    assert moved(crept)
    # Pitching: the axis frame's x is the world's
    assert crept["drift"][0]["velocity_mm_s"] == pytest.approx([1, 0, 0], abs=0.15)


def test_a_platform_that_drives_is_named_and_no_angle_set_is_written(tmp_path):
    assert moved(calibrated(tmp_path, Unrest(velocity_m_s=(0.05, 0.0, 0.0))))
    assert [path.name for path in tmp_path.glob("a.*")] == ["a.report.json"]


def test_people_that_walk_are_named(tmp_path):
    record = calibrated(tmp_path, Unrest(walkers=2))
    assert any("a person walked" in note for note in record["notes"])
    assert record["faults"] == []


def looked(beams):
    return overlapping_views(mount_of(PITCHING)[0], TRUE, beams, 0.01)


def test_at_rest_no_beam_goes_through_what_another_met(beams):
    """A fan of 270 deg on a pitching axis looks at half of its sphere once in a turn."""
    looks = looked(beams)
    assert looks.seen_through == 0
    assert 0.45 < looks.compared / looks.tested < 0.7


def stood_there(beams, when):
    """The beams with something at half their range for a part of the time, and how many met it."""
    first, last = np.quantile(beams.time_ns, when)
    there = (beams.time_ns >= first) & (beams.time_ns <= last)
    return replace(beams, range_m=np.where(there, 0.5 * beams.range_m, beams.range_m)), int(there.sum())


@pytest.mark.parametrize("when", [(0.0, 0.03), (0.97, 1.0)], ids=["the first look met it", "the second"])
def test_what_stood_there_for_a_moment_is_seen_through_by_the_other_look(beams, when):
    nearer, met = stood_there(beams, when)
    assert 0.25 * met < looked(nearer).seen_through <= met


@pytest.mark.parametrize(
    "sweeps", [((40.0, 120.0), (-40.0, 120.0)), ((120.0, 720.0),)], ids=["there and back", "turn after turn"]
)
def test_the_other_look_may_be_the_way_back_or_the_next_turn(tmp_path, sweeps):
    """A fan that looks ahead only: one side of it, once in a sweep or a turn."""
    setup = replace(PITCHING, fov_deg=90.0, beams=90, sweeps=sweeps)
    recording = open_recording(write(tmp_path / "r.mcap", simulate(FURNISHED, setup, faulty(2), 6)))
    beams = gather([recording], one_place=True)[0]
    looks = looked(beams)
    assert looks.compared > 0.8 * looks.tested
    assert looks.seen_through == 0
    nearer, met = stood_there(beams, (0.2, 0.25))
    assert looked(nearer).seen_through > 0.4 * met


def test_a_slot_between_things_is_no_place_where_something_was(tmp_path):
    """A room whose boxes leave one: a beam of one look went through it, those around of both looks did not."""
    room, setup, truth = case(118)
    recording = open_recording(write(tmp_path / "r.mcap", simulate(room, setup, truth)))
    beams = gather([recording], one_place=True)[0]
    x = np.array([getattr(truth, name) for name in NAMES])
    assert overlapping_views(mount_of(setup)[0], x, beams, 0.01).seen_through == 0


def test_beams_that_end_early_one_by_one_are_nobody(beams):
    """Drops, and edges that are half met."""
    drop = np.random.default_rng(0).random(beams.range_m.size) < 0.01
    assert looked(replace(beams, range_m=np.where(drop, 0.5 * beams.range_m, beams.range_m))).seen_through == 0


def test_a_lidar_that_is_read_the_other_way_round_tells_the_same(beams):
    """Bearings that fall in a scan, as of a lidar that turns the other way."""
    first = np.flatnonzero(np.diff(beams.bearing_rad, prepend=np.inf) < 0)
    back = np.concatenate([np.arange(a, b)[::-1] for a, b in zip(first, [*first[1:], beams.range_m.size], strict=True)])
    assert looked(beams.select(back)) == looked(beams)


def test_residuals_are_those_of_beams_on_their_own_surfaces(crept):
    """Patches that fit no surface had been held against the first one: 1.9 m of residual in a room at rest."""
    assert crept["residual_mm"]["after"] < 20


def test_points_weigh_the_area_that_they_stand_for(beams):
    """A fan that holds the axis: r^2 times the sine of the angle to it, for beams crowd there."""
    mount, start = mount_of(PITCHING)
    height = beam_rays(mount, start, beams)[1][:, 2]
    ratio = _areas(mount, start, beams) / (beams.range_m**2 * np.sqrt(1 - height**2) * np.abs(beams.speed_rad_s))
    np.testing.assert_allclose(ratio, 1, rtol=1e-6)


def test_entropy_is_the_sum_over_all_pairs_and_its_shares_add_up():
    rng = np.random.default_rng(0)
    point, weight, one = rng.normal(0, 0.1, (300, 3)), rng.uniform(1, 2, 300), np.arange(300) < 140
    entropy, parts = _between(point, weight, one, 0.2)
    a, b = weight[one] / weight[one].sum(), weight[~one] / weight[~one].sum()
    apart = np.linalg.norm(point[one][:, None] - point[~one], axis=2)
    assert entropy == pytest.approx(-np.log(a @ np.exp(-(apart**2) / 0.16) @ b), rel=1e-9)
    assert (parts[one].sum(), parts[~one].sum()) == (pytest.approx(1), pytest.approx(1))


def test_the_stated_sampling_error_is_that_of_other_samples(beams):
    """Disjoint sixths of the beams: their changes of entropy scatter as stated."""
    mount, start = mount_of(PITCHING)
    changes, stated = [], []
    sixth = np.random.default_rng(0).integers(0, 6, beams.range_m.size)
    for k in range(6):
        part = beams.select(sixth == k)
        seen = witness(mount, part, fan_side(part, mount), start, TRUE, 0.01)
        changes.append(seen.after - seen.before)
        stated.append(seen.change_sd)
    ratio = np.var(changes, ddof=1) / np.mean(np.square(stated))
    assert chi2.ppf(0.001, 5) / 5 < ratio < chi2.ppf(0.999, 5) / 5


def test_a_wrong_answer_is_less_crisp(beams):
    mount, start = mount_of(PITCHING)
    seen = witness(mount, beams, fan_side(beams, mount), TRUE, start, 0.01)
    assert seen.less_crisp
    assert not witness(mount, beams, fan_side(beams, mount), start, TRUE, 0.01).less_crisp
    assert not replace(seen, before=5.0, after=5.001, change_sd=1e-5).less_crisp  # sure, but nobody can see it


def test_grids_that_fall_on_each_other_are_no_crispness(tmp_path, monkeypatch):
    """A rolling scanner's two sides look in the same directions if it is as designed, which this one is not."""
    monkeypatch.setattr(entropy, "_SAMPLE", 15_000)
    room, setup, truth = case(1086)
    recording = open_recording(write(tmp_path / "r.mcap", simulate(room, setup, truth)))
    beams = gather([recording], one_place=True)[0]
    mount, start = mount_of(setup)
    x = np.array([getattr(truth, name) for name in NAMES])
    seen = witness(mount, beams, fan_side(beams, mount), start, x, 0.01)
    assert seen.after < seen.before - 3 * seen.change_sd


def test_drift_is_asked_of_every_recording(tmp_path):
    """One that crept among two: it is the one that is named."""
    made = [
        simulate(FURNISHED, replace(PITCHING, beams=120), Truth(), k, Unrest(velocity_m_s=(0.002 * k, 0.0, 0.0)))
        for k in range(2)
    ]
    opened = [open_recording(write(tmp_path / f"{k}.mcap", one)) for k, one in enumerate(made)]
    both, _ = gather(opened, one_place=False)
    found = estimate(both, mount_of(PITCHING)[0], start_vector(designed(PITCHING)))
    assert [drift.sure for drift in found.drifts] == [False, True]


def test_recordings_of_two_places_that_are_given_as_one_are_named(tmp_path):
    """Here the scanner was carried 0.3 m between them; a single recording is not told of the option."""
    setup = replace(PITCHING, beams=120)
    setups = [setup, replace(setup, position_m=(3.3, 1.5, 1.2))]
    paths = [
        write(tmp_path / f"{k}.mcap", simulate(FURNISHED, setup, Truth(), k, Unrest()))
        for k, setup in enumerate(setups)
    ]
    record = calibrate_recordings(paths, designed(setup), tmp_path / "a.json", one_place=True).record
    assert any(
        "a person walked through the scene, an object was moved, times of scans or angles were wrong, or "
        "the scanner was moved between recordings" in said
        for said in record["notes"]
    )
