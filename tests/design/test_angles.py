"""The angle set: what the file says is what the frames do."""

import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from scanwright.design.angles import STANDARD_DEG, Angles, AngleSet, load_angles
from scanwright.design.errors import TaskError
from scanwright.design.task.task import load_task

degrees = st.floats(-360, 360)
NAMES = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")


def angle_set(angles=(0, 0, 0, 0), **more):
    named = dict(zip(NAMES, angles, strict=True))
    return AngleSet(task="t", sensor="UTM-30LX", servo="MX-64R", angles_deg=Angles(**named), **more)


def full_table():
    """Every optional key in use."""
    return {
        "schema": "scanwright/angles/1",
        "task": "ground_ahead",
        "task_sha256": "ab" * 32,
        "source": "calibration",
        "angles_deg": {
            "alpha_rot": 10.0,
            "beta_rot": -20.0,
            "gamma_rot": 5.0,
            "alpha_laser": 90.0,
            "beta_laser": 12.5,
            "gamma_laser": 0.5,
        },
        "delta_rotvec_rot_deg": [0.1, -0.2],
        "t_rot_laser_mm": [1.0, -2.0, 0.5],
        "t_world_rot_mm": [0.0, 0.0, 130.0],
        "sensor": "UTM-30LX",
        "servo": "MX-64R",
        "slip_ring": "UH1256-02-0610-06S",
        "motion": {"mode": "spin", "period_s": 18.0},
        "J": -5.1,
        "J_error": 1e-4,
        "covariance": np.eye(4).tolist(),
        "versions": {"scanwright": "0.1.0"},
    }


def written(tmp_path, value):
    path = tmp_path / "angles.json"
    path.write_text(value if isinstance(value, str) else json.dumps(value), encoding="utf-8")
    return path


@given(
    st.tuples(degrees, degrees, degrees, degrees), st.tuples(degrees, degrees), st.tuples(*[st.floats(-500, 500)] * 3)
)
def test_the_json_text_reads_back_as_the_same_record(angles, delta, lever):
    one = angle_set(angles, delta_rotvec_rot_deg=delta, t_rot_laser_mm=lever, J=-5.1, J_error=1e-4)
    assert AngleSet.model_validate_json(one.to_json()) == one


def test_every_key_of_the_contract_survives_a_round_trip(tmp_path):
    one = load_angles(str(written(tmp_path, full_table())))
    assert json.loads(one.to_json()) == full_table()
    assert list(json.loads(one.to_json())) == list(full_table())
    assert one.to_json().endswith("}\n")


def test_a_folder_for_the_file_and_a_file_for_the_folder_are_told_what_to_name(tmp_path):
    with pytest.raises(TaskError, match=r"this is a folder without an angles\.json, not an angle set"):
        load_angles(tmp_path)
    path = written(tmp_path, full_table())
    with pytest.raises(TaskError, match=f"^{re.escape(f'{tmp_path}: this is a folder: name {path}')}$"):
        load_angles(tmp_path)
    says = re.escape(f"{path}: this is a file; name the build folder that contains ")
    with pytest.raises(TaskError, match=f"^{says}angles.json$"):
        load_angles(path / "angles.json")
    with pytest.raises(TaskError, match=f"^{says}task.toml$"):
        load_task(path / "task.toml")


def test_what_a_file_may_leave_out_is_zero_or_null(tmp_path):
    table = {"task": "mine", "sensor": "UTM-30LX", "servo": "AX-12A", "angles_deg": dict.fromkeys(NAMES, 1.0)}
    with pytest.raises(TaskError, match=r'angles\.json: schema: this key is required: "scanwright/angles/1"'):
        load_angles(written(tmp_path, table))
    table["schema"] = "scanwright/angles/1"
    one = load_angles(written(tmp_path, table))
    full = json.loads(one.to_json())
    assert full["schema"] == "scanwright/angles/1"
    assert full["source"] == "design"
    assert full["angles_deg"]["gamma_rot"] == full["angles_deg"]["gamma_laser"] == 0
    assert full["delta_rotvec_rot_deg"] == [0, 0]
    assert full["t_rot_laser_mm"] == full["t_world_rot_mm"] == [0, 0, 0]
    assert [full[key] for key in ("task_sha256", "slip_ring", "motion", "J", "J_error", "covariance")] == [None] * 6


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("angles_deg", {**dict.fromkeys(NAMES, 1.0), "beta_rot": True}),
        ("angles_deg", {**dict.fromkeys(NAMES, 1.0), "beta_rot": "90"}),
        ("angles_deg", {**dict.fromkeys(NAMES, 1.0), "beta_rot": 1e300}),
        ("t_world_rot_mm", [0, 0, 1e300]),
        ("t_rot_laser_mm", [0, False, 0]),
        ("delta_rotvec_rot_deg", ["0", 0]),
        ("motion", {"mode": "sweep", "limits_deg": [True, 90], "period_s": 9}),
        ("motion", {"mode": "spin", "period_s": "18"}),
        ("J", "-5"),
        ("covariance", [[0, 0, 0, "1"]] * 4),
    ],
)
def test_text_and_true_are_no_numbers_and_lengths_end_somewhere(tmp_path, key, value):
    with pytest.raises(TaskError, match=rf"angles\.json: {key}[. ]") as told:
        load_angles(written(tmp_path, full_table() | {key: value}))
    assert all(line.startswith(str(tmp_path)) for line in str(told.value).splitlines())


def test_a_record_cannot_be_changed():
    with pytest.raises(ValidationError, match="frozen"):
        angle_set().sensor = "URG-04LX"


