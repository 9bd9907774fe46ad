"""The command line: ``kumite --help``."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from kumite.errors import KumiteError, unknown

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Motion capture of one person at a time, turned into characters that spar.",
    epilog="Start with: kumite studio sparring (the built-in performer, no download).",
)
# Lines are never broken, so that what is piped on can be searched; nor are tables squeezed there.
_WIDTH = None if sys.stdout.isatty() or "COLUMNS" in os.environ else 200
out = Console(soft_wrap=True, width=_WIDTH)
err = Console(stderr=True, soft_wrap=True)

SHORTEST_ACTION = 0.25  # s; below it a graph is too fine to fight by

Source = Annotated[
    list[str], typer.Argument(help="Mocap: a folder, a glob, .bvh files, .amc files.")
]
LibraryOption = Annotated[
    Path | None,
    typer.Option(
        "--library", "-l", help="A library built with 'kumite build' (default: built-in)."
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for scripts.")]
ScaleOption = Annotated[
    float | None, typer.Option(help="Length of the files' unit [m] (else inferred).")
]
UpOption = Annotated[str | None, typer.Option(help="Up axis of the files, Y or Z (else inferred).")]
GroundOption = Annotated[
    float | None, typer.Option(help="Height of the floor in the files [m] (else inferred).")
]
RoleOption = Annotated[
    list[str] | None,
    typer.Option("--role", help="ROLE=JOINT, where names say too little; may be repeated."),
]
FpsOption = Annotated[float | None, typer.Option(help="Resample to this rate [frames/s].")]
FileFpsOption = Annotated[
    float | None, typer.Option(help="The files' own rate, where they do not state it.")
]


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        from kumite import __version__

        print(f"kumite {__version__}")
        raise typer.Exit


def main() -> None:
    """Run the command line; bad input ends with one line on stderr and status 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # a terminal without "→" gets "?"
            stream.reconfigure(errors="replace")
    try:
        app()
    except KumiteError as error:
        reason = str(error)
    except MemoryError:
        reason = "not enough memory; fewer files, a lower rate or a shorter time takes less"
    except OSError as error:  # of files, all are KumiteErrors: this is our own output (disk full)
        reason = f"cannot write to standard output ({error.strerror or error})"
    else:
        return
    err.print(f"error: {reason}", markup=False, highlight=False)
    sys.exit(2)


@contextmanager
def _progress() -> Iterator[Progress]:
    """Bars on stderr, gone when done; a line a stage where stderr is no terminal."""
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[note]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bars:
        yield bars


def _log(line: str) -> None:
    """A line instead of a bar, where stderr is a file."""
    if not err.is_terminal:
        err.print(line, markup=False, highlight=False)


class _Stages:
    """Named stages on one spinner."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._task = bars.add_task("starting", total=None, note="")

    def __call__(self, stage: str) -> None:
        self._bars.update(self._task, description=stage)
        _log(stage)


class _Training:
    """A bar a policy: how far the residual has come, in powers of ten."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._tasks: dict[str, Any] = {}

    def __call__(self, name: str, sweep: int, residual: float) -> None:
        from math import log10

        if name not in self._tasks:
            self._tasks[name] = self._bars.add_task(f"training: {name}", total=4.0, note="")
            _log(f"training: {name}")
        done = min(4.0, max(0.0, -log10(max(residual, 1e-4))))
        self._bars.update(
            self._tasks[name], completed=done, note=f"sweep {sweep}, residual {residual:.1e}"
        )


def _roles(pairs: list[str] | None) -> dict[str, str]:
    roles = {}
    for pair in pairs or []:
        role, equals, joint = pair.partition("=")
        if not equals:
            raise KumiteError(f"--role {pair!r}: expected ROLE=JOINT, such as left_hand=LWrist")
        roles[role] = joint
    return roles


def _print_json(value: Any) -> None:
    print(json.dumps(value, indent=2))


def _load_clips(source: list[str], fps, file_fps, metres_per_unit, up_axis, ground, role) -> Any:
    from kumite import mocap

    with _progress() as bars:
        _Stages(bars)("reading motion capture")
        return mocap.load(
            source,
            fps=fps,
            file_fps=file_fps,
            metres_per_unit=metres_per_unit,
            up_axis=up_axis,
            ground=ground,
            roles=_roles(role),
        )


@app.command()
def info(
    source: Source,
    plot: Annotated[
        Path | None, typer.Option(help="Draw where blows land, from front, top and side.")
    ] = None,
    as_json: JsonOption = False,
    fps: FpsOption = None,
    file_fps: FileFpsOption = None,
    metres_per_unit: ScaleOption = None,
    up_axis: UpOption = None,
    ground: GroundOption = None,
    role: RoleOption = None,
) -> None:
    """What is in motion capture files: rates, lengths, blows, and all that was inferred."""
    from kumite.annotate import Strikes, find_strikes
    from kumite.clip import LIMBS, check, concatenate

    loaded = _load_clips(source, fps, file_fps, metres_per_unit, up_axis, ground, role)
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
        _print_json(
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
            }
        )
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


