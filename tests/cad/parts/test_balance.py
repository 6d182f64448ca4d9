"""The counterweight: what it balances, measured on meshes; where it has room; when there is none."""

import math
from dataclasses import replace

import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scanners import CAPSULE, GROUND_AHEAD, ROLLING, bare_linkage, scanner_at

from scanwright.cad.assembly.assembly import link_bodies, rotor_moment, rotor_of
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.assembly.scenes import scenes_of
from scanwright.cad.assembly.shadow import shadow_of, triangles_of
from scanwright.cad.files.manual.instructions import instructions_text
from scanwright.cad.geometry.inertia import of_line, of_solid
from scanwright.cad.layout.cables.leads import SAMPLE
from scanwright.cad.layout.loads import RUBS_NM
from scanwright.cad.layout.placement import drive_of, placement_of
from scanwright.cad.layout.rotor import counterweight
from scanwright.cad.layout.rotor.counterweight import SAW, SECTIONS, TRIM, Counterweight
from scanwright.cad.layout.rotor.imbalance import estimated_moment, keeps_flank, torque_nm
from scanwright.cad.layout.rotor.linkage import Ear, neck_corners
from scanwright.cad.parts.linkage.linkage_hub import hub
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.motion import Sweep
from scanwright.studio.view.scanner_bodies import make_bodies

BALANCED = [GROUND_AHEAD, ROLLING]  # which other tests make too
STEEL, PLASTIC, ALUMINIUM, WIRES = 7.85e-3, 1.24e-3, 2.7e-3, 1.5e-3  # g/mm3


def scanner_for(*angles, sensor="UTM-30LX", servo="MX-64R"):
    return scanner_at(angles, sensor=sensor, servo=servo)


def found_for(scanner):
    return placement_of(scanner).counterweight


@pytest.fixture(scope="module", params=BALANCED, ids=["ground_ahead", "rolling"])
def made(request, parts_of):
    scanner = scanner_for(*request.param)
    return scanner, parts_of(scanner)


def meshes(assembly, names):
    return {n: trimesh.Trimesh(m.vertices, m.faces) for n, m in ((n, assembly.mesh(n)) for n in names)}


def test_the_rotor_is_balanced_by_its_meshes(made):
    scanner, assembly = made
    plastic = scanner.printer.density_g_cm3 / 1000
    density = {"counterweight": STEEL, "servo_shaft": ALUMINIUM}
    moment = np.zeros(2)
    for name, mesh in meshes(assembly, assembly.parts_in("rot")).items():
        moment += density.get(name, plastic) * mesh.volume * mesh.center_mass[:2]
    lidar = scanner.lidar
    to_middle = lidar.body_mm[2] / 2 - lidar.optical_height_mm
    moment += lidar.mass_g * to_middle * scanner.angles.T_rot_laser()[:2, 2]
    without = (
        moment - STEEL * (bar := meshes(assembly, ["counterweight"])["counterweight"]).volume * bar.center_mass[:2]
    )
    assert torque_nm(scanner, np.linalg.norm(without)) > 10 * RUBS_NM[0]
    assert torque_nm(scanner, np.linalg.norm(moment)) < RUBS_NM[0]


def test_the_friction_of_a_ring_makes_a_counterweight_needless():
    left_out = found_for(scanner_at(GROUND_AHEAD, friction_nm=(0.16, 0.2)))
    assert isinstance(left_out, LeftOut) and "friction of bearing and ring, 0.16 N m" in left_out.why
    light = found_for(scanner_at(GROUND_AHEAD, friction_nm=(0.006, 0.2)))
    assert not isinstance(light, LeftOut)


def test_leads_weigh_what_their_wires_do(made):
    scanner, assembly = made
    wires = meshes(assembly, [name for name in assembly.bought if name.startswith("rotor_lead")]).values()
    laid = [number for number, lead in enumerate(assembly.layout.leads, 1) if lead.path is not None]
    assert len(wires) == len(laid)
    if not laid:  # no way is wide enough, which is a warning
        return
    mass = WIRES * sum(mesh.volume for mesh in wires)
    moment = WIRES * sum(mesh.volume * mesh.center_mass[:2] for mesh in wires)
    bare = replace(assembly, layout=replace(assembly.layout, leads=()))
    with_leads, without = (rotor_of(scanner, link_bodies(each)) for each in (assembly, bare))
    # the shrink tube over a joint is no wire
    assert 1000 * (with_leads.mass_kg - without.mass_kg) == pytest.approx(mass, rel=0.06) and mass > 1
    np.testing.assert_allclose(rotor_moment(assembly) - rotor_moment(bare), moment, atol=8)
    lead, solid = assembly.layout.leads[laid[0] - 1], assembly.bought[f"rotor_lead_{laid[0]}"]
    line, tube = of_line(lead.mass_g, lead.path.points(SAMPLE)), of_solid(solid, 1000 * WIRES)
    np.testing.assert_allclose(line.inertia_kg_m2, tube.inertia_kg_m2, atol=0.06 * np.abs(tube.inertia_kg_m2).max())
    np.testing.assert_allclose(line.centre_m, tube.centre_m, atol=3e-3)


