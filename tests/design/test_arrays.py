"""What a function says of its arrays holds wherever the tests call it."""

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from scanwright.design import frames
from scanwright.design.density.ball_count import ball_count
from scanwright.design.self_occlusion import SelfOcclusion


def test_a_wrong_shape_is_refused():
    with pytest.raises(TypeCheckError, match="points_b"):
        frames.apply(np.eye(4), np.zeros((3, 5)))
    with pytest.raises(TypeCheckError, match="T_a_b"):
        frames.apply(np.eye(3), np.zeros((5, 3)))


def test_a_wrong_dtype_is_refused():
    with pytest.raises(TypeCheckError, match="directions"):
        ball_count(np.eye(3), np.eye(3, dtype=int), 0.1)


def test_axes_of_one_name_are_of_one_length():
    SelfOcclusion(np.zeros(4, bool), np.zeros((4, 720), bool))
    with pytest.raises(TypeCheckError, match="stator"):
        SelfOcclusion(np.zeros(4, bool), np.zeros((5, 720), bool))
