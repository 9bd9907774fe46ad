"""Preparation behaviour learned by SARSA: how long it takes, how it goes, what it loses.

    python benchmarks/preparation.py [curve.png]

Run from the project's folder. The loss is against the exact solution of the same quantised process,
worked out by tests/preparation_twin.py. With a file name the learning curves are drawn.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.preparation_twin import Exact, four_cores

from kumite.control.preparation import PreparationSettings, gradual, train
from kumite.export.plot import plot_learning

SEEDS = range(3)
MOST_BATCHES = 100


def main(path: str | None = None) -> None:
    curves = {}
    paper = PreparationSettings()
    for name, settings in (
        ("as printed, rate settling", paper),
        ("as printed, rate constant", replace(paper, settling=inf)),
        ("gradual", gradual()),
    ):
        motions = four_cores(settings)
        exact = Exact(motions, settings)
        best = exact.solve()
        train(motions, settings, most_batches=1)  # compiled
        print(f"\n{name}: {best.size} states, {len(exact.actions)} actions")
        for seed in SEEDS:
            policy = train(motions, settings, seed=seed, most_batches=MOST_BATCHES)
            lost = (best - exact.value(policy.best)) / np.ptp(best)
            curve = policy.curve
            print(
                f"  seed {seed}: {len(curve)} batches, converged {policy.converged}, "
                f"{policy.seconds:.2f} s, {curve.steps.sum() / 1e6:.1f} M steps; regret mean "
                f"{lost.mean():.4f}, 99 % within {np.quantile(lost, 0.99):.3f}, "
                f"largest {lost.max():.3f} of {np.ptp(best):.3f}"
            )
        policy = train(motions, settings, most_batches=MOST_BATCHES)
        curve = curves[name] = policy.curve
        for b in sorted({0, 1, 2, 4, 9, 19, 49, len(curve) - 1}):
            if b < len(curve):
                print(
                    f"  | {b + 1} | {curve.changed[b]:.1%} | {curve.mean_return[b]:.3f} | "
                    f"{curve.motion_seconds[b]:.1f} |"
                )
    if path:
        plot_learning(path, curves, paper.changed)


if __name__ == "__main__":
    main(*sys.argv[1:2])
