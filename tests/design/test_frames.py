"""Rotations obey the axioms of the group, and the chain says what docs/conventions.md says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scanwright.design.frames import (
    R_rot_laser,
    R_world_rot,
    Rx,
    Ry,
    Rz,
    apply,
    rigid,
    roll_pitch_yaw,
    rotvec_to_matrix,
)

angle = st.floats(-7, 7) | st.floats(-1e-7, 1e-7) | st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi, -np.pi])
rotvec = st.tuples(angle, angle, angle)
offset = st.tuples(*[st.floats(-5, 5)] * 3)
about = st.sampled_from([Rx, Ry, Rz])


def close(actual, expected, atol=1e-12):
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


@given(about, angle)
def test_a_rotation_is_orthonormal_and_keeps_handedness(R, a):
    close(R(a) @ R(a).T, np.eye(3))
    assert np.linalg.det(R(a)) == pytest.approx(1)


@given(about, angle, angle)
def test_angles_about_one_axis_add_and_the_opposite_angle_undoes(R, a, b):
    close(R(a) @ R(b), R(a + b))
    close(R(a) @ R(-a), np.eye(3))


@pytest.mark.parametrize(
    ("R", "start", "end"), [(Rx, [0, 1, 0], [0, 0, 1]), (Ry, [0, 0, 1], [1, 0, 0]), (Rz, [1, 0, 0], [0, 1, 0])]
)
def test_a_quarter_turn_is_counter_clockwise(R, start, end):
    close(R(np.pi / 2) @ start, end)


@given(st.lists(angle, min_size=1, max_size=4), about)
def test_many_angles_give_a_stack_of_the_single_rotations(angles, R):
    stack = R(np.array(angles))
    assert stack.shape == (len(angles), 3, 3)
    for one, a in zip(stack, angles, strict=True):
        close(one, R(a))


@given(angle, angle, angle)
def test_the_order_of_the_factors_is_that_of_the_paper(a, b, c):
    # scipy: upper case is intrinsic, written from the left
    close(R_world_rot(a, b, c), Rotation.from_euler("XYZ", [a, b, c]).as_matrix())
    close(R_rot_laser(a, b, c), Rotation.from_euler("ZYX", [c, b, a]).as_matrix())
    close(R_world_rot(a, b), R_world_rot(a, b, 0))
    close(R_rot_laser(a, b), R_rot_laser(a, b, 0))


@given(angle, angle, angle)
def test_roll_pitch_and_yaw_turn_about_fixed_axes(a, b, c):
    R = Rotation.from_euler("xyz", [a, b, c]).as_matrix()  # lower case is about axes that stay
    close(Rotation.from_euler("xyz", roll_pitch_yaw(R)).as_matrix(), R, atol=2e-9)


@given(st.floats(-7, 7))
def test_the_standard_alignments_roll_about_x_and_pitch_about_y(gamma):
    rolling, pitching = np.radians([0, 90, 0, -90]), np.radians([-90, 0, 90, 0])
    close(R_world_rot(*rolling[:2], gamma) @ R_rot_laser(*rolling[2:]), Rx(gamma))
    close(R_world_rot(*pitching[:2], gamma) @ R_rot_laser(*pitching[2:]), Ry(gamma))


@given(angle, angle, angle, angle, angle, angle)
def test_the_first_column_of_the_chain_is_the_beam(a_rot, b_rot, gamma, a_laser, b_laser, bearing):
    chain = R_world_rot(a_rot, b_rot, gamma) @ R_rot_laser(a_laser, b_laser) @ Rz(bearing)
    in_laser = np.array([np.cos(bearing), np.sin(bearing), 0.0])
    close(chain[:, 0], R_world_rot(a_rot, b_rot, gamma) @ (R_rot_laser(a_laser, b_laser) @ in_laser))
    close(chain[:, 2], R_world_rot(a_rot, b_rot, gamma) @ R_rot_laser(a_laser, b_laser)[:, 2])


@given(rotvec)
def test_the_exponential_agrees_with_scipy(v):
    close(rotvec_to_matrix(v), Rotation.from_rotvec(v).as_matrix(), atol=1e-11)


@given(st.tuples(*[st.floats(-1e-8, 1e-8)] * 3))
def test_a_small_rotation_vector_is_its_first_order(v):
    x, y, z = v
    first_order = np.array([[1, -z, y], [z, 1, -x], [-y, x, 1]])
    close(rotvec_to_matrix(v), first_order, atol=2e-16)


@given(rotvec, rotvec, offset, offset, offset)
def test_neighbouring_subscripts_cancel(v, w, t_a_b, t_b_c, p_c):
    T_a_b = rigid(Rotation.from_rotvec(v).as_matrix(), t_a_b)
    T_b_c = rigid(Rotation.from_rotvec(w).as_matrix(), t_b_c)
    p_c = np.array([p_c])
    close(apply(T_a_b @ T_b_c, p_c), apply(T_a_b, apply(T_b_c, p_c)), atol=1e-11)
    by_hand = Rotation.from_rotvec(v).apply(Rotation.from_rotvec(w).apply(p_c) + t_b_c) + t_a_b
    close(apply(T_a_b @ T_b_c, p_c), by_hand, atol=1e-11)


def test_a_transform_takes_the_origin_of_b_to_its_place_in_a_and_broadcasts():
    T = rigid(Rz(np.array([0.0, np.pi / 2])), [1.0, 2.0, 3.0])
    assert T.shape == (2, 4, 4)
    close(T[:, :, 3], [[1, 2, 3, 1]] * 2)
    close(T[:, 3], [[0, 0, 0, 1]] * 2)
    close(apply(T[1], np.array([[1.0, 0, 0]])), [[1, 3, 3]])
    many_origins = rigid(np.eye(3), np.arange(12.0).reshape(4, 3))
    close(many_origins[:, :3, 3], np.arange(12.0).reshape(4, 3))
