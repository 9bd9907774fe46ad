"""Plots: where blows land around a body (Lee & Lee 2004, figure 4), and how learning went."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from kumite import files
from kumite.annotate import Strikes
from kumite.clip import LIMBS
from kumite.control.preparation import Curve
from kumite.errors import KumiteError

COLOURS = ("#2f6fd0", "#d03b3b", "#3aa0a0", "#d08a2f")
VIEWS = (  # title, horizontal axis, vertical axis, labels; front is seen by the one being hit
    ("front", 0, 1, "left → x [m]", "height [m]"),
    ("top", 0, 2, "left → x [m]", "ahead z [m]"),
    ("side", 2, 1, "ahead z [m]", "height [m]"),
)


def plot_hits(path: Path | str, strikes: Strikes, title: str) -> None:
    """Draw the effective hitting points from front, top and side, in the body's facing frame.

    Errors: no hits; a file that cannot be written or whose ending matplotlib does not know.
    """
    if len(strikes) == 0:
        raise KumiteError("there are no effective hits to plot")
    pyplot = _pyplot()
    figure, axes = pyplot.subplots(1, 3, figsize=(13, 4.6), constrained_layout=True)
    for axis, (name, h, v, h_label, v_label) in zip(axes, VIEWS):
        for k, limb in enumerate(LIMBS):
            points = strikes.tip[strikes.effective[:, k], k]
            if len(points):
                blows = int(np.sum(strikes.limb == k))
                axis.scatter(
                    points[:, h],
                    points[:, v],
                    s=9,
                    alpha=0.6,
                    color=COLOURS[k],
                    label=f"{limb.replace('_', ' ')}: {blows} blows",
                )
        axis.plot([0], [0 if v == 2 else 1.0], marker="+", color="black", markersize=12)
        axis.set(title=name, xlabel=h_label, ylabel=v_label, aspect="equal")
        axis.grid(alpha=0.3)
        if h == 0:
            axis.invert_xaxis()  # the body's left is +X: seen from behind it is on the left
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(LIMBS), fontsize=9)
    figure.suptitle(
        f"{title}: {len(strikes)} blows, {len(strikes.points)} effective hitting points"
    )
    _save(path, figure, pyplot)


def plot_learning(path: Path | str, curves: Mapping[str, Curve], enough: float) -> None:
    """Draw learning curves by name: states whose best action each batch changed, with the share at
    which learning ends, and what an episode brought. Errors: a file that cannot be written or whose
    ending matplotlib does not know.
    """
    pyplot = _pyplot()
    figure, axes = pyplot.subplots(1, 2, figsize=(11, 4), constrained_layout=True)
    for name, curve in curves.items():
        batch = np.arange(1, len(curve) + 1)
        axes[0].plot(batch, 100 * curve.changed, label=name)
        axes[1].plot(batch, curve.mean_return, label=name)
    axes[0].axhline(100 * enough, color="black", linewidth=0.8)
    axes[0].set(xlabel="batch", ylabel="states changed [%]", yscale="log")
    axes[1].set(xlabel="batch", ylabel="return of an episode, mean")
    axes[1].legend()
    _save(path, figure, pyplot)


def _pyplot() -> Any:
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    return pyplot


def _save(path: Path | str, figure: Any, pyplot: Any) -> None:
    suffix = Path(path).suffix.lower().removeprefix(".") or "png"
    if suffix not in figure.canvas.get_supported_filetypes():
        pyplot.close(figure)
        raise KumiteError(f"{path}: cannot plot to .{suffix}; expected .png, .svg or .pdf")
    try:
        with files.writing(path) as temporary:
            figure.savefig(temporary, format=suffix, dpi=110)
    finally:
        pyplot.close(figure)
