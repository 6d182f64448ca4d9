"""What a refused scanner could be built with instead: everything that is named can be laid out, and turns its lidar."""

import re

import pytest

from scanwright.cad.layout.placement import placement_of
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.servo import Servo
from scanwright.design.electrics.wiring import circuits_of
from scanwright.design.errors import BuildError
from scanwright.design.task.task import load_task
from scanwright.pipeline.alternatives import what_fits
from scanwright.pipeline.build import build_task

TASK = """
name = "heavy"
sensor = "{sensor}"
servo = "XC330-M288"
slip_ring = "SNU11-P0210"
[motion]
mode = "spin"
period_s = 10.0
[density]
ball_radius_deg = 2.0
[[weight]]
shape = "all"
"""


def refused(tmp_path, sensor, **angles):
    path = tmp_path / "heavy.toml"
    path.write_text(TASK.format(sensor=sensor))
    loaded = load_task(path)
    at = Angles(**{"alpha_rot": 0, "beta_rot": 0, "alpha_laser": 60, "beta_laser": 0} | angles)
    task = loaded.task
    angle_set = AngleSet(task="heavy", angles_deg=at, sensor=sensor, servo=task.servo, slip_ring=task.slip_ring)
    with pytest.raises(BuildError):
        placement_of(loaded.scanner(angle_set))
    return loaded, angle_set


def test_every_servo_and_ring_that_is_named_can_be_laid_out_and_is_strong_enough(tmp_path):
    loaded, angles = refused(tmp_path, "UTM-30LX")
    named = re.split(", or ", what_fits(loaded, angles).split(" with ")[1])
    assert 1 <= len(named) <= 3 and len(set(named)) == len(named)
    for servo, ring in (pair.split(" and ") for pair in named):
        placement_of(loaded.scanner(angles.model_copy(update={"servo": servo, "slip_ring": ring})))
        assert loaded.products.get(servo, Servo).continuous_torque_nm > 0.2  # upright: friction of the ring and spin-up


def test_a_lidar_that_nothing_holds_is_said_to_be_so(tmp_path):
    loaded, angles = refused(tmp_path, "LD06")
    assert what_fits(loaded, angles).startswith("; no servo and slip ring of the catalogue fit LD06")


def test_a_ring_with_weak_circuits_is_refused_before_the_search_with_those_that_carry_the_lidar(tmp_path):
    def loaded(ring):
        path = tmp_path / "weak.toml"
        path.write_text(TASK.format(sensor="RPLIDAR A3").replace("SNU11-P0210", ring))
        return load_task(path)

    steps = []
    with pytest.raises(BuildError, match=r"2\.5 A by \+.* take (.+), or no ring") as refusal:
        build_task(loaded("SRC022A-6"), tmp_path / "out", lambda step, *_: steps.append(step))
    assert steps == []
    for name in re.search("take (.+), or no ring", str(refusal.value)).group(1).split(", "):
        task = loaded(name)
        assert all(each.amps <= each.rated_a for each in circuits_of(task.ring, task.lidar))
