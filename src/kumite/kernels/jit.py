"""The one way in which kernels are compiled."""

from __future__ import annotations

from numba import njit

# error_model="numpy": no exceptions inside loops. No fastmath: the same bytes on every run.
kernel = njit(cache=True, nogil=True, error_model="numpy")
parallel_kernel = njit(cache=True, nogil=True, error_model="numpy", parallel=True)