@pytest.mark.parametrize(
    "scanner", [scanner_for(*BALANCED[0]), scanner_for(135, -15, -25, -25, sensor="URG-04LX", servo="AX-12A")]
)
def test_the_estimate_that_chooses_the_bar_is_that_of_the_solids(scanner):
    linkage = bare_linkage(scanner)
    estimate = estimated_moment(scanner, linkage, neck_corners(linkage, 0))
    exact = scanner.servo.model_copy(update={"backlash_deg": 0.0})  # so that no ear is made
    bare = make_parts(replace(scanner, servo=exact), lambda spec: spec.name in ("alignment_linkage", "sub_plate"))
    assert isinstance(bare.layout.counterweight, LeftOut) and ("sub_plate" in bare.made) == (linkage.ears is not None)
    lidar = scanner.lidar
    true = lidar.mass_g * (lidar.body_mm[2] / 2 - lidar.optical_height_mm) * linkage.stack.R()[:2, 2]
    for mesh in meshes(bare, bare.made).values():
        true = true + scanner.printer.density_g_cm3 / 1000 * mesh.volume * mesh.center_mass[:2]
    assert np.linalg.norm(estimate - true) < 0.03 * np.linalg.norm(true)


def test_the_bar_touches_nothing_but_its_ear_and_no_beam_wherever_it_slides(made):
    scanner, assembly = made
    bodies = {}
    for name, mesh in assembly.meshes().items():
        bodies[name] = manifold3d.Manifold(manifold3d.Mesh64(mesh.vertices, mesh.faces.astype(np.uint64)))
    bar, azimuth = bodies.pop("counterweight"), assembly.layout.counterweight.ear.azimuth
    for slid in (-TRIM, 0.0, TRIM):
        there = bar.translate((slid * math.cos(azimuth), slid * math.sin(azimuth), 0.0))
        for name, body in bodies.items():
            assert (there ^ body).volume() < 0.05, (name, slid)
            if name != "alignment_linkage":
                assert there.min_gap(body, 2.0) > 0.9, (name, slid)
    seen = {name: triangles_of(assembly)[name] for name in ("counterweight", "servo_case")}
    assert not shadow_of(scanner, seen, assembly.turning()).beams.any()


def test_screws_from_below_and_a_step_that_says_so(made):
    _, assembly = made
    joints = assembly.layout.joints
    (joint,) = [joint for joint in joints if joint.onto == "counterweight"]
    assert (joint.part, joint.count, joint.fixing, joint.screw.name) == ("alignment_linkage", 2, "thread", "M4")
    bar = assembly.layout.counterweight
    assert bar.ear.high - bar.ear.low + 6 <= joint.length_mm <= bar.ear.high - bar.ear.low + bar.section[1]
    text = instructions_text(assembly, scenes_of(assembly), [])
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


UST = {"sensor": "UST-10LX"}
SMALL = {"sensor": "URG-04LX", "servo": "AX-12A"}


@pytest.mark.parametrize(
    ("scanner", "why"),
    [
        (scanner_for(0, 0, 30, -60), "upright"),
        (scanner_for(-175, 10, 0, 20, **UST), "no more than the friction of bearing and ring"),
        (scanner_for(-115, 50, 65, 10, **SMALL), "in the fan"),
        (scanner_for(135, -85, 35, -90, **UST), "too heavy for the horn of MX-64R"),
        (scanner_for(75, 65, -20, 10), "the lidar or its cables"),
        (scanner_for(105, -20, -10, -70, **UST), "near to the deck"),
        (scanner_for(-45, 80, -11, 0, **UST), "shorter than its screws"),
    ],
)
def test_where_there_is_none_the_reason_is_told(scanner, why):
    found = found_for(scanner)
    assert isinstance(found, LeftOut) and why in found.why


