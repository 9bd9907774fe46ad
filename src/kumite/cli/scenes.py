"""Commands for scenes: run them, score and export recordings, watch them, measure."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from kumite.cli.app import JsonOption, Stages, Training, app, out, print_json, progress
from kumite.cli.library import is_library
from kumite.errors import KumiteError, unknown
from kumite.scene import catalogue

LibraryOption = Annotated[
    Path | None,
    typer.Option(
        "--library", "-l", help="A library built with 'kumite build' (default: built-in)."
    ),
]


@app.command()
def scenes(as_json: JsonOption = False) -> None:
    """The built-in scenes."""
    if as_json:
        from kumite.scene import builtin_scenes

        print_json({name: s.model_dump(mode="json") for name, s in builtin_scenes().items()})
        return
    for name in catalogue.names():
        out.print(f"{name:12} {catalogue.about(name)}", markup=False, highlight=False)


CountOption = Annotated[
    int | None, typer.Option(help="How many characters a scene with a crowd has.")
]


ThrowsOption = Annotated[
    int | None, typer.Option(help="How many balls are thrown in a scene with dodgers.")
]


def _settings(scene: str, count: int | None, throws: int | None) -> Any:
    """The scene as it is to be run."""
    catalogue.find(scene)  # an unknown name is said before anything heavy is imported
    from kumite.scene import load_scene, with_count, with_throws

    settings = load_scene(scene)
    settings = settings if count is None else with_count(settings, count)
    return settings if throws is None else with_throws(settings, throws)


def _live_scene(settings: Any, library: Path | None, seed: int) -> Any:
    """A scene ready to run: library read or performed, policies trained or found."""
    from kumite.control import cache_folder
    from kumite.graph import builtin_library, load_library
    from kumite.scene import BoutScene, DodgeScene, EvasionScene, LiveScene, PrepareScene
    from kumite.scene.dodge import DodgeSettings
    from kumite.scene.errands import PrepareSettings
    from kumite.scene.fighters import BoutSettings

    cache = cache_folder(library)
    with progress() as bars:
        stages = Stages(bars)
        if library is not None:
            stages("reading the library")
            found = load_library(library)
        else:
            bout = settings.bout or BoutSettings()
            style, level = bout.library, "actions" if settings.fighters else "frames"
            if settings.dodging:
                style, level = (settings.dodge or DodgeSettings()).library, "avoidance"
            if settings.walking:
                style, level = (settings.prepare or PrepareSettings()).library, "preparation"
            found = builtin_library(cache, progress=stages, style=style, level=level)
        if settings.attacker:
            style = settings.attacker[0].library
            if is_library(style):
                attack = load_library(style)
            else:
                attack = builtin_library(cache_folder(None), progress=stages, style=style)
            stages("preparing the scene")
            training = Training(bars)
            return EvasionScene(settings, found, attack, seed=seed, cache=cache, progress=training)
        stages("preparing the scene")
        if settings.walking:

            def learning(batch: int, changed: float) -> None:
                if batch % 20 == 1:
                    stages(f"learning to approach: batch {batch}, {changed:.1%} of states changed")

            return PrepareScene(settings, found, seed=seed, cache=cache, progress=learning)
        if settings.dodging:
            return DodgeScene(settings, found, seed=seed)
        if settings.fighters:
            return BoutScene(settings, found, seed=seed)
        return LiveScene(settings, found, seed=seed, cache=cache, progress=Training(bars))


@app.command()
def run(
    scene: Annotated[str, typer.Argument(help="A built-in scene or a .toml scene file.")],
    library: LibraryOption = None,
    seconds: Annotated[float, typer.Option(help="How long [s].")] = 30.0,
    count: CountOption = None,
    throws: ThrowsOption = None,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same bytes.")] = 0,
    output: Annotated[
        list[Path] | None,
        typer.Option("--out", "-o", help="Write .rec, .glb, .bvh or .png; may be repeated."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Run a scene without drawing, record it, and print how good it is."""
    for path in output or []:  # before any long work: what is wrong is said at once
        _exporter(path)
    settings = _settings(scene, count, throws)
    from kumite.scene import measure, record

    everyone = (
        settings.model_copy(update={"crowd": None}).names if settings.crowd else settings.names
    )
    _check_outputs(output or [], [*everyone, *(["the crowd"] if settings.crowd else [])])
    live = _live_scene(settings, library, seed)
    with progress() as bars:
        task = bars.add_task(f"running {scene}", total=1.0, note="")
        recording = record(live, seconds, lambda share: bars.update(task, completed=share))
    for path in output or []:
        _export(recording, path)
    _show_metrics(measure(recording), as_json)
    if not as_json:
        for line in (*_thinking(live), *_avoiding(recording)):
            out.print(line, markup=False, highlight=False)
        for path in output or []:
            out.print(f"wrote {path}", markup=False, highlight=False)


def _thinking(live: Any) -> list[str]:
    """How long decisions took. Not in the recording: the same seed gives the same bytes."""
    decisions = getattr(live, "decisions", [])
    if not decisions:
        return []
    seconds = sorted(d.seconds for d in decisions)
    nodes = sum(int(d.nodes.sum()) for d in decisions)
    pruned = sum(d.pruned for d in decisions) / len(decisions)
    return [
        f"{len(decisions)} decisions, {nodes} nodes, {pruned:.0%} pruned; "
        f"{1e3 * sum(seconds) / len(seconds):.1f} ms a decision, at most {1e3 * seconds[-1]:.1f} ms"
    ]


