"""Options of a command from the fields of a dataclass."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from typing import Annotated, Any

import typer

_UNITS = {"_m": "M", "_deg": "DEG", "_s": "S", "_rpy_deg": "R P Y"}


def record_options(record: type[Any], *own: str, **metavars: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Give a command an option for each field of a record; it gets the record as its argument `options`.

    Args:
        record: a dataclass whose docstring describes each field in one line.
        own: fields for which the command declares the options itself.
        metavars: placeholder of the value in the help; by default the unit at the end of the field's name.
    """
    described = dict(re.findall(r"^ +(\w+): (.*?)\.?$", record.__doc__ or "", re.MULTILINE))
    types = inspect.get_annotations(record)

    def option(name: str, default: Any) -> inspect.Parameter:
        kind = eval(types[name], vars(inspect.getmodule(record)))
        unit = max((end for end in _UNITS if name.endswith(end)), key=len, default="")
        flags = [f"--{name.replace('_', '-')}"] if kind is bool else []
        text = described[name][0].upper() + described[name][1:]
        info = typer.Option(*flags, metavar=metavars.get(name, _UNITS.get(unit)), help=text)
        return inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, info]
        )

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        signature = inspect.signature(function, eval_str=True)
        options = [option(each.name, each.default) for each in fields(record) if each.name not in own]

        @wraps(function)
        def run(*args: Any, **kwargs: Any) -> Any:
            chosen = {each.name: kwargs.pop(each.name) for each in options}
            return function(*args, options=record(**chosen), **kwargs)

        others = [each for name, each in signature.parameters.items() if name != "options"]
        vars(run)["__signature__"] = signature.replace(parameters=[*others, *options])
        return run

    return decorate
