"""The sentences that a report begins with."""

from dataclasses import replace

import pytest

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.evaluation.metres import on_planes
from scanwright.design.motion import StopAndGo, Sweep
from scanwright.design.task.task import load_task
from scanwright.report.answer import answer, mounting_rad, problem_as_built
from scanwright.report.sentences import sentences, turns

ANGLES = AngleSet(
    task="ground_ahead",
    angles_deg=Angles(alpha_rot=0, beta_rot=90, alpha_laser=0, beta_laser=-90),
    sensor="UTM-30LX",
    servo="MX-64R",
    motion={"mode": "spin", "period_s": 18.0},
    J=-5.0,
    J_error=1e-3,
)


@pytest.fixture(scope="module")
def found():
    return answer(load_task("ground_ahead"), ANGLES)


def test_what_it_is_what_it_sees_and_what_that_is_worth(found):
    is_, sees, worth, verdict = sentences(ANGLES, found, 0.07, ())
    assert is_.endswith("once around in 18 s, sends 778,320 beams: 720 lines of 1,081.")
    own, mounts = found.as_built.own, found.as_built.mounts
    assert sees.startswith("Each disc of the region 21 cm wide, 3 m away") and f"gets {own.least}" in sees
    factor, name = min((each.factor, each.name) for each in mounts)
    assert f"{factor:.2f} times the beams of the best simple mount ({name}), without parts" in worth
    assert all(f"{each.factor:.2f} ({each.name})" in worth for each in mounts[1:])
    assert verdict == f"{name} (180, 45, 90, -59.4) is better ({1 / factor:.2f} times the beams)."


def test_a_hole_is_told_instead_of_a_count_and_nothing_is_compared_that_has_no_ratio(found):
    own = replace(found.as_built.own, blind=("blind ahead", "blind behind"))
    mounts = tuple(replace(each, gain=replace(each.gain, factor=None)) for each in found.as_built.mounts)
    built = replace(found.as_built, blocked=0.25, own=own, mounts=mounts)
    said = sentences(ANGLES, replace(found, as_built=built), 0.07, ())
    assert said[0].endswith("720 lines of 1,081. Its own parts block 25.0% of them.")
    assert said[1:] == ["It is blind ahead; and blind behind."]


def test_planes_are_told_in_metres(found):
    ground = {"shape": "ground", "from_m": 0.5, "to_m": 3.0, "width_m": 2.0, "height_m": 0.4}
    told = {"name": "t", "sensor": "UTM-30LX", "servo": "MX-64R", "slip_ring": "UH1256-02-0610-06S"}
    loaded = load_task(told | {"motion": {"period_s": 18.0}, "weight": [ground]})
    planes = on_planes(loaded, problem_as_built(loaded, ANGLES), mounting_rad(ANGLES))
    said = sentences(ANGLES, found, 0.07, planes)
    assert said[1].startswith("Ground 0.5 to 3 m ahead: ") and "points per m2" in said[1]
    assert said[2] == "No direction of the region is blind."


def test_every_motion_has_its_words():
    assert turns(None) == "in a motion that the angle set does not state"
    assert turns(Sweep(mode="sweep", period_s=12, limits_deg=(-90, 80), accel_deg_s2=200)) == (
        "from -90 to 80 deg and back in 12 s"
    )
    assert turns(StopAndGo(mode="stop_and_go", stops=36, dwell_s=0.5)) == "to 36 stops of 0.5 s each"
