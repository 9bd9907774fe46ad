"""The one way in which kernels are compiled."""

from __future__ import annotations

from numba import njit

# error_model="numpy": no exceptions inside loops. Of fast-math only contraction (fused
# multiply-add): nothing is reordered, so a run gives the same bytes as the last, whatever the
# number of threads.
kernel = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
parallel_kernel = njit(
    cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, parallel=True
)
