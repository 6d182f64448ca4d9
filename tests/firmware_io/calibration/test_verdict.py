"""What a calibration says of itself: crispness that weighs areas, platforms that moved, people that walked."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from benchmarks.firmware_io.calibration import designed, faulty, mount_of
from benchmarks.firmware_io.calibration_errors import BEAMS, STEP_DEG
from benchmarks.firmware_io.rooms import FURNISHED, NAMES, Setup, Truth, Unrest, simulate, write
from design.angles import STANDARD_DEG
from firmware_io.calibration.calibrate import calibrate_recordings
from firmware_io.calibration.entropy import _areas, _between, witness
from firmware_io.calibration.estimate import estimate
from firmware_io.calibration.model import beam_rays, gather, start_vector
from firmware_io.calibration.report import lines
from firmware_io.calibration.tiles import fan_side
from firmware_io.calibration.unrest import contradicted_share
from firmware_io.recording.recording import open_recording

ALPHA_ROT, BETA_ROT, ALPHA_LASER, BETA_LASER = STANDARD_DEG["pitching"]
PITCHING = Setup(
    rot_deg=(ALPHA_ROT, BETA_ROT), laser_deg=(ALPHA_LASER, BETA_LASER), beams=BEAMS, step_deg=STEP_DEG
)  # fmt: skip


def calibrated(folder, unrest, setup=PITCHING):
    recording = write(folder / "r.mcap", simulate(FURNISHED, setup, faulty(2), 7, unrest))
    return calibrate_recordings([recording], designed(setup), folder / "a.json").record


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
    assert record["notes"] == []
    assert record["drift"][0]["chi2_of_6"] < chi2.isf(1e-4, 6)
    assert record["contradicted_share"] == 0
    entropy = record["entropy"]
    assert entropy["after"] < entropy["before"] - 3 * entropy["change_sd"]


def moved(record):
    (said,) = [note for note in record["notes"] if "platform moved during recording 1" in note]
    return f"warning: {said}" in list(lines(record))


def test_a_platform_that_creeps_is_named_with_its_speed(crept):
    assert moved(crept)
    # Pitching: the axis frame's x is the world's
    assert crept["drift"][0]["velocity_mm_s"] == pytest.approx([1, 0, 0], abs=0.15)


def test_a_platform_that_drives_is_named(tmp_path):
    assert moved(calibrated(tmp_path, Unrest(velocity_m_s=(0.05, 0.0, 0.0))))


def test_people_that_walk_are_named(tmp_path):
    record = calibrated(tmp_path, Unrest(walkers=2))
    assert any("somebody walked" in note for note in record["notes"])
    assert not any("platform" in note for note in record["notes"])


def test_what_both_sides_see_does_not_contradict(beams):
    mount = mount_of(PITCHING)[0]
    truth = np.array([getattr(faulty(2), name) for name in NAMES])
    side = fan_side(beams, mount)
    assert contradicted_share(mount, truth, beams, side) == 0
    early = beams.time_ns < np.quantile(beams.time_ns, 0.01)
    nearer = replace(beams, range_m=np.where(early, 0.5 * beams.range_m, beams.range_m))
    assert contradicted_share(mount, truth, nearer, side) == pytest.approx(0.01, rel=0.2)


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
    found = _between(point, weight, one, 0.2)
    a, b = weight[one] / weight[one].sum(), weight[~one] / weight[~one].sum()
    apart = np.linalg.norm(point[one][:, None] - point[~one], axis=2)
    assert found.entropy == pytest.approx(-np.log(a @ np.exp(-(apart**2) / 0.16) @ b), rel=1e-9)
    assert found.weight[one] @ found.share[one] == pytest.approx(1)
    assert found.weight[~one] @ found.share[~one] == pytest.approx(1)


def test_the_stated_sampling_error_is_that_of_other_samples(beams):
    """Disjoint sixths of the beams: their changes of entropy scatter as stated."""
    mount, start = mount_of(PITCHING)
    truth = np.array([getattr(faulty(2), name) for name in NAMES])
    changes, stated = [], []
    sixth = np.random.default_rng(0).integers(0, 6, beams.range_m.size)
    for k in range(6):
        part = beams.taken(sixth == k)
        seen = witness(mount, part, fan_side(part, mount), start, truth, 0.01)
        changes.append(seen.after - seen.before)
        stated.append(seen.change_sd)
    ratio = np.var(changes, ddof=1) / np.mean(np.square(stated))
    assert chi2.ppf(0.001, 5) / 5 < ratio < chi2.ppf(0.999, 5) / 5


def test_a_wrong_answer_is_less_crisp(beams):
    mount, start = mount_of(PITCHING)
    truth = np.array([getattr(faulty(2), name) for name in NAMES])
    seen = witness(mount, beams, fan_side(beams, mount), truth, start, 0.01)
    assert seen.less_crisp
    assert not witness(mount, beams, fan_side(beams, mount), start, truth, 0.01).less_crisp


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
