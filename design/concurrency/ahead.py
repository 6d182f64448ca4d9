"""Work in another thread while its earlier results are used, such as unpacking and writing."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

S = TypeVar("S")
T = TypeVar("T")


def ahead(work: Callable[[S], T], items: Iterable[S]) -> Generator[T, None, None]:
    """Yield the results of `work` on each item in order; an error is raised in place of its result.

    Items are taken in the calling thread, each before the result of the previous one. Closing the generator cancels
    work that has not started.
    """
    waiting: Future[T] | None = None
    with ThreadPoolExecutor(1) as pool:
        try:
            for item in items:
                before, waiting = waiting, pool.submit(work, item)
                if before is not None:
                    yield before.result()
            if waiting is not None:
                yield waiting.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
