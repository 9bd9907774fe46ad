"""How cost grows: pairs of poses, characters shown, and what share of the machine that is.

    python benchmarks/scaling.py [library.kumite]

``kumite bench`` prints the figures themselves; this prints how they grow with N, and for the
distance stage the share of the arithmetic that the cores can do, measured in the same run.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from numba import get_num_threads, njit, prange

from kumite.graph import builtin_layer, load_library, pose_features
from kumite.kernels.distance import row_sums
from kumite.synthesis import Cast

FLOPS_PER_JOINT = 7 + 2 + 13 + 2  # dot product, |.| and 1 - ., polynomial, weighted sum
FLOPS_PER_FEATURE = 3


@njit(parallel=True, fastmath=True)
def _multiply_adds(rounds, out):
    """Independent multiply-adds on eight vectors a thread: what the cores can do at best."""
    for t in prange(out.shape[0]):
        x = np.full(64, np.float32(1.0))
        for _ in range(rounds):
            for i in range(64):
                x[i] = x[i] * np.float32(0.999) + np.float32(0.001)
        out[t] = x.sum()


def best(work, repeats: int = 3) -> float:
    work()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def main() -> None:
    library = (
        load_library(sys.argv[1]).layer("frames") if len(sys.argv) > 1 else builtin_layer(None)
    )
    threads = get_num_threads()
    out = np.empty(threads, np.float32)
    rounds = 2_000_000
    peak = 2 * 64 * rounds * threads / best(lambda: _multiply_adds(rounds, out))
    print(f"{threads} threads, multiply-adds at {peak / 1e9:.0f} GFLOP/s (float32)\n")

    features = pose_features(library.clips)
    joints, dims = features.quaternion.shape[0], features.euclidean.shape[0]
    work = FLOPS_PER_JOINT * joints + FLOPS_PER_FEATURE * dims
    print(f"distance stage ({joints} joints, {dims} features: {work} FLOP a pair)")
    for count in (1000, 2000, 4000, 8000, len(library.clips)):
        part = features.take(np.arange(min(count, len(library.clips))))
        sums = np.empty(part.quaternion.shape[2])
        args = part.quaternion, part.weight, part.euclidean, sums
        seconds = best(lambda a=args: row_sums(*a))
        rate = len(sums) ** 2 / seconds
        share = rate * work / peak
        print(f"  N {len(sums):6d}: {seconds:7.3f} s, {rate:.2e} pairs/s, {share:.0%} of peak")

    print("\ncharacters shown: offsets, kinematics, two legs of inverse kinematics")
    for count in (1, 2, 10, 30, 100, 1000):
        cast = Cast(library, count)
        rng = np.random.default_rng(0)
        cast.frame[:] = rng.integers(0, len(library.clips), count)
        seconds = best(lambda c=cast: c.show(1 / 60))
        print(f"  K {count:5d}: {seconds * 1e6:9.1f} µs, {seconds / count * 1e6:6.2f} µs each")


if __name__ == "__main__":
    main()
