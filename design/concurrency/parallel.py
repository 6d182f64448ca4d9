"""Work on all cores: compiled kernels release the interpreter lock, so threads are enough."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import TypeVar

T = TypeVar("T")
_thread = threading.local()


def in_chunks(work: Callable[[slice], T], count: int, smallest: int = 64) -> list[T]:
    """Results of `work` on consecutive slices that cover `range(count)`, in order; at least one slice.

    The result does not depend on the number of cores if `work` treats each element alone. Work that calls this again
    runs that in its own thread: waiting for the pool inside the pool would never end.
    """
    if getattr(_thread, "is_worker", False):
        return [work(slice(0, count))]
    cores = os.cpu_count() or 1
    pieces = max(1, min(4 * cores, count // smallest))
    bounds = [count * i // pieces for i in range(pieces + 1)]
    slices = [slice(a, b) for a, b in pairwise(bounds)]
    if pieces == 1:
        return [work(slices[0])]
    return list(_pool(cores).map(work, slices))


@cache
def _pool(cores: int) -> ThreadPoolExecutor:
    """One pool for the life of the process: starting threads costs more than many of the pieces."""
    return ThreadPoolExecutor(cores, initializer=lambda: setattr(_thread, "is_worker", True))
