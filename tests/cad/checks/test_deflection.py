"""How far parts bend: finite elements and beams against closed forms and against each other."""

import math
from dataclasses import replace

import numpy as np
import pytest

from scanwright.cad.checks.loads.deflection import sag_of, split
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.geometry.mesh import mesh_of
from scanwright.cad.layout.direct.loads import hanging, shaft_bend, shaft_modulus_pa
from scanwright.cad.layout.loads import ALUMINIUM_PA, weight_of
from scanwright.cad.parts.all_parts import laid_out
from scanwright.cad.parts.shafts.horn_cup import horn_cup
from scanwright.cad.solids import box, upright
from scanwright.cad.statics import elastic
from scanwright.cad.statics.elastic import Grid, filled
from scanwright.cad.statics.sag import linkage_sag
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.scanner import scanner_of


def rot(axis, angle):
    axis = np.array(axis) / np.linalg.norm(axis)
    K = np.cross(np.eye(3), -axis)
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def grid_around(triangles, edge, parts=6):
    low, high = triangles.min(axis=(0, 1)) - 0.37, triangles.max(axis=(0, 1)) + 0.1
    return Grid(low, edge, tuple(int(n) for n in np.ceil((high - low) / edge)), parts)


def bent(mesh, R, edge, root, root_mm2, pulled, force, modulus, poisson):
    """Mean displacement of points of a body that lies askew in its grid, in the body's frame."""
    return moved_points(mesh, R, edge, root, root_mm2, pulled, force, modulus, poisson).mean(axis=0)


def moved_points(mesh, R, edge, root, root_mm2, pulled, force, modulus, poisson):
    """Displacement of each of them, shape (n, 3)."""
    triangles = (mesh.vertices @ R.T)[mesh.faces]
    grid = grid_around(triangles, edge)
    model = elastic.model_of(grid, filled(triangles, grid))
    at = elastic.places(model, pulled @ R.T)
    loads = elastic.pull(model, at, np.tile(R @ force / len(at.cell), (len(at.cell), 1))[:, :, None])
    moved = elastic.solve(model, modulus, poisson, elastic.places(model, root @ R.T), root_mm2, loads)
    return elastic.moved(model, at, moved)[:, :, 0] @ R


def test_the_cubes_of_a_body_make_up_its_volume_wherever_it_lies():
    solid = box((0, 0, 0), (30, 12, 8)).cut(upright(3.0, -1, 9, 15, 6)).Solids()[0]
    mesh = mesh_of(solid)
    triangles = (mesh.vertices @ rot((1, 2, 3), 0.7).T)[mesh.faces]
    grid = grid_around(triangles, 4.0)
    assert filled(triangles, grid).sum() * (4.0 / 6) ** 3 == pytest.approx(solid.Volume(), rel=2e-3)


def test_a_cantilever_that_lies_askew_bends_as_timoshenko_says():
    length, width, height, E, nu, F = 60.0, 12.0, 8.0, 2300.0, 0.3, 2.0
    mesh = mesh_of(box((0, -width / 2, -height / 2), (length, width / 2, height / 2)))
    y, z = np.meshgrid(np.linspace(-5.5, 5.5, 12), np.linspace(-3.5, 3.5, 8))
    root = np.stack([0 * y, y, z], axis=2).reshape(-1, 3)
    tip = root + np.array([length, 0, 0])
    shear = E / (2 + 2 * nu)
    expected = F * length**3 / (3 * E * width * height**3 / 12) + F * length / (5 / 6 * shear * width * height)
    found = {}
    for edge in (8.0, 6.0, 4.0):
        moved = bent(mesh, rot((1, 2, 3), 0.5), edge, root, width * height, tip, np.array([0, 0, F]), E, nu)
        found[edge] = moved[2] / expected
        assert np.abs(moved[:2]).max() < 0.03 * moved[2]
    assert found[4.0] == pytest.approx(1, abs=0.015)
    for coarse, fine in ((8.0, 6.0), (6.0, 4.0)):
        assert abs(found[fine] - 1) <= 3 * abs(found[fine] - found[coarse]) + 0.03  # the error that a check states


def test_the_shaft_as_a_beam_bends_and_twists_as_the_same_shaft_in_finite_elements(made):
    stack = replace(made.result.assembly.layout.stack, bearing=None, flange_radius=6.0, collar_radius=6.0)
    bend = shaft_bend(stack)
    length, radius = stack.shoulder - stack.horn, stack.shaft_diameter / 2
    closed = length / 1000 / (ALUMINIUM_PA * math.pi / 4 * (radius / 1000) ** 4)
    assert bend.compliance[1, 1] == pytest.approx(closed, rel=1e-6)
    assert bend.compliance[0, 1] == pytest.approx(closed * length / 2000, rel=1e-6)
    mesh = mesh_of(upright(radius, 0.0, length))
    r, a = np.meshgrid(np.linspace(0.5, 5.5, 6), np.arange(16) * math.pi / 8)
    root = np.stack([r * np.cos(a), r * np.sin(a), 0 * r], axis=2).reshape(-1, 3)
    force = np.array([3.0, 0, 0])
    moved = bent(
        mesh, rot((1, 0, 1), 0.3), 4.0, root, math.pi * radius**2, root + np.array([0, 0, length]), force, 70e3, 0.33
    )
    assert moved[0] / 1000 == pytest.approx(3.0 * bend.compliance[0, 0], rel=0.03)
    assert bend.rotation_of(np.zeros(3), np.array([0, 0, 1.0]))[2] == pytest.approx(closed * 1.33, rel=1e-6)


