"""`scanner.urdf` loads in a URDF library and moves like the angle set."""

import io
from xml.etree import ElementTree

import numpy as np
import pytest
import yourdfpy
from scanners import mount_offset_mm

from scanwright.cad.files.part_files import build_parts
from scanwright.cad.files.urdf import urdf_text
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.placement import drive_of
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.products import Bearing
from scanwright.design.errors import BuildError
from scanwright.design.frames import roll_pitch_yaw
from scanwright.design.scanner import scanner_of

CASES = {
    "rolling": {"angles_deg": (0, 90, 0, 0, -90, 0)},
    "pitching": {"angles_deg": (-90, 0, 0, 90, 0, 0)},
    "calibrated": {
        "angles_deg": (20, -35, 15, 40, -60, 0),
        "delta_rotvec_rot_deg": (0.3, -0.2),
        "t_rot_laser_mm": (1.2, -0.7, 0.1),
        "source": "calibration",
    },
}


NAMES = ("alpha_rot", "beta_rot", "gamma_rot", "alpha_laser", "beta_laser", "gamma_laser")
ANY_BODY = Inertial(1.0, np.zeros(3), np.eye(3))


@pytest.mark.parametrize("name", CASES)
def test_the_chain_is_that_of_the_angle_set(name, tmp_path):
    case = CASES[name]
    angles = AngleSet(
        task=name,
        sensor="UTM-30LX",
        servo="MX-64R",
        slip_ring="SNU11-P0210",
        **case | {"angles_deg": Angles(**dict(zip(NAMES, case["angles_deg"], strict=True)))},
    )
    offset = mount_offset_mm(scanner_of(angles, "fdm-0.4", load_catalogue()))
    angles = angles.model_copy(update={"t_world_rot_mm": offset})
    scanner = scanner_of(angles, "fdm-0.4", load_catalogue())
    bodies = dict.fromkeys(("servo", "rot", "laser"), ANY_BODY)
    (tmp_path / "scanner.urdf").write_text(urdf_text(scanner, drive_of(scanner), bodies, {"servo": [], "rot": []}))
    robot = yourdfpy.URDF.load(str(tmp_path / "scanner.urdf"))
    assert robot.actuated_joint_names == ["spin_joint"]
    assert {"world", "servo", "rot", "laser"} == set(robot.link_map)
    for joint in (0.0, 0.7, np.pi / 2, -2.5, 40.0):
        robot.update_cfg({"spin_joint": joint})
        np.testing.assert_allclose(robot.get_transform("laser", "world"), angles.T_world_laser(joint), atol=1e-6)
        np.testing.assert_allclose(robot.get_transform("rot", "world"), angles.T_world_rot(joint), atol=1e-6)


@pytest.mark.parametrize(
    ("ring", "motion", "ends"),
    [
        ("SNU11-P0210", {"mode": "spin", "period_s": 18.0}, None),
        ("SNU11-P0210", {"mode": "sweep", "limits_deg": (-90.0, 80.0), "period_s": 12.0}, None),
        (None, {"mode": "sweep", "limits_deg": (-90.0, 80.0), "period_s": 12.0}, (-90.0, 80.0)),
    ],
)
def test_a_scanner_whose_cable_would_wind_up_has_ends_and_no_other(ring, motion, ends):
    setting = Angles(alpha_rot=0, beta_rot=0, alpha_laser=0, beta_laser=50)
    angles = AngleSet(task="ends", sensor="UTM-30LX", servo="MX-64R", slip_ring=ring, motion=motion, angles_deg=setting)
    scanner = scanner_of(angles, "fdm-0.4", load_catalogue())
    bodies = dict.fromkeys(("servo", "rot", "laser"), ANY_BODY)
    text = urdf_text(scanner, drive_of(scanner), bodies, {"servo": [], "rot": []})
    joint = yourdfpy.URDF.load(io.StringIO(text)).joint_map["spin_joint"]
    assert joint.type == ("continuous" if ends is None else "revolute")
    if ends is not None:
        np.testing.assert_allclose(np.degrees((joint.limit.lower, joint.limit.upper)), ends, atol=1e-3)


