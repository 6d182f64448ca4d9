"""Errors: the builtin that each one also is, and what a worker process hands over."""

import pickle

import pytest

from scanwright.design import errors
from scanwright.design.angles import load_angles
from scanwright.design.catalogue.catalogue import load_product
from scanwright.design.files.atomic_file import atomic_write
from scanwright.design.task.task import load_task


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [
        (errors.TaskError, ValueError),
        (errors.NumericalError, ArithmeticError),
        (errors.BuildError, ValueError),
        (errors.RecordingError, ValueError),
        (errors.SceneError, ValueError),
        (errors.InstallError, ImportError),
        (errors.DeviceTimeoutError, TimeoutError),
    ],
)
def test_an_error_is_also_the_builtin_that_fits(kind, builtin):
    with pytest.raises(builtin) as caught:
        raise kind("pole = 'x': three numbers")
    assert isinstance(caught.value, errors.ScanwrightError)
    assert str(caught.value).startswith("pole = 'x': three numbers")


@pytest.mark.parametrize("kind", [errors.NumericalError, errors.DeviceTimeoutError, errors.TaskError])
def test_a_worker_process_hands_over_the_message(kind):
    error = kind("rate = 0: above 0")
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again)) == (kind, str(error))


def test_a_file_that_does_not_exist_is_a_file_not_found_error(tmp_path):
    for load in (load_task, load_angles, load_product):
        with pytest.raises(FileNotFoundError) as caught:
            load(tmp_path / "none.toml")
        assert isinstance(caught.value, errors.TaskError) and "none.toml" in str(caught.value)


def test_our_own_error_in_the_body_is_not_reported_as_a_failure_to_write(tmp_path):
    path = tmp_path / "out"
    with pytest.raises(errors.DeviceTimeoutError, match="no answer"), atomic_write(path, errors.RecordingError):
        raise errors.DeviceTimeoutError("no answer")
