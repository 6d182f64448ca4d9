"""Leads between lidar and ring: paths that keep their radius, and ways through the room on the rotor."""

from dataclasses import replace

import numpy as np
import pytest
from scanners import avoided, scanner_at

from scanwright.cad.layout.cables.lead_joint import JOINT_LENGTH, JOINT_STEP, TUBE_WALL, joint_of
from scanwright.cad.layout.cables.leads import leads_of, outlet_mm, rotor_space_of
from scanwright.cad.layout.cables.route import Ending, Path, short_path
from scanwright.cad.layout.direct.cage import BearingCage
from scanwright.cad.layout.direct.stack import CAGE_SEAT_WALL
from scanwright.cad.layout.placement import placement_of
from scanwright.cad.parts.all_parts import laid_out, parts_of
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import BuildError
from scanwright.design.scanner import scanner_of

BORE, CAPSULE = "SNU11-P0210", "SRC022A-6"
SETTINGS = {  # servo on the axis, upright and lying lidar; with a bearing; a hollow shaft
    "upright": ((0, 0, 0, 0), "UTM-30LX", BORE),
    "lying": ((0, 0, 90, 0), "UTM-30LX", BORE),
    "bearing": ((-41, 56, 30, -90), "UTM-30LX", "SNU11-P0210"),
    "belt": ((0, 19, 84, 41), "URG-04LX", CAPSULE),
    "joints": ((-161.07, -30.61, -17.79, -26.82), "UTM-30LX", BORE),  # the longest straight piece lies in the hub
}
NO_PLACE_ON_THE_SHORTEST = {
    "S2": ((-89.16, -31.66, 19.63, -39.98), "RPLIDAR S2", "UH1256-02-0610-06S"),
    "TiM551": ((-71.37, -41.04, -16.88, -33.87), "TiM551", "UH1256-02-0610-06S"),
}


def scanner_of_setting(setting):
    (alpha_rot, beta_rot, alpha, beta), lidar, ring = (SETTINGS | NO_PLACE_ON_THE_SHORTEST)[setting]
    angles = AngleSet(
        task="test",
        angles_deg=Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha, beta_laser=beta),
        sensor=lidar,
        servo="MX-64R",
        slip_ring=ring,
    )
    return scanner_of(angles, "fdm-0.4", load_catalogue())


def layout_for(setting, **of_ring):
    scanner = scanner_of_setting(setting)
    return laid_out(replace(scanner, slip_ring=scanner.slip_ring.model_copy(update=of_ring)))


def test_behind_a_short_tab_the_bend_of_the_leads_keeps_its_length():
    paths = []
    for laser_deg in [(-54.65, 21.17), *np.random.default_rng(1286).uniform(-89, 89, (3, 2))]:
        setting = (0, 90, *(float(angle) for angle in laser_deg))
        scanner = scanner_at(setting, sensor="LD19", servo="XH430-W350", slip_ring=BORE, printer="sla")
        paths += [lead.path for lead in laid_out(scanner).leads if lead.path is not None]
    assert len(paths) == 3 and all(path.slack() > -1e-6 for path in paths)


def bend_radii(points):
    """Of the circles through neighbours: side lengths over four times the area (Heron)."""
    a, b, c = points[:-2], points[1:-1], points[2:]
    sides = [np.linalg.norm(q - p, axis=1) for p, q in ((a, b), (b, c), (a, c))]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return np.prod(sides, axis=0) / (4 * np.maximum(area, 1e-12))


def test_a_path_keeps_its_radius_and_is_as_long_as_its_points():
    path = Path(((0, 0, 0), (0, 0, 30), (40, 0, 30), (40, 30, 60), (0, 40, 60)), 7.0)
    points = path.points(0.05)
    points = points[np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9])]
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(path.length(), abs=1e-3)
    assert bend_radii(points[::4]).min() == pytest.approx(7.0, rel=1e-3)
    assert path.least_radius() == 7.0
    np.testing.assert_allclose(points[[0, -1]], np.array(path.corners)[[0, -1]])


def test_what_is_too_short_for_its_radius_has_no_path():
    with pytest.raises(ValueError, match=r"4\.00 mm too near"):
        Path(((0, 0, 0), (0, 0, 10), (10, 0, 10), (10, 0, 30)), 7.0).pieces()


class Balls:
    """Random small balls to avoid, around the end of a cable."""

    def __init__(self, draw):
        self.middles = draw.normal((0.0, 0.0, 50.0), 15.0, (60, 3))
        self.radii = draw.uniform(0.5, 1.5, 60)

    def free(self, points, half, gap):
        apart = np.linalg.norm(points[:, None] - self.middles, axis=2) - self.radii
        return (apart > half + gap).all(axis=1)


