"""How fast memory can be read and written: STREAM's triad (McCalpin 1995)."""

from __future__ import annotations

from numba import prange

from kumite.kernels.jit import parallel_kernel


@parallel_kernel
def triad(a, b, c, s):
    """a = b + s c, over arrays much larger than the caches; STREAM counts 3 words an element."""
    for i in prange(len(a)):
        a[i] = b[i] + s * c[i]