@given(st.tuples(degrees, degrees, degrees, degrees), st.tuples(st.floats(-5, 5), st.floats(-5, 5)))
def test_the_correction_acts_on_the_left_in_the_rotation_frame(angles, delta):
    designed = Rotation.from_euler("YX", [angles[3], angles[2]], degrees=True)
    correction = Rotation.from_rotvec([*np.radians(delta), 0.0])
    corrected = angle_set(angles, delta_rotvec_rot_deg=delta)
    np.testing.assert_allclose(corrected.R_rot_laser(), (correction * designed).as_matrix(), atol=1e-12)
    np.testing.assert_array_equal(corrected.T_rot_laser()[:3, :3], corrected.R_rot_laser())


def test_the_lever_arm_turns_with_the_axis_in_closed_form():
    """A pitching scanner whose lidar sits 80 mm off the axis: the point swings on a circle of that radius."""
    scanner = angle_set(STANDARD_DEG["pitching"], t_rot_laser_mm=(0, -80, 0))
    x_scan, t = 2.5, np.linspace(-3, 3, 13)
    seen = scanner.T_world_laser(t) @ [x_scan, 0, 0, 1]
    np.testing.assert_allclose(seen[:, 0], x_scan * np.cos(t) + 0.08 * np.sin(t), atol=1e-12)
    np.testing.assert_allclose(seen[:, 1], 0, atol=1e-12)
    np.testing.assert_allclose(seen[:, 2], -x_scan * np.sin(t) + 0.08 * np.cos(t), atol=1e-12)


@given(degrees, st.floats(-10, 10))
def test_the_gammas_add_to_the_joint_position_and_to_nothing_else(gamma_rot, joint):
    plain = angle_set((20, -35, 40, 65), t_world_rot_mm=(10, 20, 130))
    table = plain.model_dump()
    table["angles_deg"]["gamma_rot"] = gamma_rot
    shifted = AngleSet.model_validate(table)
    np.testing.assert_allclose(
        shifted.T_world_laser(joint), plain.T_world_laser(joint + np.radians(gamma_rot)), atol=1e-11
    )
    np.testing.assert_allclose(plain.T_world_rot(joint)[:3, 3], [0.01, 0.02, 0.13])


@given(degrees, degrees, st.floats(-10, 10))
def test_the_axis_is_where_the_rotation_leaves_things(alpha, beta, joint):
    scanner = angle_set((alpha, beta, 30, 40))
    turned = scanner.T_world_rot(joint)[:3, :3] @ scanner.T_world_rot(0.0)[:3, :3].T
    np.testing.assert_allclose(turned @ scanner.axis_world(), scanner.axis_world(), atol=1e-12)


def test_the_standard_alignments_are_those_of_design_md():
    assert STANDARD_DEG == {"rolling": (0, 90, 0, -90), "pitching": (-90, 0, 90, 0)}


def without(key):
    return {name: value for name, value in full_table().items() if name != key}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", ["angles.json: not a JSON file"]),
        ("{", ["not a JSON file"]),
        ("[1, 2]", ["entire file"]),
        (full_table() | {"sensr": "x"}, ["sensr", "unknown key", "did you mean 'sensor'"]),
        (without("sensor"), ["sensor", "required"]),
        (full_table() | {"schema": "scanwright/angles/2"}, ["schema", "scanwright/angles/1"]),
        (full_table() | {"source": "guess"}, ["source", "guess"]),
        (full_table() | {"delta_rotvec_rot_deg": [0.1, 0.2, 0.3]}, ["delta_rotvec_rot_deg"]),
        (full_table() | {"t_rot_laser_mm": [1.0]}, ["t_rot_laser_mm"]),
        (full_table() | {"covariance": np.eye(3).tolist()}, ["covariance"]),
        (full_table() | {"J": "low"}, ["J", "low"]),
        (
            full_table() | {"motion": {"mode": "spin", "period_s": 0}},
            ["motion.period_s", "greater than or equal to 0.001"],
        ),
        (full_table() | {"angles_deg": dict.fromkeys(NAMES, "up")}, ["angles_deg.alpha_rot", "up"]),
        (full_table() | {"angles_deg": {"alpha_rot_deg": 3}}, ["angles_deg.alpha_rot_deg", "did you mean 'alpha_rot'"]),
        (json.dumps(full_table()).replace("12.5", "NaN"), ["angles_deg.beta_laser"]),
        (json.dumps(full_table()).replace("12.5", "1e999"), ["angles_deg.beta_laser"]),
    ],
)
def test_of_a_malformed_file_each_line_names_the_file_and_one_the_field(tmp_path, content, words):
    path = written(tmp_path, content)
    with pytest.raises(TaskError) as caught:
        load_angles(path)
    message = str(caught.value)
    assert all(line.startswith(str(path)) for line in message.splitlines())
    for word in [str(path), *words]:
        assert word in message


def test_a_byte_order_mark_is_left_out(tmp_path):
    path = tmp_path / "angles.json"
    path.write_text(angle_set().to_json(), encoding="utf-8-sig")
    assert load_angles(path) == angle_set()


def test_an_unreadable_file_is_one_line(tmp_path):
    (tmp_path / "latin.json").write_bytes(b"\xff\xfe")
    for path, reason in [
        (tmp_path / "none.json", "No such file"),
        (tmp_path, "folder"),
        (tmp_path / "latin.json", "UTF-8"),
    ]:
        with pytest.raises(TaskError, match=reason) as caught:
            load_angles(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)