def test_a_short_path_is_free_from_end_to_end_arcs_at_its_ends_included():
    draw, found = np.random.default_rng(0), 0
    for _ in range(15):
        space, lattice = Balls(draw), draw.uniform(-70, 70, (250, 3))
        outwards = draw.normal(size=(2, 3))
        outwards /= np.linalg.norm(outwards, axis=1)[:, None]
        ends = [
            Ending(at[None], out, (10.0, 14.0, 20.0, 28.0), 0.0, 3.0)
            for at, out in zip(([0.0, 0.0, -50.0], [0.0, 0.0, 50.0]) * np.ones((2, 1)), outwards, strict=True)
        ]
        path = short_path(space, ends[:1], ends[1:], 2.0, 12.0, lattice)
        if path is None:
            continue
        found += 1
        points = path.points(0.5)
        outside = np.linalg.norm(points[:, None] - [end.corners[0] for end in ends], axis=2).min(axis=1) > 3.5
        assert space.free(points[outside], 2.0, 0.0).all()
    assert found > 3


@pytest.mark.parametrize("setting", ["upright", "belt"])
def test_a_lead_may_be_neither_in_the_shaft_nor_in_the_rotor_of_its_ring(setting):
    place = placement_of(scanner_of_setting(setting))
    room, stack, draw = rotor_space_of(place, ()), place.stack, np.random.default_rng(3)
    turn = draw.uniform(0, 2 * np.pi, 50)
    ring = place.scanner.slip_ring
    around = [(stack.shaft_diameter / 2, place.drive.floor + 3, stack.shoulder)]
    if ring.bore_mm > 0:
        around.append((ring.rotor.diameter_mm / 2, stack.ring_top, stack.leads_low))
    for radius, low, high in around:
        if low < high:
            points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), draw.uniform(low, high, 50)])
            assert not room.free(points, 1.0, 0.1).any()


@pytest.mark.parametrize("setting", SETTINGS)
def test_every_lead_leaves_the_ring_and_meets_its_cable_in_line(setting):
    layout = layout_for(setting)
    lidar, stack = layout.scanner.lidar, layout.stack
    leads = layout.leads
    assert [lead.y for lead in leads] == list(lidar.cable_y_mm)
    for lead in leads:
        corners = np.array(lead.path.corners)
        np.testing.assert_allclose(corners[-1], outlet_mm(layout, lead.y, lidar.cable_straight_mm))
        last = corners[-1] - corners[-2]
        np.testing.assert_allclose(last / np.linalg.norm(last), stack.R()[:, 0], atol=1e-9)
        assert corners[0, 2] >= stack.ring_top and np.allclose(corners[0, :2], corners[1, :2])
        assert lead.path.slack() > -1e-6
        assert lead.path.least_radius() >= layout.scanner.slip_ring.lead_bend_radius_mm
    one, *others = [lead.path.points(0.5) for lead in leads]
    for other in others:
        assert np.linalg.norm(one[:, None] - other, axis=2).min() > leads[0].diameter


@pytest.mark.parametrize("setting", SETTINGS)
def test_a_lead_turns_above_all_that_stands_still(setting):
    layout = layout_for(setting)
    room = rotor_space_of(layout, avoided(parts_of(layout), turns=True))
    for lead in layout.leads:
        points = lead.path.points(1.0)
        outside = points[np.hypot(points[:, 0], points[:, 1]) > layout.stack.hub_radius + lead.diameter]
        assert outside[:, 2].min() > room.floor + lead.diameter / 2
        assert room.free(outside[3:-6], lead.diameter / 2, 0.4).all()


@pytest.mark.parametrize("setting", ["upright", "bearing"])
def test_the_leads_of_a_stator_leave_its_end_beside_flange_and_case_and_their_plug_passes_the_base(setting):
    layout = layout_for(setting)
    ring, case, stack = layout.scanner.slip_ring, layout.scanner.servo.case_max_mm, layout.stack
    (leads,) = (cable for cable in layout.cables if cable.name == "stator_leads")
    corners, half = np.array(leads.path.corners), ring.lead_diameter_mm / 2
    assert leads.diameter == ring.lead_diameter_mm and leads.path.least_radius() >= ring.lead_bend_radius_mm
    assert corners[0, 2] == stack.ring_bottom == pytest.approx(stack.leads_low - 6 - 38)
    np.testing.assert_allclose(corners[1, :2], corners[0, :2])
    assert max(stack.flange_radius, case[1]) < corners[0, 1] - half < corners[0, 1] + half < ring.outer_diameter_mm / 2
    if setting == "bearing":
        cage = layout.drive.of(BearingCage)
        half_width, end = cage.lead_hole
        assert 2 * half_width > ring.plug_mm[0] and end - stack.flange_radius > ring.plug_mm[1]
        assert end < stack.cage_inner and corners[0, 1] + half < end
        assert corners[1, 2] < cage.low, "straight through the base"