def test_a_printed_cup_turns_on_its_horn_as_the_same_cup_in_finite_elements():
    angles = AngleSet(
        task="cup",
        angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=0, beta_laser=50),
        sensor="STL27L",
        servo="XL430-W250",
        slip_ring=None,
    )
    scanner = scanner_of(angles, "fdm-0.4", load_catalogue())
    layout, servo = laid_out(scanner), scanner.servo
    stack, modulus = layout.stack, shaft_modulus_pa(scanner, layout.stack)
    mesh = mesh_of(horn_cup(layout.linkage, stack, servo, scanner.printer))

    def ring(low, high, z):
        r, a = np.meshgrid(np.linspace(low, high, 6), np.arange(48) * math.pi / 24)
        return np.stack([r * np.cos(a), r * np.sin(a), np.full_like(r, z)], axis=2).reshape(-1, 3)

    root = ring(servo.horn_boss_diameter_mm / 2 + 0.5, servo.horn_diameter_mm / 2, stack.horn)
    rim = ring(stack.cup_bore / 2 + 1.0, stack.shaft_diameter / 2 - 1.5, stack.spigot_top)
    for azimuth in layout.linkage.cross_azimuths:  # the nuts' slots
        aside = rim @ [-math.sin(azimuth), math.cos(azimuth), 0.0]
        rim = rim[(np.abs(aside) > 4.0) | (rim @ [math.cos(azimuth), math.sin(azimuth), 0.0] < 0)]
    force, clamped_mm2 = np.array([3.0, 0, 0]), math.pi * servo.horn_diameter_mm**2 / 4
    moved = moved_points(mesh, np.eye(3), 3.0, root, clamped_mm2, rim, force, modulus / 1e6, 0.35)
    turned_rad = -np.polyfit(rim[:, 0], moved[:, 2], 1)[0]
    lever_m = (stack.spigot_top - stack.shoulder) / 1000
    beam = shaft_bend(stack, modulus).rotation_of(force, np.cross([0, 0, lever_m], force))
    assert 0.8 < turned_rad / beam[1] < 1.4


def test_shaft_bend_is_that_of_the_load_check_where_both_apply(made):
    scanner = made.scanner
    stack = replace(made.result.assembly.layout.stack, bearing=None, flange_radius=6.0, collar_radius=6.0)
    weight = weight_of(scanner, 0.6, 0.14, 0.0)
    arm = weight.lever_m - (stack.shoulder - stack.horn) / 1000
    turned = shaft_bend(stack).rotation_of(np.array([weight.across_n, 0, 0]), np.array([0, weight.across_n * arm, 0]))
    assert turned[1] == pytest.approx(hanging(weight, stack, ALUMINIUM_PA).slope_rad, rel=1e-6)


def test_a_waist_bends_more_and_a_stiff_cage_holds(made):
    stack = made.result.assembly.layout.stack
    assert stack.bearing is not None
    free, held, clamped = (shaft_bend(stack, cage_n_per_m=k).compliance for k in (0.0, 1e6, 1e12))
    waist = stack.waist_length / 1000 / (ALUMINIUM_PA * math.pi / 4 * (stack.waist_diameter / 2000) ** 4)
    assert free[1, 1] > waist
    assert free[0, 0] > held[0, 0] > clamped[0, 0] > 0
    assert free[1, 1] > held[1, 1] > clamped[1, 1] > 0


def test_a_shaft_beyond_a_stiff_bearing_bends_as_a_beam_on_a_clamp_and_a_prop(made):
    """Deflection and slope of the overhang of a propped cantilever, by closed forms."""
    stack = made.result.assembly.layout.stack
    plain = replace(stack, waist_diameter=stack.shaft_diameter, flange_radius=stack.shaft_diameter / 2)
    plain = replace(plain, collar_radius=stack.shaft_diameter / 2, waist_length=150.0)  # slender: little shear
    area, EI = (math.pi / n * (stack.shaft_diameter / 2000) ** p * ALUMINIUM_PA for n, p in ((1, 2), (4, 4)))
    b, a = (plain.bearing_middle - plain.horn) / 1000, (plain.shoulder - plain.bearing_middle) / 1000
    propped = shaft_bend(plain, cage_n_per_m=1e12).compliance
    shear = a / (6 / 7 * area / (2 + 2 * 0.33))  # Timoshenko's factor of a circle, as Cowper has it
    assert propped[0, 0] == pytest.approx(a**2 * (3 * b + 4 * a) / (12 * EI) + shear, rel=0.02)
    assert propped[0, 1] == pytest.approx(a * (b + 2 * a) / (4 * EI), rel=0.02)
    assert propped[1, 1] == pytest.approx((b + 4 * a) / (4 * EI), rel=0.02)


