"""Work that is done in another thread while its earlier results are used: unpacking, writing."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

S = TypeVar("S")
T = TypeVar("T")


def ahead(work: Callable[[S], T], items: Iterable[S], most: int = 1) -> Generator[T, None, None]:
    """Results of `work` on each item, in order; an error of the work is raised where its result would stand.

    The items are taken in the thread that asks, at most so many before their results are. Whoever stops asking stops
    the work: what has not begun never does.
    """
    waiting: deque[Future[T]] = deque()
    with ThreadPoolExecutor(1) as pool:
        try:
            for item in items:
                waiting.append(pool.submit(work, item))
                if len(waiting) > most:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
