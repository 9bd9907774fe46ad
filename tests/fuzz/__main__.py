"""Fuzz everything that is read. Prints a line a target, and every find with its seed."""

from __future__ import annotations

import argparse
import sys

from tests.fuzz.run import run
from tests.fuzz.targets import TARGETS


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", help=f"of {', '.join(TARGETS)}; all by default")
    parser.add_argument("--cases", type=int, default=1000, help="of each target")
    parser.add_argument("--seed", type=int, default=0, help="of the first case")
    parser.add_argument("--limit", type=float, default=5.0, help="seconds that a case may take")
    options = parser.parse_args()
    for name in options.targets:
        if name not in TARGETS:
            parser.error(f"{name!r}: expected one of {', '.join(TARGETS)}")
    finds = 0
    for name in options.targets or TARGETS:
        result = run(name, options.cases, options.seed, limit=options.limit)
        print(result, flush=True)
        for find in result.finds:
            print(find, flush=True)
        finds += len(result.finds)
    return 1 if finds else 0


if __name__ == "__main__":
    sys.exit(main())