def test_what_a_calibration_finds_is_told_from_what_it_does_not():
    g = np.array([0.6, 0.0, -0.8])
    nothing = np.zeros((3, 3))
    to_the_lidar = np.outer([1.0, 2.0, 3.0], [0, 0, 1.0])  # by the load along the axis
    constant, turning = split(to_the_lidar, nothing, g)
    assert constant.angle_rad == pytest.approx(0.8 * math.sqrt(14)) and turning.angle_rad < 1e-12
    axis = np.array([[2.0, -1, 0], [1, 2, 0], [0, 0, 0]])  # the same all around
    constant, turning = split(axis, nothing, g)
    assert constant.angle_rad == pytest.approx(0.6 * math.sqrt(5)) and turning.angle_rad < 1e-12
    uneven = np.diag([1.0, -1.0, 0.0])  # softer along x than along y: twice per turn
    constant, turning = split(uneven, nothing, g)
    assert turning.angle_rad == pytest.approx(0.6) and constant.angle_rad < 1e-12
    twist = np.array([[0, 0, 0], [0, 0, 0], [1.0, 0, 0]])  # about the axis: once per turn
    constant, turning = split(twist, nothing, g)
    assert turning.angle_rad == pytest.approx(0.6) and turning.off_mm == pytest.approx(6000)
    assert split(nothing, 0.001 * uneven, g)[1].off_mm == pytest.approx(0.6)


def test_a_lidar_on_a_post_turns_as_the_post_bends(made):
    lidar = Inertial(0.37, np.array([0.01, 0, -0.012]), 1e-4 * np.eye(3))
    rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    stack = replace(made.result.assembly.layout.stack, R_rot_laser=rows, h=200.0)  # so long that its root is stiff
    post = upright(9.0, stack.shoulder, -60.0).fuse(box((-30, -30, -63), (30, 30, -55))).Solids()[0]
    sag = linkage_sag(stack, [mesh_of(post)], np.array([30.0, 30.0, -55.0]), lidar, 2300.0, 1e-6)
    EI, root, top = 2300.0 * math.pi / 4 * 9.0**4, stack.spigot_top, -63.0
    force, length = 0.37 * 9.80665, top - root
    arm = -12.0 - top
    sideways = force * (length**2 / 2 + arm * length) / EI
    off_axis = force * 10.0 * length / EI
    expected = np.array([[0, -sideways, 0], [sideways, 0, -off_axis], [0, 0, 0]])
    np.testing.assert_allclose(sag.rotation_rad[:2], expected[:2], atol=0.1 * sideways)
    shift = force * (length**3 / 3 + arm * length**2 / 2) / EI + sideways * (0 - top)  # of the optical centre
    assert sag.shift_m[0, 0] * 1000 == pytest.approx(shift, rel=0.1)
    assert np.abs(sag.rotation_error_rad).max() < 0.3 * sideways


def test_the_modulus_moves_the_linkage_and_not_the_shaft(made, monkeypatch):
    monkeypatch.setattr("scanwright.cad.statics.sag.EDGES", (12.0, 9.0))  # mm: the law holds on any grid
    assembly, scanner = made.result.assembly, made.scanner
    bodies = {
        "rot": Inertial(0.2, np.array([0, 0, -0.05]), 1e-4 * np.eye(3)),
        "laser": Inertial(0.37, np.array([0, 0, -0.012]), 1e-4 * np.eye(3)),
    }
    stiff = replace(scanner, printer=scanner.printer.model_copy(update={"modulus_gpa": 23.0}))
    stiffer = replace(assembly, layout=replace(assembly.layout, scanner=stiff))
    one, other = sag_of(assembly, bodies), sag_of(stiffer, bodies)
    shaft = (10 * other.rotation_rad - one.rotation_rad) / 9  # what the modulus does not change
    assert shaft[1, 0] == pytest.approx(-shaft[0, 1], rel=1e-6) and abs(shaft[0, 0]) < 1e-9  # round
    assert np.linalg.norm(one.rotation_rad - shaft) > 0.3 * np.linalg.norm(one.rotation_rad)
    constant, _ = split(one.rotation_rad, one.shift_m, np.array([0.0, 0.0, -1.0]))
    assert constant.angle_rad == pytest.approx(np.linalg.norm(one.rotation_rad[:, 2]))
