"""`assembly.step`: names, colours, and the lidar's pose, read back by the kernel alone."""

import cadquery as cq
import numpy as np
import pytest
from scanners import UPRIGHT, scanner_at

from scanwright.cad.assembly.assembly import as_tree
from scanwright.cad.assembly.bought import bought_of, servo_case, servo_horn
from scanwright.cad.files.step import step_text
from scanwright.cad.parts.all_parts import laid_out
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.servo import Servo
from scanwright.design.scanner import scanner_of


@pytest.fixture(scope="module")
def read_back(tmp_path_factory, parts_of):
    alpha, beta = UPRIGHT[2:]
    path = tmp_path_factory.mktemp("assembly") / "assembly.step"
    tree = as_tree(parts_of(scanner_at(UPRIGHT)))
    path.write_text(step_text(tree, "assembly"), encoding="ascii")
    a, b = np.radians([alpha, beta])
    Ry = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    Rx = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    return Ry @ Rx, {child.name: child for child in cq.Assembly.importStep(str(path)).children}


def centre(child):
    return np.array(cq.Shape.centerOfMass(child.toCompound()).toTuple())


def test_names_and_colours(read_back):
    _, parts = read_back
    assert {"servo_shaft", "slip_ring_adapter", "alignment_linkage", "servo_case", "servo_horn"} <= parts.keys()
    assert {"ring_stator", "ring_rotor", "lidar_body", "lidar_window", "lidar_cap", "lidar_cable_1"} <= parts.keys()
    colours = {name: child.color for name, child in parts.items()}
    assert all(colour is not None for colour in colours.values())
    np.testing.assert_allclose(colours["alignment_linkage"].toTuple()[:3], (0.93, 0.45, 0.10), atol=1e-3)


def test_the_lidar_faces_the_way_the_angles_say(read_back):
    R, parts = read_back
    window, cap = centre(parts["lidar_window"]), centre(parts["lidar_cap"])
    np.testing.assert_allclose(window, 0, atol=1e-6)  # UTM-30LX: window 41 to 69, optical plane at 55
    np.testing.assert_allclose((cap - window) / np.linalg.norm(cap - window), R[:, 2], atol=1e-9)
    cables = (centre(parts["lidar_cable_1"]) + centre(parts["lidar_cable_2"])) / 2
    rear = cables - (cables @ R[:, 2]) * R[:, 2]
    np.testing.assert_allclose(rear / np.linalg.norm(rear), -R[:, 0], atol=1e-9)  # cables leave at the rear
    left = centre(parts["lidar_cable_2"]) - centre(parts["lidar_cable_1"])
    np.testing.assert_allclose(left / np.linalg.norm(left), R[:, 1], atol=1e-9)


def test_the_servo_stands_behind_the_rotor_with_its_long_end_at_minus_y(read_back):
    _, parts = read_back
    case = centre(parts["servo_case"])
    assert case[2] < centre(parts["servo_horn"])[2] < centre(parts["ring_rotor"])[2] < -50
    assert -20 < case[1] < -15
    np.testing.assert_allclose(centre(parts["ring_stator"])[:2], 0, atol=1e-6)


def test_every_body_of_a_lidar_whose_window_reaches_its_top_has_a_mesh():
    angles = AngleSet(
        task="test",
        angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=0, beta_laser=0),
        sensor="RPLIDAR A1",
        servo="MX-64R",
        slip_ring="SNU11-P0210",
    )
    bodies = bought_of(laid_out(scanner_of(angles, "sla", load_catalogue())))
    assert all(body.make().Volume() > 0 for body in bodies)
    assert not [body for body in bodies if body.name == "lidar_cap"]


@pytest.mark.parametrize("servo", [one for one in load_catalogue() if isinstance(one, Servo)], ids=lambda one: one.name)
def test_no_screw_in_a_horn_meets_the_case(servo):
    """The threads of some horns are deeper than the disc in front of the case."""
    case, horn = servo_case(servo, 0.0), servo_horn(servo, 0.0)
    assert horn.BoundingBox().zmin <= -servo.horn_thread_depth_mm + 1e-6
    assert case.intersect(horn).Volume() < 1e-6
