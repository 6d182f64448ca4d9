"""Density behind what stands still: the table of free lines against simulated scans."""

import numpy as np
import pytest

from scanwright.design.density.ball_count import ball_count
from scanwright.design.density.beams import ScanLines, beam_directions_rot, polar_and_azimuth, scan_at
from scanwright.design.density.spin import mean_count
from scanwright.design.density.sweep import SweepLines, mean_count_swept
from scanwright.design.density.visible import free_lines, mean_count_free
from scanwright.design.motion import Sweep
from scanwright.design.self_occlusion import AXIS_STEPS, SelfOcclusion
from scanwright.design.sphere.directions import spiral

BEARINGS = np.radians(np.arange(-60.0, 61.0, 2.0))
SETTING = np.array([0.0, 0.0, 0.4, -1.1])
BALL_RAD = np.radians(5.0)
SPIN = ScanLines(count=361, step_rad=2 * np.pi / 360.4, repeats=2)
SWEEP = SweepLines(Sweep(mode="sweep", limits_deg=(-70, 130), period_s=6.0, accel_deg_s2=200.0), 60.0)
DIRECTIONS = spiral(400)


def blocked(share=0.3):
    """Beams with stretches of blocked axis angles, one of them across the seam of the turn."""
    rng = np.random.default_rng(0)
    table = np.zeros((len(BEARINGS), AXIS_STEPS), bool)
    for row in table:
        start, length = rng.integers(AXIS_STEPS), int(share * AXIS_STEPS)
        row[np.arange(start, start + length) % AXIS_STEPS] = True
    return table


def simulated(table, motion, phases=8):
    """Mean counts of scans at evenly spread start phases, by the ball search."""
    shadow = SelfOcclusion(np.zeros(len(BEARINGS), bool), table)
    total = np.zeros(len(DIRECTIONS))
    for k in range(phases):
        if isinstance(motion, SweepLines):
            joint, repeats = motion.angles_rad((k + 0.5) / phases), 1
        else:
            # the first line may stand anywhere in the turn: whole turns of it, so that the seam goes all around
            joint, repeats = motion.angles_rad + 2 * np.pi * (k + 0.5) / phases, motion.repeats
        beams = scan_at(BEARINGS, joint, SETTING)[shadow.free(joint).ravel()]
        total += repeats * ball_count(beams, DIRECTIONS, BALL_RAD)
    return total / phases


def summed(table, motion):
    lines, sweep = (SPIN, motion) if isinstance(motion, SweepLines) else (motion, None)
    beams = beam_directions_rot(BEARINGS, *SETTING[2:])
    return mean_count_free(DIRECTIONS, beams, free_lines(table, lines, sweep), BALL_RAD)


@pytest.mark.parametrize("motion", [SPIN, SWEEP], ids=["spin", "sweep"])
def test_the_free_beams_of_a_ball_are_those_of_simulated_scans(motion):
    found, wanted = summed(blocked(), motion), simulated(blocked(), motion)
    assert abs(found - wanted).max() < 0.03 * wanted.max()
    assert found.sum() == pytest.approx(wanted.sum(), rel=2e-3)


@pytest.mark.parametrize("motion", [SPIN, SWEEP], ids=["spin", "sweep"])
def test_what_blocks_nothing_or_all_changes_nothing_or_leaves_exactly_nothing(motion):
    beams = beam_directions_rot(BEARINGS, *SETTING[2:])
    if motion is SPIN:
        polar, _ = polar_and_azimuth(DIRECTIONS)
        plain = mean_count(polar, polar_and_azimuth(beams)[0], SPIN, BALL_RAD)
    else:
        plain = mean_count_swept(DIRECTIONS, beams, SWEEP, BALL_RAD)
    table = np.zeros((len(BEARINGS), AXIS_STEPS), bool)
    np.testing.assert_allclose(summed(table, motion), plain, atol=0.02 * plain.max())
    assert not summed(~table, motion).any()
