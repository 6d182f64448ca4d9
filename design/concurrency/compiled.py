"""numba's `njit`, which every kernel takes from here: without the linear algebra of scipy that none of them uses.

Before its first kernel numba loads `scipy.linalg` to see whether it has a BLAS: a quarter of a second of a command that
needs nothing else of scipy. Told that there is none, it lacks one in `np.convolve` and `np.correlate` only, where it
falls back to a loop; what multiplies matrices looks again when it is compiled.
"""

from __future__ import annotations

from contextlib import suppress
from unittest.mock import patch

from numba import njit

__all__ = ["njit"]

with suppress(ImportError):  # a numba that keeps these elsewhere takes its quarter of a second
    import numba.np.linalg

    with patch.object(numba.np.linalg, "ensure_blas", side_effect=ImportError, create=True):
        import numba.np.arraymath  # asks for it
