"""Files that are whole or not there, and foreign readers whose every failure is one clear line."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import ParamSpec, TypeVar

from design import atomic_file
from design.errors import RecordingError

P = ParamSpec("P")
T = TypeVar("T")


def whole_file(path: Path) -> AbstractContextManager[Path]:
    """A temporary name beside `path` that becomes `path` when the block ends well.

    Raises:
        RecordingError: the file cannot be written there.
    """
    return atomic_file.whole_file(path, RecordingError)


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
        raise RecordingError(f"{what}: {error.strerror or _first_line(error)}") from error
    except Exception as error:
        raise RecordingError(f"{what}: {_first_line(error)}") from error


def foreign_items(what: str, items: Iterable[T]) -> Iterator[T]:
    """Pass on what a foreign reader yields; only the reader's own failures become RecordingError, not the caller's."""
    iterator = foreign(what, iter, items)
    while found := foreign(what, _next, iterator):
        yield from found


def _next(iterator: Iterator[T]) -> tuple[T] | tuple[()]:
    """The next item in a tuple, or an empty one: StopIteration would be mistaken for a failure."""
    for item in iterator:
        return (item,)
    return ()


def _first_line(error: Exception) -> str:
    text = str(error).strip() or type(error).__name__
    return text.splitlines()[0]
