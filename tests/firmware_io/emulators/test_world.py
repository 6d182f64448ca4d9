"""The emulator of the world: the frame chain both ways round, the sensor's noise and silence."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.firmware_io.recordings.deskew import place
from scanwright.design import frames
from scanwright.design.angles import STANDARD_DEG, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError
from scanwright.design.scene.ray_caster import Hits, build_scene, cast
from scanwright.firmware_io.emulators.head import read_load
from scanwright.firmware_io.emulators.servo_plant import Load
from scanwright.firmware_io.emulators.world import RangeModel, furnished_room, measure_ranges, range_model, rays, see
from scanwright.firmware_io.samples import JointLog, Scan

BEARINGS_RAD = load_catalogue().get("UTM-30LX", Lidar).bearings_rad()
MODEL = RangeModel(sigma_m=0.01, quantum_m=0.001, range_min_m=0.1, range_max_m=30, incidence_max_rad=np.radians(85))


def angle_set(alpha_rot=0.0, beta_rot=0.0, alpha_laser=0.0, beta_laser=0.0, **more):
    angles = {"alpha_rot": alpha_rot, "beta_rot": beta_rot, "alpha_laser": alpha_laser, "beta_laser": beta_laser}
    return AngleSet(task="test", angles_deg=angles, sensor="UTM-30LX", servo="MX-64R", **more)


@pytest.fixture(scope="module")
def room():
    return build_scene(furnished_room())


@pytest.mark.parametrize(("name", "turn"), [("rolling", frames.Rx), ("pitching", frames.Ry)])
def test_a_standard_alignment_turns_its_beams_about_one_world_axis(name, turn):
    joint_rad = np.linspace(-7, 7, BEARINGS_RAD.size)
    _, found = rays(angle_set(*STANDARD_DEG[name]), BEARINGS_RAD, joint_rad)
    flat = np.stack([np.cos(BEARINGS_RAD), np.sin(BEARINGS_RAD), np.zeros_like(BEARINGS_RAD)], axis=1)
    np.testing.assert_allclose(found, np.einsum("nij,nj->ni", turn(joint_rad), flat), atol=1e-12)


degrees = st.floats(-180, 180)
millimetres = st.floats(-100, 100)


@settings(max_examples=20, deadline=None)
@given(
    setting=st.tuples(*[degrees] * 4),
    delta=st.tuples(*[st.floats(-2, 2)] * 2),
    lever=st.tuples(*[millimetres] * 3),
    stand=st.tuples(*[millimetres] * 3),
    turn_rad_s=st.floats(-10, 10),
)
def test_what_is_seen_is_assembled_where_it_was(room, setting, delta, lever, stand, turn_rad_s):
    angles = angle_set(*setting, delta_rotvec_rot_deg=delta, t_rot_laser_mm=lever, t_world_rot_mm=stand)
    scan = Scan(
        stamp_ns=10**18,
        angle_min_rad=float(BEARINGS_RAD[0]),
        angle_increment_rad=float(BEARINGS_RAD[1] - BEARINGS_RAD[0]),
        time_increment_s=0.025 / 1440,
        scan_time_s=0.025,
        range_min_m=0.0,
        range_max_m=100.0,
        range_m=np.ones(BEARINGS_RAD.size, np.float32),
        intensity=np.empty(0, np.float32),
    )
    log = JointLog(np.array([0, 10**9]) + scan.stamp_ns, np.array([0.5, 0.5 + turn_rad_s]))
    placed = next(place([scan], log, angles))
    origins, directions = rays(angles, scan.bearing_rad, placed.joint_rad)
    np.testing.assert_allclose(placed.points_m, origins + directions, atol=1e-9)  # all ranges are 1 m
    hits = see(room, angles, scan.bearing_rad, placed.joint_rad)
    np.testing.assert_allclose(hits.range_m, cast(room, origins, placed.points_m - origins).range_m, rtol=1e-6)


def test_each_beam_is_cast_at_the_angle_of_its_own_time(room):
    turning = BEARINGS_RAD.size * 1e-4 * np.linspace(0, 1, BEARINGS_RAD.size)
    angles = angle_set(0, 0, 40, 30)
    together = see(room, angles, BEARINGS_RAD, turning)
    for beam in (0, 400, 1080):
        alone = see(room, angles, BEARINGS_RAD[[beam]], turning[[beam]])
        assert alone.range_m[0] == together.range_m[beam]


def hits_at(range_m, incidence_deg=0.0, count=100_000):
    return Hits(np.full(count, float(range_m)), np.full(count, np.radians(incidence_deg)), np.zeros(count, np.int32))


def test_noise_has_the_spread_that_was_set_and_no_bias():
    error_m = measure_ranges(hits_at(4.0004), MODEL, np.random.default_rng(3)).range_m - 4.0004
    expected_m = np.hypot(0.01, 0.001 / np.sqrt(12))
    assert error_m.std() == pytest.approx(expected_m, rel=4 / np.sqrt(2 * error_m.size))
    assert abs(error_m.mean()) < 4 * expected_m / np.sqrt(error_m.size)


def test_ranges_are_whole_millimetres():
    range_mm = measure_ranges(hits_at(4.0004), MODEL, np.random.default_rng(3)).range_m * 1000
    np.testing.assert_allclose(range_mm, np.rint(range_mm), atol=1e-9)


@pytest.mark.parametrize(
    ("range_m", "incidence_deg", "says"),
    [(31, 0, np.inf), (np.inf, np.nan, np.inf), (5, 86, np.inf), (0.02, 0, -np.inf)],
)
def test_what_cannot_be_measured_says_why(range_m, incidence_deg, says):
    found = measure_ranges(hits_at(range_m, incidence_deg, 9), MODEL, np.random.default_rng(0))
    assert found.range_m.tolist() == [says] * 9
    assert found.intensity.tolist() == [0] * 9


def test_equal_seeds_are_equal_scans(room):
    hits = see(room, angle_set(0, 0, 40, 30), BEARINGS_RAD, np.zeros(BEARINGS_RAD.size))
    first, again, other = (measure_ranges(hits, MODEL, np.random.default_rng(seed)).range_m for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.9


def test_a_sensor_of_the_catalogue_has_its_own_limits():
    urg = range_model(load_catalogue().get("URG-04LX", Lidar))
    assert (urg.range_min_m, urg.range_max_m) == (0.02, 4.0)
    assert urg.sigma_m(np.array([0.5, 3.0])) == pytest.approx([0.01, 0.03])  # 1 % beyond 1 m
    assert range_model(load_catalogue().get("URG-04LX", Lidar), sigma_mm=3).sigma_m == 0.003


def test_noise_grows_with_the_range_as_the_catalogue_states():
    """Two walls head on, at 1.5 and 3 m: a triangulating sensor has four times the noise at twice the range."""
    a1, n = load_catalogue().get("RPLIDAR A1", Lidar), 20_000
    for range_m, sigma_m in ((1.5, 0.015), (3.0, 0.06)):
        hits = Hits(np.full(n, range_m), np.zeros(n), np.zeros(n, np.int32))
        measured = measure_ranges(hits, range_model(a1), np.random.default_rng(5))
        assert measured.range_m.std() == pytest.approx(sigma_m, rel=0.03)


def test_the_head_of_a_scanner_with_a_ring_feels_its_friction(tmp_path):
    (tmp_path / "scanner.urdf").write_text(URDF)
    ring = angle_set(20, -55, -80, 75).model_copy(update={"slip_ring": "UH1256-02-0610-06S"})
    assert read_load(tmp_path, ring).bearing_nm == pytest.approx(0.18)
    bare = ring.model_copy(update={"slip_ring": None})
    assert read_load(tmp_path, bare).bearing_nm == Load().bearing_nm


URDF = """<robot name="r"><link name="world"/>
<link name="rot"><inertial><origin xyz="0.01 -0.02 -0.05" rpy="0 0 0"/><mass value="0.3"/>
<inertia ixx="1e-4" ixy="1e-5" ixz="0" iyy="2e-4" iyz="0" izz="3e-4"/></inertial></link>
<link name="laser"><inertial><origin xyz="0.002 0 -0.03" rpy="0 0 0"/><mass value="0.37"/>
<inertia ixx="3e-4" ixy="0" ixz="0" iyy="3e-4" iyz="0" izz="2e-4"/></inertial></link></robot>"""


def test_gravity_on_the_head_is_the_slope_of_its_potential_energy(tmp_path):
    (tmp_path / "scanner.urdf").write_text(URDF)
    angles = angle_set(20, -55, -80, 75, t_rot_laser_mm=(3, -2, 1))
    load = read_load(tmp_path, angles)

    def energy_J(joint_rad):
        heights_m = [
            (angles.T_world_rot(joint_rad) @ [0.01, -0.02, -0.05, 1])[2],
            (angles.T_world_laser(joint_rad) @ [0.002, 0, -0.03, 1])[2],
        ]
        return 9.80665 * np.dot([0.3, 0.37], heights_m)

    for joint_rad in np.linspace(-3, 3, 7):
        torque_nm = -(energy_J(joint_rad + 1e-5) - energy_J(joint_rad - 1e-5)) / 2e-5
        assert load.gravity_nm * np.cos(joint_rad + load.gravity_phase_rad) == pytest.approx(torque_nm, abs=1e-8)
    assert load.inertia_kg_m2 > 3e-4 + 0.3 * (0.01**2 + 0.02**2)


def test_before_the_build_the_head_is_light_and_afterwards_a_broken_file_is_one_line(tmp_path):
    assert read_load(tmp_path, angle_set()) == Load()
    for text in ("", "<robot/>", URDF.replace("izz", "jzz")):
        (tmp_path / "scanner.urdf").write_text(text)
        with pytest.raises(DeviceError, match="no masses of the links rot and laser"):
            read_load(tmp_path, angle_set())


def test_the_room_of_the_tour_is_closed_and_within_reach(room):
    directions = np.random.default_rng(0).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    found = cast(room, np.zeros(3), directions)
    assert 0.8 < found.range_m.min() < found.range_m.max() < 6