def _avoiding(recording: Any) -> list[str]:
    """What came of what was thrown at those who avoid."""
    kinds = [e.kind for e in recording.events]
    found = [e.data["outcome"] for e in recording.events if e.kind == "avoidance"]
    if not found and "throw" not in kinds:
        return []
    outcomes = ", ".join(f"{name} {found.count(name)}" for name in sorted(set(found)))
    return [
        f"{kinds.count('throw')} balls thrown; {kinds.count('avoided')} attacks avoided, "
        f"{kinds.count('missed')} missed anyway, "
        f"{kinds.count('struck')} balls struck somebody; searches: {outcomes or 'none'}"
    ]


def _show_metrics(metrics: Any, as_json: bool) -> None:
    if as_json:
        print_json(metrics.to_json())
        return
    table = Table(title=f"{metrics.seconds:.1f} s")
    columns = ("", "thrown", "landed", "blocked", "skate m/s", "of source", "facing")
    for column in (*columns, "join jump m/s", "joins", "variety"):
        table.add_column(column, justify="right")
    shown = metrics.characters if len(metrics.characters) <= MOST_SHOWN else ()
    for c in shown:
        ratio = "" if c.skate_ratio is None else f"{c.skate_ratio:.2f}"
        facing = "" if c.facing_share is None else f"{c.facing_share:.0%}"
        table.add_row(
            c.name,
            str(c.thrown),
            str(c.landed),
            str(c.blocked),
            f"{c.skate_m_s:.3f}",
            ratio,
            facing,
            f"{c.join_jump_m_s:.2f}",
            str(c.joins),
            f"{c.variety:.0%}",
        )
    if shown:
        out.print(table)
    else:
        many = metrics.characters
        out.print(
            f"{metrics.seconds:.1f} s, {len(many)} characters: "
            f"{sum(c.thrown for c in many)} blows thrown, {sum(c.landed for c in many)} landed, "
            f"{sum(c.blocked for c in many)} blocked, "
            f"{sum(c.landed > 0 for c in many)} of them landed one; worst skate "
            f"{max(c.skate_m_s for c in many):.3f} m/s, worst jump at a join "
            f"{max(c.join_jump_m_s for c in many):.2f} m/s"
        )
    if metrics.min_separation_m is not None:
        out.print(f"smallest distance between bodies: {metrics.min_separation_m:.2f} m")


@app.command()
def metrics(
    recording: Annotated[Path, typer.Argument(help="A .rec file.")], as_json: JsonOption = False
) -> None:
    """Score a recording: hits, foot skate, distances, facing, joins."""
    from kumite.scene import load_recording, measure

    loaded = load_recording(recording)
    _show_metrics(measure(loaded), as_json)
    if not as_json:
        for line in _avoiding(loaded):
            out.print(line, markup=False, highlight=False)


MOST_SHOWN = 40  # characters, each in a row of its own
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
    for path in output:
        _exporter(path)  # a wrong ending is said before anything heavy is imported
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
        str,
        typer.Argument(
            help="A built-in scene, a .toml scene file, a .rec file, or a library of actions."
        ),
    ] = "sparring",
    library: LibraryOption = None,
    count: CountOption = None,
    throws: ThrowsOption = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the scene.")] = 0,
    host: Annotated[
        str, typer.Option(help="Address to listen on; others than 127.0.0.1 let others in.")
    ] = "127.0.0.1",
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port; 0 takes any free one.")
    ] = None,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(help="Another name that the page is asked for as, of a proxy or a tunnel."),
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="End by itself after this time.")] = None,
    browser: Annotated[bool, typer.Option(help="Open a browser where there is one.")] = True,
) -> None:
    """Watch a scene live in the browser, play a recording, or a library's actions one by one."""
    if seconds is None and os.environ.get("DEMO_SECONDS"):
        try:
            seconds = float(os.environ["DEMO_SECONDS"])
        except ValueError:
            raise KumiteError(
                f"DEMO_SECONDS={os.environ['DEMO_SECONDS']!r}: expected a number of seconds"
            ) from None
    stage = _stage(scene, library, count, throws, seed)
    from kumite.studio import serve

    serve(
        stage,
        host=host,
        port=8080 if port is None else port,
        strict_port=port is not None,
        allowed=allow_host or (),
        open_browser=browser,
        seconds=seconds,
        announce=lambda line: out.print(line, markup=False, highlight=False),
    )


def _stage(
    scene: str, library: Path | None, count: int | None, throws: int | None, seed: int
) -> Any:
    """What the studio is to show."""
    if not scene.endswith(".rec") and not is_library(scene):
        return _live_scene(_settings(scene, count, throws), library, seed)
    from kumite.graph import load_library
    from kumite.scene import ActionPlayback, Playback, load_recording

    if scene.endswith(".rec"):
        return Playback(load_recording(scene))
    for name, value in (("--library", library), ("--count", count), ("--throws", throws)):
        if value is not None:
            raise KumiteError(f"{name}: of a scene; {scene} is a library, whose actions are played")
    found = load_library(scene)
    if not found.actions:
        raise KumiteError(
            f"{scene}: a library of frames, without actions; expected one built with "
            "'kumite build --level actions' (or a scene, and this library as --library)"
        )
    return ActionPlayback(found)


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

    with progress() as bars:
        rows = run_all(folder, only, Stages(bars))
    if as_json:
        print_json(rows)
        return
    table = Table()
    for column in ("figure", "value", "unit", "wanted", "peak MB"):
        table.add_column(column, justify="left" if column in ("figure", "unit") else "right")
    for row in rows:
        limit = "" if row["limit"] is None else f"{row['limit']:g}"
        peak = "" if row["peak_mb"] is None else f"{row['peak_mb']:.0f}"
        table.add_row(row["name"], f"{row['value']:.4g}", row["unit"], limit, peak)
    out.print(table)