@app.command()
def build(
    source: Source,
    output: Annotated[Path, typer.Option("--output", "-o", help="The library file to write.")],
    event: Annotated[
        str, typer.Option(help="Join where a foot lifts off: left, right, both; or none: anywhere.")
    ] = "left",
    per_second: Annotated[
        float, typer.Option(help="Wanted transitions per second of capture.")
    ] = 52.0,
    as_json: JsonOption = False,
    fps: FpsOption = None,
    file_fps: FileFpsOption = None,
    metres_per_unit: ScaleOption = None,
    up_axis: UpOption = None,
    ground: GroundOption = None,
    role: RoleOption = None,
) -> None:
    """Build a library: clips, contacts, effective hits and the motion graph, in one file."""
    from kumite.files import refuse_unwritable
    from kumite.graph import build_library, save_library

    refuse_unwritable(output)  # before the work, not after
    loaded = _load_clips(source, fps, file_fps, metres_per_unit, up_axis, ground, role)
    with _progress() as bars:
        library = build_library(
            loaded.clip_set(), event=event, per_second=per_second, progress=_Stages(bars)
        )
    save_library(output, library)
    r = library.report
    if as_json:
        _print_json({**r, "output": str(output), "clips": len(library.clips.names)})
        return
    for line in loaded.report():
        out.print(line, markup=False, highlight=False)
    lines = (
        f"{r['frames']} frames of {len(library.clips.names)} clips at {r['fps']:g} frames/s, "
        f"{r['hits']} blows",
        f"{r['frames_kept']} frames connected, {r['hits_kept']} blows in them: "
        f"{r['states']} states, {r['actions']} actions of {r['mean_action_s']:.2f} s on average",
        f"{r['transitions']} transitions of {r['candidates']} candidates "
        f"({'anywhere' if r['event'] == 'none' else r['event'] + ' lift-off'}), "
        f"mean join cost {r['mean_join_cost']:.2f}, accepted below {r['threshold']:.2f}",
        f"wrote {output} ({output.stat().st_size / 1e6:.1f} MB)",
    )
    for line in lines:
        out.print(line, markup=False, highlight=False)
    if r["mean_action_s"] < SHORTEST_ACTION:
        err.print(
            f"warning: actions last {r['mean_action_s']:.2f} s on average; fighters look one "
            "action ahead and will dither: join at a foot's lift-off (--event left, right or both)",
            markup=False,
            highlight=False,
        )


@app.command()
def scenes(as_json: JsonOption = False) -> None:
    """The built-in scenes."""
    from kumite.scene import builtin_scenes

    found = builtin_scenes()
    if as_json:
        _print_json({name: s.model_dump(mode="json") for name, s in found.items()})
        return
    for name, settings in found.items():
        out.print(f"{name:12} {settings.about}", markup=False, highlight=False)


def _live_scene(scene: str, library: Path | None, seed: int) -> Any:
    """A scene ready to run: library read or performed, policies trained or found."""
    from kumite.control import cache_folder
    from kumite.graph import builtin_library, load_library
    from kumite.scene import LiveScene, load_scene

    settings = load_scene(scene)  # before any long work: a wrong name is said at once
    cache = cache_folder(library)
    with _progress() as bars:
        stages = _Stages(bars)
        if library is not None:
            stages("reading the library")
            found = load_library(library)
        else:
            found = builtin_library(cache, progress=stages)
        stages("preparing the scene")
        return LiveScene(settings, found, seed=seed, cache=cache, progress=_Training(bars))


