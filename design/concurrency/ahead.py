"""Work that is done in another thread while its earlier results are used: unpacking, writing."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

S = TypeVar("S")
T = TypeVar("T")


def ahead(work: Callable[[S], T], items: Iterable[S]) -> Generator[T, None, None]:
    """Results of `work` on each item, in order; an error of the work is raised where its result would stand.

    The items are taken in the thread that asks, each before the result of the one in front of it is. Whoever stops
    asking stops the work: what has not begun never does.
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
