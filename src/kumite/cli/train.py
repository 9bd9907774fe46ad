"""The command that learns ahead of time how to approach and prepare."""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import Annotated

import typer

from kumite.cli import INTERRUPTED
from kumite.cli.app import JsonOption, app, err, out, print_json
from kumite.cli.library import refuse_no_library
from kumite.cli.progress import Stages, progress


@app.command()
def train(
    library: Annotated[
        Path | None,
        typer.Argument(
            help="A library built with 'kumite build --layer preparation' (default: built-in)."
        ),
    ] = None,
    steer: Annotated[
        list[float] | None,
        typer.Option(
            help="An extra turn over a cycle of locomotion, to the left [degrees]; may be repeated "
            "(default 0, 23 and 46, either way)."
        ),
    ] = None,
    gait: Annotated[
        list[str] | None,
        typer.Option(help="A core to go with; may be repeated (default: walks of any kind)."),
    ] = None,
    legs: Annotated[
        float, typer.Option(min=0.01, help="C of root and legs, by which steps get shorter.")
    ] = 1.0,
    printed: Annotated[
        bool, typer.Option(help="The paper's numbers, by which nobody prepares, not ours.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same bytes.")] = 0,
    most_batches: Annotated[
        int, typer.Option(min=1, help="Batches of episodes after which learning stops.")
    ] = 1000,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the learning curve: .png, .svg or .pdf.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Learn how to approach a goal and prepare on the way. Ctrl-C keeps what is learned."""
    from kumite.files import refuse_unwritable

    if plot is not None:
        refuse_unwritable(plot)  # before the work, not after
    if library is not None:
        refuse_no_library(library)
    from kumite.control import PreparationSettings, cache_folder, gradual
    from kumite.control.approaching import STEER, trained_approach
    from kumite.graph import builtin_layer, load_library

    settings = PreparationSettings() if printed else gradual()
    folder = cache_folder(library)
    turns = STEER if steer is None else tuple(map(radians, steer))
    done = 0
    with progress() as bars:
        stages = Stages(bars)
        if library is None:
            found = builtin_layer(folder, stages, style="targets", level="preparation")
        else:
            stages("reading the library")
            found = load_library(library).layer("preparation")
        stages("learning")

        def told(batch: int, changed: float) -> None:
            nonlocal done
            done = batch
            stages(f"learning: batch {batch}, {changed:.1%} of the states changed")

        try:
            approach, policy = trained_approach(
                found,
                folder,
                settings,
                steer=turns,
                gaits=gait,
                curve=legs,
                seed=seed,
                most_batches=most_batches,
                progress=told,
            )
        except KeyboardInterrupt:
            err.print(
                f"interrupted after batch {done}: what is learned lies in {folder}; "
                "the same command goes on from there",
                markup=False,
                highlight=False,
            )
            raise typer.Exit(INTERRUPTED) from None
    curve, motions = policy.curve, approach.motions
    if plot is not None:
        from kumite.export.plot import plot_learning

        plot_learning(plot, {found.report.get("level", "learning"): curve}, settings.changed)
    if as_json:
        print_json(
            {
                "motions": list(motions.names),
                "steer": [round(s, 6) for s in approach.steer.tolist()],
                "states": int(policy.best.size),
                "batches": len(curve),
                "converged": policy.converged,
                "seconds": round(policy.seconds, 3),
                "folder": str(folder),
                "curve": {
                    "changed": curve.changed.tolist(),
                    "mean_return": curve.mean_return.tolist(),
                    "motion_seconds": curve.motion_seconds.tolist(),
                    "given_up": curve.given_up.tolist(),
                },
            }
        )
        return
    ended = "settled" if policy.converged else "stopped unsettled"
    lines = [
        f"{len(motions.names)} motions: {', '.join(motions.names)}",
        f"{ended} after {len(curve)} batches, {curve.steps.sum() / 1e6:.1f} million actions, "
        f"{policy.seconds:.1f} s: {policy.best.size} states",
        "batch  changed  return  seconds of motion  given up",
        *(
            f"{b + 1:5}  {curve.changed[b]:7.1%}  {curve.mean_return[b]:6.3f}  "
            f"{curve.motion_seconds[b]:17.1f}  {int(curve.given_up[b]):8}"
            for b in _some(len(curve))
        ),
        f"kept in {folder}",
        *([f"wrote {plot}"] if plot is not None else []),
    ]
    for line in lines:
        out.print(line, markup=False, highlight=False)
    if not policy.converged:
        err.print("warning: more batches settle it (--most-batches)", highlight=False)


def _some(batches: int) -> list[int]:
    """Rows of a curve to be shown: the first few, each about twice as far as the last, the end."""
    rows = {batches - 1} | {2**k - 1 for k in range(batches.bit_length())}
    return sorted(row for row in rows if 0 <= row < batches)