def test_the_hub_is_as_wide_as_the_bearing_that_the_leads_need():
    for thick in np.random.default_rng(6).uniform(4.0, 15.0, 3):
        stack = layout_for("bearing", lead_diameter_mm=thick).stack
        assert stack.leads_radius + stack.lead_diameter / 2 < stack.bearing.bore_mm / 2 < stack.hub_radius
        seat = stack.bearing.outer_mm / 2 + CAGE_SEAT_WALL
        cage = max(seat / -stack.cage_top, stack.cage_outer / -stack.cage_roof)
        assert stack.hub_radius / stack.h <= cage, "a hub in the shadow of the cage"


def test_a_ring_whose_leads_pass_no_bearing_is_refused_with_what_to_do():
    with pytest.raises(BuildError, match=r"lead_diameter_mm = 18\.0 .*take a ring with fewer circuits"):
        layout_for("bearing", lead_diameter_mm=18.0)


@pytest.mark.parametrize("setting", SETTINGS)
def test_joints_touch_neither_the_hub_nor_the_other_lead(setting):
    layout = layout_for(setting)
    leads = [lead for lead in layout.leads if lead.joint is not None]
    assert leads
    for lead in leads:
        thick, points = lead.diameter / 2 + TUBE_WALL, lead.joint.points()
        assert np.ptp(points, axis=0) @ np.ptp(points, axis=0) == pytest.approx(JOINT_LENGTH**2)
        if setting != "belt":  # whose leads leave through the shaft
            assert (np.hypot(points[:, 0], points[:, 1]) > layout.stack.hub_radius + thick).all()
        for other in leads:
            if other is not lead:
                nearest = np.linalg.norm(points[:, None] - other.path.points(0.5), axis=2).min()
                assert nearest > thick + other.diameter / 2


@pytest.mark.parametrize("setting", NO_PLACE_ON_THE_SHORTEST)
def test_a_longer_path_is_taken_if_the_shortest_has_no_place_for_the_joint(setting):
    assert all(lead.joint is not None for lead in layout_for(setting).leads)


class Wall:
    """Room behind a wall across y: nothing with y below it is free."""

    def __init__(self, at):
        self.at = at

    def free(self, points, half, gap):
        return points[:, 1] - half - gap > self.at


def test_a_joint_goes_as_far_from_the_middle_as_it_must_and_stays_there_where_nothing_is_free():
    path = Path(((0, 0, 0), (0, 0, 20), (0, 60, 20)), 5.0)  # the last piece is straight from y = 5 to 60
    half, middle = 1.0, np.array([0, 32.5, 20])
    for wall, off in ((-10.0, 0.0), (30.0, 4.9), (100.0, 0.0)):
        joint = joint_of(path, half, Wall(wall), [])
        points = joint.points()
        away = joint.middle[1] - middle[1]
        assert off == 0.0 or points[:, 1].min() > wall + half + TUBE_WALL
        assert off - 0.1 <= away < off + JOINT_STEP + 0.1
        np.testing.assert_allclose(joint.middle[[0, 2]], middle[[0, 2]], atol=1e-12)
    beside = np.array([[0.0, y, 20.0] for y in np.arange(20.0, 35.0)])
    clear = joint_of(path, half, Wall(-10.0), [(beside, 3.0)]).points()[:, 1]
    assert clear.min() > 34.0 + 3.0 or clear.max() < 20.0 - 3.0
    assert joint_of(Path(((0, 0, 0), (0, 0, 20), (0, 16, 20)), 5.0), half, Wall(-10.0), []) is None, (
        "11 mm are too short"
    )


def test_where_no_way_is_wide_enough_there_is_none():
    assert [lead.path for lead in layout_for("upright", lead_bend_radius_mm=60.0).leads] == [None, None]


def test_without_ring_or_facts_nothing_is_laid():
    assert layout_for("upright", lead_diameter_mm=None).leads == ()
    layout = layout_for("upright")
    assert leads_of(replace(layout, scanner=replace(layout.scanner, slip_ring=None)), ()) == ()
