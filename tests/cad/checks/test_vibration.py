"""Natural frequencies against closed forms, and what a check says of a scanner that its lidar's mirror shakes."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scanwright.cad.assembly.assembly import link_bodies
from scanwright.cad.checks.loads.deflection import amplitude_m, vibration_check
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.geometry.mesh import mesh_of
from scanwright.cad.layout.direct.loads import shaft_bend
from scanwright.cad.layout.loads import ShaftBend
from scanwright.cad.screws import SCREWS
from scanwright.cad.solids import box
from scanwright.cad.statics.sag import POISSON, Carried, mount_sag
from scanwright.cad.statics.spring import Spring, mass_matrix, of_shaft, row_of

E_PA, DIAMETER, LENGTH = 70e9, 0.012, 0.1
SECOND = math.pi / 64 * DIAMETER**4
BAR = ShaftBend(
    np.array([[LENGTH**3 / 3, LENGTH**2 / 2], [LENGTH**2 / 2, LENGTH]]) / (E_PA * SECOND),
    LENGTH / (E_PA / 2.66 * 2 * SECOND),
    LENGTH / (E_PA * math.pi / 4 * DIAMETER**2),
)
NOTHING = np.zeros((6, 6))


def ball(kg, height_m, radius_m=1e-5):
    return Inertial(kg, np.array([0.0, 0.0, height_m]), kg * radius_m**2 * np.eye(3))


def test_a_mass_on_a_bar_swings_as_the_closed_form_says_wherever_the_origin_is():
    expected = math.sqrt(3 * E_PA * SECOND / LENGTH**3 / 0.5) / (2 * math.pi)
    for end_mm in (0.0, -70.0, 50.0):
        row = row_of([of_shaft(BAR, end_mm)], [mass_matrix(ball(0.5, end_mm / 1000))])
        np.testing.assert_allclose(row.frequencies_hz()[:2], expected, rtol=1e-4)


def test_a_mass_beyond_the_end_and_one_that_is_long_swing_slower():
    at_end, beyond, long = (
        row_of([of_shaft(BAR, 0.0)], [mass_matrix(body)]).frequencies_hz()[0]
        for body in (ball(0.5, 0.0), ball(0.5, 0.05), ball(0.5, 0.0, 0.06))
    )
    reach = LENGTH**3 / 3 + LENGTH**2 * 0.05 + LENGTH * 0.05**2  # of a force at the mass
    assert beyond == pytest.approx(math.sqrt(E_PA * SECOND / reach / 0.5) / (2 * math.pi), rel=1e-3)
    assert long < at_end


def test_two_masses_in_a_row_swing_as_their_quadratic_says():
    k, (one, two) = 5e4, (0.7, 0.3)
    soft = Spring(np.eye(6) / k, NOTHING, NOTHING, NOTHING)
    found = row_of([soft, soft], [mass_matrix(ball(kg, 0.0, 1.0)) for kg in (one, two)]).frequencies_hz()[0]
    squared = np.roots([one * two, -k * (one + 2 * two), k * k]).min()
    assert found == pytest.approx(math.sqrt(squared) / (2 * math.pi), rel=1e-9)


def test_a_load_at_rest_moves_what_the_compliance_says_and_at_resonance_the_loss_factor_limits_it():
    row = row_of([of_shaft(BAR, 0.0)], [mass_matrix(ball(0.5, 0.0))])
    load = np.array([0, 0, 0, 1.0, 0, 0])
    assert row.moved(load, 0.0, 0.0)[3].real == pytest.approx(BAR.compliance[0, 0])
    shaken = row.moved(load, row.frequencies_hz()[0], 0.04)
    assert abs(shaken[3]) == pytest.approx(BAR.compliance[0, 0] / 0.04, rel=1e-3)


def test_a_printed_post_swings_with_its_own_mass_as_a_beam_does():
    """A cantilever of mass m with M at its end: 1/k = L^3 / 3 EI + 6 L / 5 GA; 33/140 of m moves with M (Rayleigh)."""
    half, high, modulus, density, mass, below = 12.0, 120.0, 2000.0, 12.0, 0.2, 35.0
    deck = SimpleNamespace(
        rotation=lambda: np.eye(3), centre=(0.0, 0.0, -below), deck_holes=((0.0, 0.0),), screw=SCREWS["M2"]
    )
    post = mesh_of(box((-half, -half, -below), (half, half, high - below)))
    mounted = SimpleNamespace(holes=((0.0, 0.0),), ears=high - below, screw=SCREWS["M2"])
    load = Carried(mass, np.zeros(3), np.array([1.0, 0.0, 0.0]), half, half)
    spring = mount_sag(post, deck, mounted, load, modulus, density)[2]
    own_kg = density * 1e-6 * (2 * half) ** 2 * high
    wide, long, shear = 2 * half / 1000, high / 1000, modulus * 1e6 / (2 * (1 + POISSON))
    compliance = long**3 / (3 * modulus * 1e6 * wide**4 / 12) + 6 / 5 * long / (shear * wide**2)
    expected = 1 / math.sqrt(compliance * (mass + 33 / 140 * own_kg)) / (2 * math.pi)
    assert np.trace(spring.rigid[3:, 3:]) / 3 == pytest.approx(own_kg, rel=1e-3)
    row = row_of([spring], [mass_matrix(ball(mass, (high - below) / 1000))])
    assert row.frequencies_hz()[0] == pytest.approx(expected, rel=0.05)


def test_a_horn_that_tilts_and_seats_that_give_way_add_to_the_shaft(made):
    stack = replace(made.result.assembly.layout.stack, bearing=None)
    length = (stack.shoulder - stack.horn) / 1000
    stiff, soft = shaft_bend(stack).compliance, shaft_bend(stack, horn_rad_per_nm=1e-3).compliance
    np.testing.assert_allclose(soft - stiff, 1e-3 * np.array([[length**2, length], [length, 1.0]]))


def _checked(made, linkage, **lidar):
    scanner = replace(made.scanner, lidar=made.scanner.lidar.model_copy(update=lidar))
    assembly = made.result.assembly
    assembly = replace(assembly, layout=replace(assembly.layout, scanner=scanner))
    return vibration_check(assembly, link_bodies(assembly), linkage, None)


def test_a_frequency_near_that_of_the_mirror_is_a_warning_that_states_an_amplitude(made):
    linkage = Spring(np.diag([1e-3, 1e-3, 1e-3, 1e-7, 1e-7, 1e-7]), NOTHING, NOTHING, NOTHING)
    slow, fast = (_checked(made, linkage, scan_rate_hz=hz) for hz in (1.0, 400.0))
    assert slow.value == fast.value and slow.severity == "ok" and "mm at 5 m" not in slow.message
    assert fast.severity == "warning" and fast.limit == 480.0 and "mm at 5 m" in fast.message


def test_the_amplitude_follows_from_force_compliance_and_distance(made):
    """Far below resonance: what the mirror's imbalance moves by the springs alone."""
    scanner = replace(made.scanner, lidar=made.scanner.lidar.model_copy(update={"scan_rate_hz": 1.0, "mass_g": 400.0}))
    linkage = Spring(np.diag([0, 0, 0, 1e-4, 1e-4, 1e-4]) + 1e-12 * np.eye(6), NOTHING, NOTHING, NOTHING)
    row = row_of([linkage], [mass_matrix(ball(0.4, 0.0, 0.03))])
    force = 0.05 * 0.4 * 6.3e-3 * 2 * math.pi
    assert amplitude_m(row, scanner) == pytest.approx(math.sqrt(2) * 1e-4 * force, rel=0.01)
