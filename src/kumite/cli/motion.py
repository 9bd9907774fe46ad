"""Commands for motion: files, the performer, how like people they move, libraries."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from kumite.cli.app import JsonOption, app, err, out, print_json
from kumite.cli.library import (
    is_library,
    library_lines,
    library_values,
    refuse_no_library,
    show_library,
    worth_table,
)
from kumite.cli.progress import Bars, Stages, progress
from kumite.cli.reading import FpsOption, Reading, SkipBad, Source, reads_mocap
from kumite.cli.recording import is_recording, show_recording
from kumite.errors import KumiteError, unknown

if TYPE_CHECKING:
    from kumite.mocap import Loaded

SOME_BAD = 3  # exit status of info where some files cannot be read
SHORTEST_ACTION = 0.25  # s; below it a graph is too fine to fight by

SourceOrLibrary = Annotated[
    list[str],
    typer.Argument(
        help="Mocap: a folder, a glob, .bvh files, .amc files; or one library or recording."
    ),
]


@app.command()
@reads_mocap
def info(
    source: SourceOrLibrary,
    plot: Annotated[
        Path | None, typer.Option(help="Draw where blows land, from front, top and side.")
    ] = None,
    as_json: JsonOption = False,
    fps: FpsOption = None,
    *,
    reading: Reading,
) -> None:
    """What is in motion capture files (with all that was inferred), a library or a recording.

    Ends with status 3 if some of the files cannot be read, 2 if none can.
    """
    given = [*([] if fps is None else ["--fps"]), *reading.given()]
    if len(source) == 1 and is_library(source[0]):
        show_library(source[0], plot, as_json, given)
        return
    if len(source) == 1 and is_recording(source[0]):
        show_recording(source[0], as_json, [*([] if plot is None else ["--plot"]), *given])
        return
    reading.refuse(source, fps)
    from kumite.annotate import Strikes, find_strikes
    from kumite.clip import LIMBS, check, concatenate

    loaded = reading.load(source, fps, skip_bad=True)
    hits: dict[str, dict[str, int]] = {}
    every: list[Strikes] = []
    for group in loaded.by_skeleton():
        clips = concatenate(group)
        strikes = find_strikes(clips)
        every.append(strikes)
        owner = clips.clip_of_frame[strikes.frame]
        for c, name in enumerate(clips.names):
            hits[name] = {
                limb: int(((owner == c) & (strikes.limb == k)).sum())
                for k, limb in enumerate(LIMBS)
            }
    scales = sorted({i.metres_per_unit for i in loaded.info})
    problems = [p for clip in loaded.clips for p in check(clip)]
    if plot is not None:
        from kumite.export.plot import plot_hits

        if len(every) != 1:
            raise KumiteError(
                f"--plot: the clips are of {len(every)} skeletons; expected one (name fewer files)"
            )
        plot_hits(plot, every[0], " ".join(source))
    if as_json:
        print_json(
            {
                "clips": [
                    {
                        "name": clip.name,
                        "fps": clip.fps,
                        "frames": len(clip),
                        "seconds": round(clip.seconds, 4),
                        "hits": hits[clip.name],
                        "source": str(i.source),
                        "metres_per_unit": i.metres_per_unit,
                        "facts": [str(f) for f in i.facts],
                    }
                    for clip, i in zip(loaded.clips, loaded.info)
                ],
                "metres_per_unit": scales[0] if len(scales) == 1 else scales,
                "roles": dict(loaded.info[0].roles),
                "problems": problems,
                "doubts": loaded.doubts(),
                "bad": [{"source": str(b.source), "reason": b.reason} for b in loaded.bad],
            }
        )
        _end_with_bad(loaded)
        return
    table = Table(title=f"{len(loaded.clips)} clips, {sum(c.seconds for c in loaded.clips):.1f} s")
    for column in ("clip", "fps", "frames", "seconds", *(n.replace("_", " ") for n in LIMBS)):
        is_name = column == "clip"  # kept whole: cut short, two could look the same
        table.add_column(column, justify="left" if is_name else "right", no_wrap=is_name)
    for clip in loaded.clips:
        row = (f"{clip.fps:g}", str(len(clip)), f"{clip.seconds:.2f}")
        table.add_row(clip.name, *row, *(str(hits[clip.name][limb] or "·") for limb in LIMBS))
    out.print(table)
    for line in loaded.report():
        out.print(line, markup=False, highlight=False)
    for line in problems:
        err.print(f"warning: {line}", markup=False, highlight=False)
    if plot is not None:
        out.print(f"wrote {plot}", markup=False, highlight=False)
    _end_with_bad(loaded)


def _end_with_bad(loaded: Loaded) -> None:
    """End with a status of its own if some of the files could not be read."""
    if loaded.bad:
        raise typer.Exit(SOME_BAD)


@app.command()
@reads_mocap
def build(
    source: Source,
    output: Annotated[Path, typer.Option("--output", "-o", help="The library file to write.")],
    layer: Annotated[
        list[str] | None,
        typer.Option(
            "--layer",
            "--level",
            help="Only that motion graph: frames (policies), actions (fights by game tree), "
            "avoidance, or preparation (walks and what they lead to); may be repeated. Default: "
            "all that the clips allow.",
        ),
    ] = None,
    event: Annotated[
        str | None,
        typer.Option(
            help="Frames: join where a foot lifts off: left (the default), right, both; "
            "or none: anywhere."
        ),
    ] = None,
    per_second: Annotated[
        float | None,
        typer.Option(help="Frames: wanted transitions per second of capture (default 52)."),
    ] = None,
    actions: Annotated[
        Path | None,
        typer.Option(
            help="The text file of 'kumite segment', for its actions, its avoidance parts, and the "
            "target motions and cycles that you marked; default: as found."
        ),
    ] = None,
    avoidance: Annotated[
        bool,
        typer.Option(help="Frames and actions: keep avoidance parts whole, each within one edge."),
    ] = False,
    alike: Annotated[
        float | None,
        typer.Option(
            help="Actions: postures nearer than that are one node [rad] (default 1.2); "
            "preparation: a target is entered from cores nearer than that (default 1.8)."
        ),
    ] = None,
    most_ways: Annotated[
        int | None,
        typer.Option(help="Actions: as many are offered after one at most (default 64)."),
    ] = None,
    every: Annotated[
        float | None,
        typer.Option(help="Avoidance: an avoidance may be begun so often [s] (default 0.2)."),
    ] = None,
    offered: Annotated[
        int | None,
        typer.Option(help="Avoidance: as many of them are offered then at most (default 16)."),
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(
            help="Preparation: how far the legs of a reference posture may be from those that a "
            "target starts with [rad², all joints together] (default 4)."
        ),
    ] = None,
    most: Annotated[
        int | None,
        typer.Option(help="Preparation: as many found targets of one name at most (default 4)."),
    ] = None,
    join_height: Annotated[
        float | None,
        typer.Option(help="The most that a join may raise or lower the pelvis [m] (default 0.15)."),
    ] = None,
    join_angle: Annotated[
        float | None,
        typer.Option(help="The most that a join may turn any joint [rad] (default 1.5)."),
    ] = None,
    join_speed: Annotated[
        float | None,
        typer.Option(
            help="The most that a join may change the pelvis' velocity [m/s] (default 3)."
        ),
    ] = None,
    as_json: JsonOption = False,
    fps: FpsOption = None,
    skip_bad: SkipBad = False,
    *,
    reading: Reading,
) -> None:
    """Build a library: clips, contacts, effective hits and the motion graphs, in one file."""
    from kumite.files import refuse_unwritable

    if most is not None and actions is not None:
        raise KumiteError("--most: of targets that are found; expected none with --actions")
    from kumite.layers import LAYERS

    wanted = tuple(layer) if layer else LAYERS
    for name in wanted:
        if name not in LAYERS:
            raise unknown("layer", name, LAYERS)
    options = _options_of_layers(
        wanted,
        {
            "--event": (event, "event", ("frames",)),
            "--per-second": (per_second, "per_second", ("frames",)),
            "--alike": (alike, "alike", ("actions", "preparation")),
            "--most-ways": (most_ways, "most_ways", ("actions",)),
            "--every": (every, "every", ("avoidance",)),
            "--offered": (offered, "offered", ("avoidance",)),
            "--threshold": (threshold, "threshold", ("preparation",)),
            "--most": (most, "most", ("preparation",)),
            "--avoidance": (avoidance or None, "avoidance", ("frames", "actions")),
        },
    )
    if actions is not None and wanted == ("frames",) and not avoidance:
        raise KumiteError(
            "--actions: of other layers; expected none with --layer frames without --avoidance"
        )
    refuse_unwritable(output)  # before the work, not after
    reading.refuse(source, fps)
    from kumite.graph import JoinBound, build_library, save_library

    bound = JoinBound(**_given(height=join_height, angle=join_angle, speed=join_speed))
    loaded = reading.load(source, fps, skip_bad=skip_bad)
    with progress() as bars:
        stages, clips = Stages(bars), loaded.clip_set()
        if actions is not None:
            _take_from_file(actions, clips, wanted, options)
        library = build_library(
            clips,
            layers=wanted if layer else None,
            bound=bound,
            progress=stages,
            **options,
        )
    save_library(output, library)
    if as_json:
        print_json({**library_values(library), "output": str(output)})
        return
    for line in loaded.report():
        out.print(line, markup=False, highlight=False)
    wrote = f"wrote {output} ({output.stat().st_size / 1e6:.1f} MB)"
    for line in (*library_lines(library), wrote):
        out.print(line, markup=False, highlight=False)
    out.print(worth_table(library))
    frames = library.layers.get("frames")
    mean = SHORTEST_ACTION if frames is None else frames.report["mean_action_s"]
    if mean < SHORTEST_ACTION:
        err.print(
            f"warning: actions of the layer frames last {mean:.2f} s on average; fighters look one "
            "action ahead and will dither: join at a foot's lift-off (--event left, right or both)",
            markup=False,
            highlight=False,
        )


def _take_from_file(
    path: Path, clips: Any, wanted: tuple[str, ...], options: dict[str, dict[str, Any]]
) -> None:
    """Options of layers that a file of actions gives. Errors: what it says; nothing in it is for
    the one layer that is wanted."""
    from kumite.annotate import find_contacts, read_actions, read_avoidance, read_marked
    from kumite.graph import marked_targets

    if "actions" in wanted:
        options.setdefault("actions", {})["actions"] = read_actions(path, clips)
    parts = read_avoidance(path, clips)
    for name in ("frames", "actions"):
        if "avoidance" in options.get(name, {}):
            options[name]["avoidance"] = parts
    if "avoidance" in wanted and (len(parts) or len(wanted) == 1):
        options.setdefault("avoidance", {})["avoidance"] = parts
    if "preparation" in wanted:
        try:
            marked = read_marked(path, clips)
        except KumiteError:
            if len(wanted) == 1:
                raise
            return  # no line marks one: they are found
        targets, cycles = marked_targets(clips, find_contacts(clips), marked)
        options.setdefault("preparation", {}).update(targets=targets, cycles=cycles, keep_all=True)


def _options_of_layers(
    wanted: tuple[str, ...], given: dict[str, tuple[Any, str, tuple[str, ...]]]
) -> dict[str, dict[str, Any]]:
    """Options by the layer whose builder takes them.

    given: by name on the command line, the value, its name to the builder, and the layers it is of.
    Errors: an option that says nothing about any layer that is wanted.
    """
    options: dict[str, dict[str, Any]] = {}
    for option, (value, name, layers) in given.items():
        if value is None:
            continue
        of = [layer for layer in layers if layer in wanted]
        if not of:
            raise KumiteError(
                f"{option}: of --layer {' or '.join(layers)}; expected none with "
                f"--layer {', '.join(wanted)}"
            )
        for layer in of:
            options.setdefault(layer, {})[name] = value
    return options


def _given(**options: Any) -> dict[str, Any]:
    """The options that were given: of the others the library knows the default."""
    return {name: value for name, value in options.items() if value is not None}


@app.command()
def perform(
    style: Annotated[
        str | None, typer.Argument(help="A style of the built-in performer (default: list them).")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="A folder for a BVH and a truth file of every clip."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same bytes.")] = 0,
    mirrored: Annotated[bool, typer.Option(help="Every clip once more, seen in a mirror.")] = True,
    as_json: JsonOption = False,
) -> None:
    """The built-in performer's clips: list them, or write them as BVH with what is true of them."""
    from kumite.performer import STYLES
    from kumite.performer import perform as perform_style

    if style is None:
        if output is not None:
            raise KumiteError(f"--output: name a style to write ({', '.join(STYLES)})")
        styles = {
            name: {"takes": list(s.takes), "moves": [m.label for m in s.moves]}
            for name, s in STYLES.items()
        }
        if as_json:
            print_json(styles)
            return
        for name, what in styles.items():
            line = f"{name:12} {len(what['takes'])} takes of {len(what['moves'])} moves"
            out.print(line, markup=False, highlight=False)
        return
    with progress() as bars:
        stage = Stages(bars)
        stage(f"performing {style}")
        made = perform_style(style, seed, mirrored=mirrored)
        if output is not None:
            _write_performance(output, made, bars)
    rows = [
        {
            "clip": clip.name,
            "seconds": round(clip.seconds, 2),
            "actions": len(truth.actions),
            "blows": len(truth.strikes),
        }
        for clip, truth in zip(made.clips, made.truth)
    ]
    if as_json:
        print_json(rows)
        return
    total = sum(clip.seconds for clip in made.clips)
    table = Table(
        title=f"{style}: {len(rows)} clips, {total:.1f} s at {made.clips[0].fps:g} frames/s"
    )
    for column in rows[0]:
        table.add_column(column, justify="left" if column == "clip" else "right", no_wrap=True)
    for row in rows:
        table.add_row(*map(str, row.values()))
    out.print(table)
    if output is not None:
        out.print(f"wrote {len(rows)} clips to {output}", markup=False, highlight=False)