def test_a_sweep_that_gravity_holds_on_one_flank_needs_none():
    scanner = scanner_for(*BALANCED[1])
    linkage = bare_linkage(scanner)
    moment = estimated_moment(scanner, linkage, neck_corners(linkage, 0))
    # the axis is level: the imbalance hangs straight down somewhere, and 90 deg from there gravity pulls hardest
    up = scanner.angles.T_world_rot(0.0)[2, :2]
    lowest = math.degrees(math.atan2(-up[1], -up[0]) - math.atan2(moment[1], moment[0])) % 360
    sideways = (lowest + 90) % 360 - 180

    def swept(low, high):
        motion = Sweep(limits_deg=(low, high), period_s=10.0)
        return replace(scanner, angles=scanner.angles.model_copy(update={"motion": motion}))

    held = swept(max(-180.0, sideways - 60), min(180.0, sideways + 60))
    assert keeps_flank(held, moment) and "one flank" in found_for(held).why
    assert not keeps_flank(swept(-180.0, 180.0), moment)
    assert not keeps_flank(scanner, moment)


def test_an_ear_over_the_index_mark_carries_it():
    scanner = scanner_for(0, 90, -80, 0)  # wires and ear at +y
    assembly = make_parts(scanner, lambda spec: spec.name == "alignment_linkage")
    ear = assembly.layout.counterweight.ear
    assert math.degrees(ear.azimuth) == pytest.approx(90)
    part = meshes(assembly, ["alignment_linkage"])["alignment_linkage"]
    middle = (ear.low + ear.high) / 2
    at_mark, beside = ([[x, 200.0, middle]] for x in (0.0, 2.0))
    deep, flush = (
        part.ray.intersects_location(start, [[0.0, -1.0, 0.0]])[0][:, 1].max() for start in (at_mark, beside)
    )
    assert flush == pytest.approx(ear.end, abs=0.01) and flush - deep == pytest.approx(1.0, abs=0.05)


def test_both_halves_of_the_studio_together_name_it_once():
    scanner = scanner_at((0, 40, -20, -70), slip_ring=None, **SMALL)
    names = [body.name for turning in (True, False) for body in make_bodies(scanner, turning)]
    assert names.count("counterweight") == 1 and len(names) == len(set(names))


def test_a_servo_without_play_needs_none():
    scanner = scanner_for(*BALANCED[1])
    exact = replace(scanner, servo=scanner.servo.model_copy(update={"backlash_deg": 0.05}))
    assert "less than the noise" in found_for(exact).why
    untold = replace(scanner, servo=scanner.servo.model_copy(update={"backlash_deg": None}))
    assert isinstance(found_for(untold), Counterweight)


@pytest.mark.parametrize("servo", ["XC330-M288", "XM430-W350", "MX-64R", "STS3215"])
def test_an_ear_and_its_hub_are_one_body_on_every_shaft(servo):
    rng = np.random.default_rng(3)
    for ring in (None, "SNU11-P0210", "SRC022A-6"):
        try:
            scanner = scanner_at((0, 20, 40, 5), sensor="UST-10LX", servo=servo, slip_ring=ring)
            bare = bare_linkage(scanner)
        except BuildError:  # this servo carries no such ring
            continue
        section = SECTIONS[rng.integers(len(SECTIONS))]
        ear = counterweight._bar(scanner, bare, rng.uniform(-np.pi, np.pi), section).ear
        assert len(hub(replace(bare, ear=ear)).Solids()) == 1


@pytest.mark.parametrize(("ring", "instead"), [(None, "a stronger servo"), (CAPSULE, "a ring with a bore")])
def test_a_rotor_that_its_drive_cannot_hold_is_balanced_or_refused(ring, instead):
    rng, outcomes = np.random.default_rng(8), set()
    for sensor, share in (("LMS111", 0.3), ("UTM-30LX", 3.0)):
        scanner = scanner_at((0, 90, *rng.uniform(20, 80, 2)), sensor=sensor, servo="MX-64R", slip_ring=ring)
        linkage = bare_linkage(scanner)
        torque = torque_nm(scanner, float(np.linalg.norm(estimated_moment(scanner, linkage, neck_corners(linkage, 0)))))
        stall = 5 * torque * share if ring is None else 50.0
        weak = replace(scanner, servo=scanner.servo.model_copy(update={"stall_torque_nm": stall, "backlash_deg": 0.0}))
        beyond = torque > min(drive_of(weak).limits).nm
        try:
            assert isinstance(found_for(weak), Counterweight) == beyond
            outcomes.add(beyond)
        except BuildError as error:
            outcomes.add(None)
            assert beyond and f"take {instead}" in str(error)
    assert outcomes == {None, False}
