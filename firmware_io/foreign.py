"""Readers of other people's formats, whose every failure becomes one clear line."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import ParamSpec, TypeVar

from scanwright.design.errors import RecordingError, made_by
from scanwright.design.files.text_files import first_line

P = ParamSpec("P")
T = TypeVar("T")


def foreign(what: str, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Return `call(...)`. The parsers of other people's bytes fail with a dozen exception types: all become one line.

    Raises:
        RecordingError: the call failed; `what` says for which file.
    """
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
    """Put the file's name before what a record says of its values, which knows of no file.

    Raises:
        RecordingError: as the body does.
    """
    try:
        yield
    except RecordingError as error:
        if str(error).startswith(str(path)):
            raise
        raise RecordingError(f"{path}: {error}") from error


def foreign_items(what: str, items: Iterable[T]) -> Iterator[T]:
    """Pass on what a foreign reader yields; only the reader's own failures become RecordingError, not the caller's."""
    iterator = foreign(what, iter, items)
    while item := foreign(what, _next, iterator):
        yield from item


def _next(iterator: Iterator[T]) -> tuple[T] | tuple[()]:
    """The next item in a tuple, or an empty one: StopIteration would be mistaken for a failure."""
    for item in iterator:
        return (item,)
    return ()
