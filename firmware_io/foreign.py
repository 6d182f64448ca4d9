"""Conversion of all exceptions of third-party readers to RecordingError with one line."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import ParamSpec, TypeVar

from scanwright.design.errors import RecordingError, made_by
from scanwright.design.files.text_files import first_line

P = ParamSpec("P")
T = TypeVar("T")


def foreign(what: str, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Return `call(...)`; all its exceptions become RecordingError with `what`, such as the file, before the reason."""
    try:
        return call(*args, **kwargs)
    except RecordingError:
        raise
    except OSError as error:
        hint = made_by(Path(error.filename)) if isinstance(error, FileNotFoundError) and error.filename else ""
        raise RecordingError(f"{what}: {error.strerror or first_line(error)}{hint}") from error
    except Exception as error:
        raise RecordingError(f"{what}: {first_line(error)}") from error


@contextmanager
def of_file(path: Path) -> Iterator[None]:
    """Prefix RecordingErrors of the body with the name of the file."""
    try:
        yield
    except RecordingError as error:
        if str(error).startswith(str(path)):
            raise
        raise RecordingError(f"{path}: {error}") from error


def foreign_items(what: str, items: Iterable[T]) -> Iterator[T]:
    """Yield the items of a third-party reader; only its exceptions become RecordingError, not the caller's."""
    iterator = foreign(what, iter, items)
    # in a list, as StopIteration would be a failure
    while item := foreign(what, list[T], islice(iterator, 1)):
        yield from item
