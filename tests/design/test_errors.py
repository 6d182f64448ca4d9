"""Errors: the builtin that each one also is, their fields, and what remains of them in another process."""

import pickle

import pytest

from scanwright.design import errors


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
        raise kind("pole = 'x': three numbers", "pole")
    assert isinstance(caught.value, errors.ScanwrightError)
    assert str(caught.value).startswith("pole = 'x': three numbers") and caught.value.fields == ("pole",)


@pytest.mark.parametrize("kind", [errors.NumericalError, errors.DeviceTimeoutError, errors.TaskError])
def test_a_worker_process_hands_over_message_and_fields(kind):
    error = kind("rate = 0: above 0", "rate")
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), again.fields) == (kind, str(error), ("rate",))