def test_meshes_are_found_beside_the_file_and_are_metres(made):
    folder, result = made.folder, made.result
    robot = yourdfpy.URDF.load(str(folder / "scanner.urdf"))
    for visual in (v for link in robot.link_map.values() for v in link.visuals if v.geometry.mesh is not None):
        assert (folder / visual.geometry.mesh.filename).is_file()
        np.testing.assert_allclose(visual.geometry.mesh.scale, 0.001)
    named = {v.geometry.mesh.filename for link in robot.link_map.values() for v in link.visuals if v.geometry.mesh}
    assert named == {f"parts/{part.name}.stl" for part in result.parts}
    extent = robot.scene.extents.max()
    assert 0.2 < extent < 0.6


def test_masses_add_up_and_inertias_are_those_of_bodies(made):
    folder, result = made.folder, made.result
    mass = {}
    for link in ElementTree.parse(folder / "scanner.urdf").getroot().iter("link"):
        if link.get("name") == "world":
            continue
        mass[link.get("name")] = float(link.find("inertial/mass").get("value"))
        J = {key: float(value) for key, value in link.find("inertial/inertia").attrib.items()}
        principal = np.linalg.eigvalsh(
            [[J["ixx"], J["ixy"], J["ixz"]], [J["ixy"], J["iyy"], J["iyz"]], [J["ixz"], J["iyz"], J["izz"]]]
        )
        assert principal[0] > 0 and principal[2] <= principal[0] + principal[1]
    own = {part.name: part.mass_g / 1000 for part in result.parts}
    bearing = load_catalogue().get("61806-2RS", Bearing).mass_g / 1000 if "bearing_cage" in own else 0.0
    turning = own["servo_shaft"] + own["alignment_linkage"] + own.get("counterweight", 0.0) + 0.1 + bearing / 2
    turning += own.get("journal_sleeve", 0.0)
    turning += sum(lead.mass_g for lead in result.assembly.layout.leads) / 1000
    fixed = own["slip_ring_adapter"] + own["base_mount"] + own.get("bearing_cage", 0.0) + 0.1 + bearing / 2
    fixed += sum(cable.mass_g for cable in result.assembly.layout.cables) / 1000
    assert mass["rot"] == pytest.approx(turning, abs=5e-4)  # of the plain parts: their labels weigh that little
    assert mass["servo"] == pytest.approx(fixed + 0.126, abs=5e-4)
    assert mass["laser"] == pytest.approx(0.370)
    shaft = next(part for part in result.parts if part.name == "servo_shaft")
    assert own["servo_shaft"] == pytest.approx(
        (2.81e-6 if "bearing_cage" in own else 2.7e-6) * shaft.volume_mm3, rel=1e-4
    )


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, 0.4])
def test_fixed_axis_angles_survive_the_gimbal(pitch):
    c, s = np.cos([0.3, pitch]), np.sin([0.3, pitch])
    Rx = np.array([[1, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
    Ry = np.array([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
    roll, tip, yaw = roll_pitch_yaw(Rx @ Ry)
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(tip), np.sin(tip), np.cos(yaw), np.sin(yaw)
    back = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    np.testing.assert_allclose(back @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]]), Rx @ Ry, atol=1e-9)


def test_an_angle_set_that_names_another_place_is_refused(made, tmp_path):
    wrong = made.scanner.angles.model_copy(update={"t_world_rot_mm": (1.0, 2.0, 3.0)})
    with pytest.raises(BuildError, match=r"t_world_rot_mm = \[1.0, 2.0, 3.0\]"):
        build_parts(scanner_of(wrong, "fdm-0.4", load_catalogue()), made.result.assembly, tmp_path, lambda *_: None)
    assert list(tmp_path.iterdir()) == []
