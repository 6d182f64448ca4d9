"""Compiled sort of short lists. `np.sort` and `np.argsort` take longer to compile than the kernels that need it."""

from __future__ import annotations

from numba import njit

from scanwright.design.arrays import Array, Ints

CROWD = 32  # up to this number of values in disorder an insertion sort is as fast as any


@njit(cache=True, nogil=True, error_model="numpy")
def sort_indices(values: Array, order: Ints, n: int, crowd: int) -> None:
    """Sort the first n indices of `order` in place by their `values`; not stable.

    `crowd` is the largest number of values in disorder: n, or the largest bucket of a list sorted by buckets. If it is
    above `CROWD`, wide gaps come first (Shell's sort, gaps of Knuth).
    """
    gap = 1
    while crowd > CROWD and gap < n // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, n):
            k = order[i]
            j = i - gap
            while j >= 0 and values[order[j]] > values[k]:
                order[j + gap] = order[j]
                j -= gap
            order[j + gap] = k
        gap //= 3