@app.command()
def run(
    scene: Annotated[str, typer.Argument(help="A built-in scene or a .toml scene file.")],
    library: LibraryOption = None,
    seconds: Annotated[float, typer.Option(help="How long [s].")] = 30.0,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same bytes.")] = 0,
    output: Annotated[
        list[Path] | None,
        typer.Option("--out", "-o", help="Write .rec, .glb, .bvh or .png; may be repeated."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Run a scene without drawing, record it, and print how good it is."""
    from kumite.scene import load_scene, measure, record

    _check_outputs(output or [], [c.name for c in load_scene(scene).character])
    live = _live_scene(scene, library, seed)
    with _progress() as bars:
        task = bars.add_task(f"running {scene}", total=1.0, note="")
        recording = record(live, seconds, lambda share: bars.update(task, completed=share))
    for path in output or []:
        _export(recording, path)
    _show_metrics(measure(recording), as_json)
    if not as_json:
        for path in output or []:
            out.print(f"wrote {path}", markup=False, highlight=False)


def _show_metrics(metrics: Any, as_json: bool) -> None:
    if as_json:
        _print_json(metrics.to_json())
        return
    table = Table(title=f"{metrics.seconds:.1f} s")
    columns = ("", "thrown", "landed", "skate m/s", "of source", "facing", "join jump m/s", "joins")
    for column in (*columns, "variety"):
        table.add_column(column, justify="right")
    for c in metrics.characters:
        ratio = "" if c.skate_ratio is None else f"{c.skate_ratio:.2f}"
        facing = "" if c.facing_share is None else f"{c.facing_share:.0%}"
        table.add_row(
            c.name,
            str(c.thrown),
            str(c.landed),
            f"{c.skate_m_s:.3f}",
            ratio,
            facing,
            f"{c.join_jump_m_s:.2f}",
            str(c.joins),
            f"{c.variety:.0%}",
        )
    out.print(table)
    if metrics.min_separation_m is not None:
        out.print(f"smallest distance between bodies: {metrics.min_separation_m:.2f} m")


@app.command()
def metrics(
    recording: Annotated[Path, typer.Argument(help="A .rec file.")], as_json: JsonOption = False
) -> None:
    """Score a recording: hits, foot skate, distances, facing, joins."""
    from kumite.scene import load_recording, measure

    _show_metrics(measure(load_recording(recording)), as_json)


EXPORTS = (".rec", ".glb", ".bvh", ".png")


def _exporter(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in EXPORTS:
        raise unknown(f"ending of {path}", suffix, EXPORTS)
    return suffix


def _check_outputs(paths: list[Path], names: Sequence[str]) -> None:
    """What cannot be written of these characters is said before the work, not after."""
    from kumite.files import refuse_unwritable

    for path in paths:
        if _exporter(path) == ".bvh" and len(names) > 1:
            raise KumiteError(
                f"{path}: a BVH file holds one character; choose with "
                f"'kumite export RECORDING -o {path} --character NAME' ({', '.join(names)})"
            )
        refuse_unwritable(path)


def _export(recording: Any, path: Path) -> None:
    suffix = _exporter(path)
    if suffix == ".rec":
        from kumite.scene import save_recording

        save_recording(path, recording)
    elif suffix == ".glb":
        from kumite.export.gltf import write_glb

        write_glb(path, recording)
    elif suffix == ".bvh":
        from kumite.export.bvh import write_bvh

        write_bvh(path, recording.clip(recording.names[0]))
    else:
        from kumite.export.sheet import recording_sheet

        recording_sheet(path, recording)


@app.command()
def export(
    recording: Annotated[Path, typer.Argument(help="A .rec file.")],
    output: Annotated[
        list[Path],
        typer.Option("--output", "-o", help="Write .glb, .bvh or .png; may be repeated."),
    ],
    character: Annotated[
        str | None, typer.Option(help="Which character (a BVH file holds one).")
    ] = None,
) -> None:
    """Write a recording as GLB (all characters), BVH (one of them) or a contact sheet."""
    from kumite.scene import load_recording

    loaded = load_recording(recording)
    if character is not None:
        loaded = loaded.only(character)
    _check_outputs(output, loaded.names)
    for path in output:
        _export(loaded, path)
        out.print(f"wrote {path}", markup=False, highlight=False)


@app.command()
def studio(
    scene: Annotated[
        str, typer.Argument(help="A built-in scene, a .toml scene file, or a .rec file.")
    ] = "sparring",
    library: LibraryOption = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the scene.")] = 0,
    host: Annotated[
        str, typer.Option(help="Address to listen on; others than 127.0.0.1 let others in.")
    ] = "127.0.0.1",
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port; 0 takes any free one.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="End by itself after this time.")] = None,
    browser: Annotated[bool, typer.Option(help="Open a browser where there is one.")] = True,
) -> None:
    """Watch a scene live in the browser, or play a recording."""
    from kumite.scene import Playback, load_recording
    from kumite.studio import serve

    if seconds is None and os.environ.get("DEMO_SECONDS"):
        try:
            seconds = float(os.environ["DEMO_SECONDS"])
        except ValueError:
            raise KumiteError(
                f"DEMO_SECONDS={os.environ['DEMO_SECONDS']!r}: expected a number of seconds"
            ) from None
    if scene.endswith(".rec"):
        stage: Any = Playback(load_recording(scene))
    else:
        stage = _live_scene(scene, library, seed)
    serve(
        stage,
        host=host,
        port=8080 if port is None else port,
        strict_port=port is not None,
        open_browser=browser,
        seconds=seconds,
        announce=lambda line: out.print(line, markup=False, highlight=False),
    )


@app.command()
def bench(
    folder: Annotated[
        Path | None, typer.Argument(help="Boxer mocap (default: KUMITE_MOCAP, else built-in).")
    ] = None,
    only: Annotated[str | None, typer.Option(help="Only benchmarks whose name holds this.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Measure the figures: times, rates, peak memory."""
    from kumite.bench import run_all

    with _progress() as bars:
        rows = run_all(folder, only, _Stages(bars))
    if as_json:
        _print_json(rows)
        return
    table = Table()
    for column in ("figure", "value", "unit", "wanted", "peak MB"):
        table.add_column(column, justify="left" if column in ("figure", "unit") else "right")
    for row in rows:
        limit = "" if row["limit"] is None else f"{row['limit']:g}"
        table.add_row(
            row["name"], f"{row['value']:.4g}", row["unit"], limit, f"{row['peak_mb']:.0f}"
        )
    out.print(table)