def _write_performance(folder: Path, made: Any, bars: Bars) -> None:
    import json

    from kumite.export.bvh import write_bvh
    from kumite.files import writing
    from kumite.performer import truth_to_json

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise KumiteError(f"{folder}: cannot be made ({error.strerror})") from None
    bar = bars.add("writing clips", total=len(made.clips))
    for n, (clip, truth) in enumerate(zip(made.clips, made.truth)):
        bars.update(bar, n, note=clip.name)
        write_bvh(folder / f"{clip.name}.bvh", clip)
        with writing(folder / f"{clip.name}.truth.json") as temporary:
            text = json.dumps(truth_to_json(truth), indent=1)
            temporary.write_text(text + "\n", encoding="utf-8", newline="\n")


@app.command()
@reads_mocap
def likeness(
    source: Annotated[
        list[str] | None, typer.Argument(help="Mocap: a folder, a glob, .bvh files, .amc files.")
    ] = None,
    style: Annotated[
        list[str] | None,
        typer.Option(help="A style of the built-in performer; may be repeated."),
    ] = None,
    as_json: JsonOption = False,
    skip_bad: SkipBad = False,
    *,
    reading: Reading,
) -> None:
    """How like a person clips move: joints, foot skate, balance, blows and steps, side by side."""
    if not source and not style:
        raise KumiteError("name motion capture files, or a --style of the built-in performer")
    if source:
        reading.refuse(source)
    from kumite.annotate import measure_likeness
    from kumite.clip import concatenate
    from kumite.performer import perform as perform_style

    found = {}
    if source:
        loaded = reading.load(source, skip_bad=skip_bad)
        for k, group in enumerate(loaded.by_skeleton()):
            name = " ".join(source) if k == 0 else f"{' '.join(source)} ({k + 1})"
            found[name] = measure_likeness(concatenate(group))
    for name in style or []:
        found[name] = measure_likeness(concatenate(perform_style(name, mirrored=False).clips))
    if as_json:
        print_json({name: m.to_json() for name, m in found.items()})
        return
    table = Table(title="5th, 50th and 95th percentiles, where three numbers are given")
    table.add_column("", no_wrap=True)
    for name in found:
        table.add_column(name, justify="right")
    columns = [m.rows() for m in found.values()]
    for k, (label, _) in enumerate(columns[0]):
        table.add_row(label, *(rows[k][1] for rows in columns))
    out.print(table)
    for name, m in found.items():
        for line in m.outside():
            err.print(f"warning: {name}: {line}", markup=False, highlight=False)


@app.command()
def spheres(
    library: Annotated[Path, typer.Argument(help="A library built with 'kumite build'.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The TOML file to write.")],
) -> None:
    """Write the spheres that stand for the body when it avoids: to edit, for [dodge] spheres."""
    from kumite.files import refuse_unwritable

    refuse_unwritable(output)
    refuse_no_library(library)
    from kumite.body import lay_spheres, save_spheres
    from kumite.graph import load_library

    skeleton = load_library(library).clips.skeleton
    laid = lay_spheres(skeleton)
    save_spheres(output, laid, skeleton)
    out.print(f"{len(laid)} spheres", markup=False, highlight=False)
    out.print(f"wrote {output}", markup=False, highlight=False)
