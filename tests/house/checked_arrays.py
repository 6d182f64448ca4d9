"""Arrays are checked while tests run: what a function of `design` or `firmware_io` says of its arrays must hold.

Every function and dataclass whose annotations speak of arrays is wrapped when its module has been imported. What numba
compiled is no Python function any more and stays as it is; what else a function takes may be a stand-in of a test. Only
the first calls of a function in a test are checked: a shape that is wrong is wrong from the first one on.
"""

import functools
import sys
from collections import Counter
from dataclasses import is_dataclass
from importlib.machinery import PathFinder, SourceFileLoader
from types import FunctionType
from typing import get_args

from beartype import beartype
from jaxtyping import AbstractArray, jaxtyped

FLOORS = ("scanwright.design", "scanwright.firmware_io")
CALLS = 3

_calls = Counter()


def begin():
    """Begin a test: nothing has been called yet."""
    _calls.clear()


def install():
    """Check all modules of the floors that are imported from now on."""
    sys.meta_path.insert(0, _Finder)


class _Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if not name.startswith(FLOORS):
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and type(spec.loader) is SourceFileLoader:
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


class _Loader(SourceFileLoader):
    def exec_module(self, module):
        super().exec_module(module)
        for name, value in list(vars(module).items()):
            if getattr(value, "__module__", None) != module.__name__:
                continue
            if isinstance(value, FunctionType):
                setattr(module, name, checked(value))
            elif isinstance(value, type):
                _check_class(value)


def _check_class(kind):
    for name, value in list(vars(kind).items()):
        if isinstance(value, property):
            setattr(kind, name, value.getter(checked(value.fget)))
        elif isinstance(value, FunctionType) and (name != "__init__" or is_dataclass(kind)):
            setattr(kind, name, checked(value))


def checked(function):
    """The function with its arrays checked; itself where it tells of none."""
    hints = {name: _evaluated(hint, function.__globals__) for name, hint in function.__annotations__.items()}
    arrays = {name: hint for name, hint in hints.items() if _has_array(hint)}
    if not arrays:
        return function
    function.__annotations__ = arrays
    strict = functools.cache(lambda: jaxtyped(function, typechecker=beartype))  # many are never called

    @functools.wraps(function)
    def call(*args, **kwargs):
        _calls[function] += 1
        return (strict() if _calls[function] <= CALLS else function)(*args, **kwargs)

    return call


def _evaluated(hint, names):
    try:
        return eval(hint, names) if isinstance(hint, str) else hint
    except NameError:  # imported for the type checker only
        return None


def _has_array(hint):
    return (isinstance(hint, type) and issubclass(hint, AbstractArray)) or any(map(_has_array, get_args(hint)))
