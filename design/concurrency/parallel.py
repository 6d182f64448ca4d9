"""Work on all cores: compiled kernels release the interpreter lock, so threads are enough."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import TypeVar

from scanwright.design.concurrency.processes import cores

T = TypeVar("T")
_thread = threading.local()


def in_chunks(work: Callable[[slice], T], count: int, smallest: int = 64) -> list[T]:
    """Return the results of `work` on consecutive slices that cover `range(count)`, in order; at least one slice.

    The result does not depend on the number of cores if `work` treats each element separately. Nested calls run in
    their own thread, since waiting for the pool inside the pool would never end.
    """
    if getattr(_thread, "is_worker", False):
        return [work(slice(0, count))]
    width = cores()
    pieces = max(1, min(4 * width, count // smallest))
    bounds = [count * i // pieces for i in range(pieces + 1)]
    slices = [slice(a, b) for a, b in pairwise(bounds)]
    if pieces == 1:
        return [work(slices[0])]
    return list(_pool(width).map(work, slices))


@cache
def _pool(width: int) -> ThreadPoolExecutor:
    """Return one pool for the lifetime of the process, since starting threads costs more than many of the pieces."""
    return ThreadPoolExecutor(width, initializer=lambda: setattr(_thread, "is_worker", True))
