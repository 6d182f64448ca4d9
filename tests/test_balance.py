"""The counterweight: what it balances, measured on meshes; where it has room; when there is none."""

import math
from dataclasses import replace

import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from cad.assembly import make_parts
from cad.balance import RUBS_NM, SAW, SECTIONS, Counterweight, _estimated_moment, counterweight_of, torque_nm
from cad.drives.drive import drive_of
from cad.holes import rounds_of
from cad.instructions import instructions_text
from cad.joints import joints_of
from cad.parts.linkage_sizing import Ear, linkage_of
from cad.shadow import shadow_of, triangles_of
from design.angles import Angles, AngleSet
from design.catalogue import load_catalogue
from design.left_out import LeftOut
from design.scanner import scanner_of

SHIPPED = [(-180, 55, 80, -75), (0, 90, 0, -90)]  # ground_ahead, rolling
STEEL, PLASTIC, ALUMINIUM = 7.85e-3, 1.24e-3, 2.7e-3  # g/mm3


def scanner_for(*angles, sensor="UTM-30LX", servo="MX-64R"):
    names = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")
    record = AngleSet(
        task="balance",
        angles_deg=Angles(**dict(zip(names, angles, strict=True))),
        sensor=sensor,
        servo=servo,
        slip_ring="UH1256-02-0610-06S",
    )
    return scanner_of(record, "fdm-0.4", load_catalogue())


def found_for(scanner):
    return counterweight_of(scanner, linkage_of(scanner, drive_of(scanner).stack))


@pytest.fixture(scope="module", params=SHIPPED, ids=["ground_ahead", "rolling"])
def made(request):
    scanner = scanner_for(*request.param)
    return scanner, make_parts(scanner)


def meshes(assembly, names):
    return {n: trimesh.Trimesh(m.vertices, m.faces) for n, m in ((n, assembly.mesh(n)) for n in names)}


def test_the_rotor_is_balanced_by_its_meshes(made):
    scanner, assembly = made
    plastic = scanner.printer.density_g_cm3 / 1000
    density = {"counterweight": STEEL, "servo_shaft": ALUMINIUM}
    moment = np.zeros(2)
    for name, mesh in meshes(assembly, assembly.turning_parts()).items():
        moment += density.get(name, plastic) * mesh.volume * mesh.center_mass[:2]
    lidar = scanner.lidar
    to_middle = lidar.body_mm[2] / 2 - lidar.optical_height_mm
    moment += lidar.mass_g * to_middle * scanner.angles.T_rot_laser()[:2, 2]
    without = (
        moment - STEEL * (bar := meshes(assembly, ["counterweight"])["counterweight"]).volume * bar.center_mass[:2]
    )
    assert torque_nm(scanner, np.linalg.norm(without)) > 10 * RUBS_NM
    assert torque_nm(scanner, np.linalg.norm(moment)) < RUBS_NM


def test_the_estimate_that_chooses_the_bar_is_that_of_the_solids(made):
    scanner, _ = made
    linkage = linkage_of(scanner, drive_of(scanner).stack)
    estimate = _estimated_moment(scanner, linkage)
    bare = make_parts(
        replace(scanner, servo=scanner.servo.model_copy(update={"backlash_deg": 0.0})),
        lambda name: name in ("alignment_linkage", "sub_plate"),
    )
    assert isinstance(bare.counterweight, LeftOut)
    lidar = scanner.lidar
    true = lidar.mass_g * (lidar.body_mm[2] / 2 - lidar.optical_height_mm) * linkage.stack.R()[:2, 2]
    for mesh in meshes(bare, bare.made).values():
        true = true + scanner.printer.density_g_cm3 / 1000 * mesh.volume * mesh.center_mass[:2]
    off = np.linalg.norm(estimate - true) / np.linalg.norm(true)
    assert off < 0.03


def test_the_bar_touches_nothing_but_its_ear_and_no_beam(made):
    scanner, assembly = made
    bodies = {}
    for name, mesh in assembly.meshes().items():
        bodies[name] = manifold3d.Manifold(manifold3d.Mesh64(mesh.vertices, mesh.faces.astype(np.uint64)))
    bar = bodies.pop("counterweight")
    for name, body in bodies.items():
        assert (bar ^ body).volume() < 0.05, name
        if name != "alignment_linkage":
            assert bar.min_gap(body, 2.0) > 0.9, name
    seen = triangles_of({name: assembly.mesh(name) for name in ("counterweight", "servo_case")})
    assert not shadow_of(scanner, seen).beams.any()


def test_screws_from_below_and_a_step_that_says_so(made):
    scanner, assembly = made
    rounds = {name: rounds_of(solid) for name, solid in (assembly.made | assembly.bought).items()}
    joints = joints_of(scanner, assembly, rounds)
    (joint,) = [joint for joint in joints if joint.onto == "counterweight"]
    assert (joint.part, joint.count, joint.fixing, joint.screw.name) == ("alignment_linkage", 2, "thread", "M4")
    bar = assembly.counterweight
    assert bar.ear.high - bar.ear.low + 6 <= joint.length_mm <= bar.ear.high - bar.ear.low + bar.section[1]
    text = instructions_text(scanner, assembly, joints, "0" * 12)
    assert text.index("Lidar on its seat") < text.index("Counterweight on the linkage") < text.index("Linkage on the")


@given(
    moment=st.floats(600, 12_000),
    azimuth=st.floats(-math.pi, math.pi),
    section=st.sampled_from(SECTIONS),
    start=st.floats(12, 30),
)
def test_a_bar_is_cut_to_the_moment_that_it_balances(moment, azimuth, section, start):
    ear = Ear(azimuth, 10.0, 50.0, -70.0, -64.0, ((20.0, 30.0), (36.0, 46.0)), 4.4)
    bar = Counterweight(ear=ear, section=section, start=start, length=0.0)
    away = np.array([math.cos(azimuth), math.sin(azimuth)])
    cut = bar.balancing(-moment * away)
    own = cut.mass_g * (cut.start + cut.length / 2)
    finest = cut.mass_g / max(cut.length, SAW) * SAW / 2 * (cut.end + SAW)
    assert abs(own - moment) <= finest


@pytest.mark.parametrize(
    ("scanner", "why"),
    [
        (scanner_for(0, 0, 30, -60), "upright"),
        (scanner_for(0, 55, -35, 30), "in the fan"),
        (scanner_for(9, -85, 46, 7, sensor="URG-04LX", servo="AX-12A"), "in the fan"),
    ],
)
def test_where_there_is_none_the_reason_is_told(scanner, why):
    found = found_for(scanner)
    assert isinstance(found, LeftOut) and why in found.why


def test_a_servo_without_play_needs_none():
    scanner = scanner_for(*SHIPPED[1])
    exact = replace(scanner, servo=scanner.servo.model_copy(update={"backlash_deg": 0.05}))
    assert "less than the noise" in found_for(exact).why
    untold = replace(scanner, servo=scanner.servo.model_copy(update={"backlash_deg": None}))
    assert isinstance(found_for(untold), Counterweight)
