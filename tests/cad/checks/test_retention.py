"""What holds the lidar: geometry from the solids, forces from statics worked out in another way."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scanners import CAPSULE, GROUND_AHEAD, ROLLING, scanner_at

import scanwright.cad.checks.loads.retention as room
from scanwright.cad import solids
from scanwright.cad.checks.loads.retention import hanging_on, retention_checks, worst_shares
from scanwright.cad.layout.direct.cage import BearingCage
from scanwright.cad.layout.joints import ScrewAxis
from scanwright.cad.layout.tightening import ALUMINIUM, BOUGHT, MOULDED, PRINTED, hold_of, stress_area_mm2
from scanwright.cad.screws import SCREWS, thread_in_part
from scanwright.design.catalogue.catalogue import load_catalogue

SCANNERS = {"direct": scanner_at(GROUND_AHEAD), "belt": scanner_at(ROLLING, slip_ring=CAPSULE)}


@pytest.fixture(scope="module", params=SCANNERS)
def scanner_and_assembly(request, parts_of):
    scanner = SCANNERS[request.param]
    return scanner, parts_of(scanner)


def joint_of(assembly, part, onto):
    return next(joint for joint in assembly.layout.joints if (joint.part, joint.onto) == (part, onto))


def test_a_hub_that_moves_takes_its_screws_into_the_metal_of_the_shaft(scanner_and_assembly):
    """Loose by two turns, heads off their seats, the screws still stop it, up, down and around."""
    _, assembly = scanner_and_assembly
    shaft = assembly.made[assembly.layout.drive.shaft]
    joint = joint_of(assembly, "alignment_linkage", assembly.layout.drive.shaft)
    for axis in joint.axes:
        start, along = np.array(axis.start), np.array(axis.along)
        core = solids.cylinder(joint.screw.core / 2 - 0.01, start - 1.0 * along, along, joint.length_mm)
        assert core.intersect(shaft).Volume() < 1e-3  # the screw is in its thread
        for way in ((0, 0, 1.0), (0, 0, -1.0)):
            assert core.moved(solids.location(np.eye(3), way)).intersect(shaft).Volume() > 2.0
        assert core.rotate(solids.vector((0, 0, 0)), solids.vector((0, 0, 1)), 12.0).intersect(shaft).Volume() > 2.0


def test_what_hangs_on_a_joint_is_what_falls_with_it(scanner_and_assembly):
    _, assembly = scanner_and_assembly
    above = {"lidar", "alignment_linkage", *({"counterweight"} & assembly.made.keys())}
    shaft = assembly.layout.drive.shaft
    assert hanging_on(assembly, joint_of(assembly, "alignment_linkage", shaft)) == above
    assert hanging_on(assembly, joint_of(assembly, "alignment_linkage", "lidar_body")) == {"lidar"}
    if shaft == "main_shaft":  # it rests on its lower ring where the axis hangs
        assert hanging_on(assembly, joint_of(assembly, "shaft_ring", shaft)) == {*above, shaft, "shaft_pulley"}
    deck = next(joint for joint in assembly.layout.joints if joint.onto == "deck")
    assert hanging_on(assembly, deck) >= {"lidar", "servo", "base_mount", *assembly.made}


def test_a_bearing_takes_load_off_the_horn_and_gives_it_to_its_cage(scanner_and_assembly, monkeypatch):
    _, assembly = scanner_and_assembly
    if assembly.layout.drive.of(BearingCage) is None:
        return

    def margins():
        return {c.subject: c.value for c in retention_checks(assembly) if c.code == "retention"}

    shared = margins()
    monkeypatch.setattr(room, "_borne", lambda *_: (np.zeros(3), 0.0))
    alone = margins()
    changed = {subject: shared[subject] / alone[subject] for subject in alone if shared[subject] != alone[subject]}
    assert changed.pop("servo_shaft") > 1.5
    assert set(changed) == {"slip_ring_adapter", "bearing_cage"} and max(changed.values()) < 0.5


def test_everything_holds_five_g_and_every_screw_has_its_thread(scanner_and_assembly):
    _, assembly = scanner_and_assembly
    checks = retention_checks(assembly)
    (friction,) = [check for check in checks if "friction: they" in check.message]
    assert {check.severity for check in checks if check is not friction} == {"ok"}
    # the pulley, which is set by turning, or the sleeve of the bearing
    assert friction.message.startswith("shaft_pulley" if assembly.layout.drive.shaft == "main_shaft" else "journal_sl")
    joints = [joint for joint in assembly.layout.joints if joint.fixing != "grub"]
    assert [
        sum(check.code == kind and check.value is not None for check in checks) for kind in ("retention", "screw")
    ] == [len(joints)] * 2


def test_what_gives_way_fails_and_what_has_little_to_spare_warns(scanner_and_assembly, monkeypatch):
    _, assembly = scanner_and_assembly
    margin = min(c.value for c in retention_checks(assembly) if c.code == "retention" and c.value is not None)
    for over, severity in ((0.4 * margin, "ok"), (0.7 * margin, "warning"), (1.3 * margin, "error")):
        with monkeypatch.context() as shaken:
            shaken.setattr(room, "SHOCK_G", 5.0 * over)
            checks = [c for c in retention_checks(assembly) if c.code == "retention" and c.value is not None]
        weakest = min(checks, key=lambda check: check.value)
        assert (weakest.severity, weakest.value) == (severity, pytest.approx(margin / over, rel=0.02))


def test_friction_or_bare_plastic_does_not_carry_a_lidar(scanner_and_assembly):
    _, assembly = scanner_and_assembly
    joints = assembly.layout.joints
    hub = joint_of(assembly, "alignment_linkage", assembly.layout.drive.shaft)
    loose = _instead(assembly, hub, replace(hub, fixing="grub"))
    assert [check.subject for check in retention_checks(loose) if check.severity == "error"] == [
        f"{hub.part} and {hub.onto}"
    ]
    for nuts in (joint for joint in joints if joint.onto == "bearing_tower" and joint.part == "base_mount"):
        bare = _instead(assembly, nuts, replace(nuts, fixing="thread", thread=None))
        failed = [check.message for check in retention_checks(bare) if check.severity == "error"]
        assert any("threads in bare plastic" in message for message in failed)


def _instead(assembly, joint, other):
    changed = tuple(other if each == joint else each for each in assembly.layout.joints)
    return replace(assembly, layout=replace(assembly.layout, joints=changed))


@pytest.mark.parametrize("share", [0.0, 0.7, -1.3])
def test_a_force_is_shared_as_equal_springs_share_it(scanner_and_assembly, share):
    """The least sum of squares that is in equilibrium, found without a stiffness; and every direction tried."""
    scanner, assembly = scanner_and_assembly
    joint = joint_of(assembly, "alignment_linkage", "lidar_body")
    centre, bearing = np.array([0.02, -0.03, 0.05]), np.array([0.0, 0.0, -0.08])
    start = np.array([axis.start for axis in joint.axes]) / 1000
    along = np.array([axis.along for axis in joint.axes])
    balance = np.zeros((6, 3 * joint.count))
    for i, at in enumerate(start):
        balance[:3, 3 * i : 3 * i + 3] = np.eye(3)
        for k, unit in enumerate(np.eye(3)):
            balance[3:, 3 * i + k] = np.cross(at, unit)
    directions = np.random.default_rng(0).normal(size=(4000, 3))
    pull = push = 0.0
    for force in directions / np.linalg.norm(directions, axis=1)[:, None]:
        more = share * force * [1, 1, 0]
        moment = np.cross(centre, force) + np.cross(bearing, more)
        shares = (np.linalg.pinv(balance) @ np.concatenate([force + more, moment])).reshape(-1, 3)
        axial = (shares * along).sum(axis=1)
        pull = max(pull, np.abs(axial).max())
        push = max(push, np.linalg.norm(shares - axial[:, None] * along, axis=1).max())
    assert worst_shares(joint, centre, (bearing, share)) == pytest.approx((pull, push), rel=5e-3)
    assert scanner.lidar.base.screw == joint.screw.name


def test_torque_and_strength_against_hand_calculation():
    assert stress_area_mm2(SCREWS["M3"]) == pytest.approx(5.03, abs=0.01)  # ISO 898-1
    assert stress_area_mm2(SCREWS["M4"]) == pytest.approx(8.78, abs=0.02)
    joint = room.Joint(
        "alignment_linkage", "servo_shaft", "thread", SCREWS["M3"], (ScrewAxis((9, 0, 0), (-1, 0, 0)),), 8.4, 4.3
    )
    hold = hold_of(joint, PRINTED, ALUMINIUM)
    head = math.pi / 4 * (5.5**2 - 3.4**2)  # mm2 of plastic under the head
    assert hold.preload_n == pytest.approx(20 * head, rel=1e-6) and hold.torque_nm == 0.18  # 0.2 F d
    assert hold.engaged_mm == pytest.approx(12 - 8.4) and hold.pull_n == pytest.approx(40 * head)
    assert hold.push_n == pytest.approx(3 * 8.4 * 40) and "plastic" in hold.push_by
    assert hold_of(replace(joint, fixing="grub"), PRINTED, ALUMINIUM) is None
    x, y = np.meshgrid(*2 * [np.linspace(-2.75, 2.75, 1101)])
    beside = np.count_nonzero((np.hypot(x, y) < 2.75) & (np.abs(y) > 1.7)) * 0.005**2
    slid = hold_of(replace(joint, slot_mm=(3.4, 7.4)), PRINTED, ALUMINIUM)
    assert slid.preload_n == pytest.approx(20 * beside, rel=2e-3) and beside < head / 2


@pytest.mark.parametrize("seed", range(20))
def test_no_torque_crushes_a_body_under_a_head_or_a_nut(seed):
    rng = np.random.default_rng(seed)
    screw = SCREWS[rng.choice(["M2", "M2.5", "M3", "M4", "M5"])]
    fixing = rng.choice(["nut", "trap", "deck", "thread"])
    bodies = rng.choice(np.array([PRINTED, MOULDED, BOUGHT, ALUMINIUM], dtype=object), 2)
    washer = float(2.5 * screw.nominal) if rng.random() < 0.5 else None
    grip, depth = (float(value) for value in rng.uniform(3.0, 9.0, 2))
    axis = ScrewAxis((0, 0, 0), (0, 0, 1))
    hold = hold_of(room.Joint("one", "other", fixing, screw, (axis,), grip, depth, washer_mm=washer), *bodies)
    hole = math.pi / 4 * (screw.nominal + 0.4) ** 2
    faces = [math.pi / 4 * (washer or screw.head_diameter) ** 2 - hole]
    if fixing != "thread":  # the inscribed circle of a nut
        faces.append(math.pi / 4 * screw.nut_across**2 - hole)
    for body, face in zip(bodies, faces, strict=False):
        assert hold.preload_n <= body.pressure_mpa * face * (1 + 1e-9)


@pytest.mark.parametrize("profile", ["fdm-0.4", "fdm-0.4-insert", "fdm-0.4-nut", "sla"])
def test_no_profile_of_plastic_gives_a_carrying_screw_bare_threads(profile):
    printer = load_catalogue().products[profile]
    for size in ("M2.5", "M3", "M4"):
        thread = thread_in_part(SCREWS[size], printer, carries=True)
        assert thread.trap is not None or thread.insert
    crowded = thread_in_part(SCREWS["M3"], printer, nut_fits=False, carries=True)
    assert crowded.insert
