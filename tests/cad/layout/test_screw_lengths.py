"""Screws of the parts list can be bought, hold, and are no longer than that asks for."""

from hypothesis import given
from hypothesis import strategies as st

from scanwright.cad.layout.joints import LENGTHS, shank_mm
from scanwright.cad.screws import SCREWS

ISO_888 = (2, 2.5, 3, 4, 5, 6, 8, 10, 12, 16, 20, 25, 30, 35, 40, 45, 50)
"""Nominal lengths of bolts and screws."""


def test_every_length_is_nominal_and_none_between_the_shortest_and_the_longest_is_missing():
    for name, lengths in LENGTHS.items():
        assert lengths == tuple(n for n in ISO_888 if lengths[0] <= n <= lengths[-1]), name


@given(st.sampled_from(sorted(LENGTHS)), st.floats(1, 12), st.floats(1, 8))
def test_with_a_nut_a_diameter_stands_behind_the_hole_and_the_next_shorter_screw_has_less(name, grip_mm, depth_mm):
    screw = SCREWS[name]
    length, needed = shank_mm(screw, grip_mm, "nut", depth_mm), grip_mm + depth_mm + screw.nominal
    shorter = max((n for n in LENGTHS[name] if n < length), default=0)
    assert length >= min(needed, LENGTHS[name][-1]) and shorter < needed


@given(st.sampled_from(sorted(LENGTHS)), st.floats(1, 8), st.floats(1, 12))
def test_in_a_thread_none_bottoms_and_two_diameters_hold_where_there_is_room(name, grip_mm, depth_mm):
    screw = SCREWS[name]
    length = shank_mm(screw, grip_mm, "thread", depth_mm)
    fit = [n for n in LENGTHS[name] if n <= grip_mm + depth_mm - 0.5]
    assert length in fit or not fit
    enough = [n for n in fit if n >= grip_mm + 2 * screw.nominal]
    assert length == (enough[0] if enough else max(fit, default=LENGTHS[name][0]))


@given(st.sampled_from(sorted(LENGTHS)), st.floats(1, 8), st.floats(1, 6))
def test_in_a_trap_a_screw_comes_through_its_nut_and_the_next_shorter_one_does_not(name, grip_mm, depth_mm):
    screw = SCREWS[name]
    length, through = shank_mm(screw, grip_mm, "trap", depth_mm), grip_mm + depth_mm + screw.nut_height
    shorter = max((n for n in LENGTHS[name] if n < length), default=0)
    assert length >= min(through - 0.1, LENGTHS[name][-1]) and shorter < through


@given(st.sampled_from(sorted(LENGTHS)), st.floats(1, 8))
def test_a_grub_screw_reaches_what_it_clamps_and_the_next_shorter_one_does_not(name, grip_mm):
    length = shank_mm(SCREWS[name], grip_mm, "grub", 0.0)
    shorter = max((n for n in LENGTHS[name] if n < length), default=0)
    assert length >= grip_mm - 0.1 and shorter < grip_mm
