"""How far a mount leans: a post beside the closed form of a beam, and a real one leaning where its load pulls."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from scanwright.cad.assembly.assembly import link_bodies
from scanwright.cad.checks.loads.deflection import carried, mount_checks
from scanwright.cad.geometry.mesh import mesh_of
from scanwright.cad.layout.names import BASE_MOUNT
from scanwright.cad.screws import SCREWS
from scanwright.cad.solids import box
from scanwright.cad.statics.sag import Carried, mount_sag
from scanwright.design.frames import STANDARD_GRAVITY_M_S2

HALF, HIGH, MODULUS, DENSITY = 12.0, 120.0, 2000.0, 1.2  # mm, MPa, g/cm3


@pytest.mark.parametrize(("arm_m", "seat_mm"), [(0.0, HALF), (0.05, HALF), (0.0, HALF + 9.0)])
def test_a_post_bends_as_a_beam_does(arm_m, seat_mm):
    """Slope at the end of a cantilever: load F across it at its end, moment F arm, and its own weight q.

    What lies on it may be wider than the post.
    """
    mesh = mesh_of(box((-HALF, -HALF, 0.0), (HALF, HALF, HIGH)))
    deck = SimpleNamespace(
        rotation=lambda: np.eye(3), centre=(0.0, 0.0, 0.0), deck_holes=((0.0, 0.0),), screw=SCREWS["M2"]
    )
    mounted = SimpleNamespace(holes=((0.0, 0.0),), ears=HIGH, screw=SCREWS["M2"])
    mass_kg = 0.5
    centre = np.array([0.0, 0.0, HIGH / 1000 + arm_m])
    load = Carried(mass_kg, centre, np.array([1.0, 0.0, 0.0]), seat_mm, HALF)
    rotation, _, _ = mount_sag(mesh, deck, mounted, load, MODULUS, DENSITY)
    inertia = (2 * HALF) ** 4 / 12
    force = mass_kg * STANDARD_GRAVITY_M_S2
    own = DENSITY * 1e-6 * STANDARD_GRAVITY_M_S2 * (2 * HALF) ** 2
    slope = (force * HIGH**2 / 2 + force * 1000 * arm_m * HIGH + own * HIGH**3 / 6) / MODULUS / inertia
    np.testing.assert_allclose(rotation, [0.0, slope, 0.0], rtol=0.06, atol=0.02 * slope)


def test_a_mount_leans_where_its_load_pulls_it(made):
    assembly = made.result.assembly
    bodies = link_bodies(assembly)
    load, deck = carried(assembly, bodies), assembly.layout.deck
    mounted = assembly.layout.drive.mounted
    turned, _, _ = mount_sag(assembly.mesh(BASE_MOUNT), deck, mounted, load, MODULUS, DENSITY)
    arm = load.centre_m - np.array(deck.centre) / 1000
    assert np.cross(turned, arm) @ load.down > 0


def test_a_build_tells_the_lean_and_the_pose_that_it_belongs_to(made):
    (check,) = [c for c in json.loads((made.folder / "checks.json").read_text())["checks"] if c["kind"] == "mount_lean"]
    assert check["severity"] == "note" and 0.01 < check["value"] < 1.0 and "pose on the robot" in check["message"]


def test_a_scanner_without_a_mount_has_no_lean():
    bare = SimpleNamespace(made={})
    assert mount_checks(bare, {}) == ([], None)
