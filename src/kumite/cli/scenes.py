"""Commands for scenes: run them, score and export recordings, watch them, measure."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from kumite.cli import INTERRUPTED
from kumite.cli.ahead import Wanted, is_cold, prepare
from kumite.cli.app import JsonOption, app, err, out, print_json
from kumite.cli.complete import complete_scene, complete_shown
from kumite.cli.library import is_library, refuse_no_library
from kumite.cli.progress import Compiling, Stages, Training, progress, say
from kumite.cli.recording import refuse_no_recording
from kumite.cli.report import show_metrics
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
        from kumite.scene.needs import needs

        print_json(
            {
                name: {
                    "title": s.title,
                    "shows": s.about,
                    "characters": len(s.names),
                    "needs": needs(s).to_json(),
                    "settings": s.model_dump(mode="json", exclude_unset=True),
                }
                for name, s in builtin_scenes().items()
            }
        )
        return
    width = max(map(len, catalogue.names()))
    for name in catalogue.names():
        out.print(f"{name:{width}} {catalogue.about(name)}", markup=False, highlight=False)


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


def settings_of(wanted: Wanted) -> Any:
    """The scene that is wanted, as it is to be run."""
    return _settings(wanted.scene, wanted.count, wanted.throws)


def live_scene(wanted: Wanted) -> Any:
    """The scene that is wanted, ready to run."""
    return _live_scene(settings_of(wanted), wanted.library, wanted.seed)


def _live_scene(settings: Any, library: Path | None, seed: int) -> Any:
    """A scene ready to run: library read or performed, policies trained or found."""
    if library is not None:
        refuse_no_library(library)
    from kumite.control import cache_folder
    from kumite.graph import builtin_layer, builtin_library, load_library
    from kumite.scene import EvasionScene, PrepareScene, World
    from kumite.scene.needs import needs
    from kumite.warm import warm

    cache, needed = cache_folder(library), needs(settings)
    with progress() as bars:
        warm([settings], Compiling(bars), building=library is None)
        stages = Stages(bars)
        if library is not None:
            stages("reading the library")
            found = load_library(library)
        else:
            found = builtin_library(
                cache, progress=stages, style=needed.style, layers=needed.layers
            )
        if needed.attackers is not None:
            if is_library(needed.attackers):
                attack = load_library(needed.attackers)
            else:
                attack = builtin_layer(cache_folder(None), progress=stages, style=needed.attackers)
            stages("preparing the scene")
            training = Training(bars)
            return EvasionScene(settings, found, attack, seed=seed, cache=cache, progress=training)
        stages("preparing the scene")
        if settings.walking:

            def learning(batch: int, changed: float) -> None:
                stages(f"learning to approach: batch {batch}, {changed:.1%} of states changed")

            return PrepareScene(settings, found, seed=seed, cache=cache, progress=learning)
        return World(settings, found, seed=seed, cache=cache, progress=Training(bars))


AtOption = Annotated[
    str | None,
    typer.Option(
        help="What a .png shows: hits, avoided, passed, launches, blows, any other kind of event "
        "of the recording, or evenly (default: what it is about)."
    ),
]


@app.command()
def run(
    scene: Annotated[
        str,
        typer.Argument(
            help="A built-in scene or a .toml scene file.", autocompletion=complete_scene
        ),
    ],
    library: LibraryOption = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            help="How long [s] (default 30; with --throws until all balls are down). Balls come "
            "faster where they would not all be thrown in that time."
        ),
    ] = None,
    count: CountOption = None,
    throws: ThrowsOption = None,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same bytes.")] = 0,
    output: Annotated[
        list[Path] | None,
        typer.Option("--out", "-o", help="Write .rec, .glb, .bvh or .png; may be repeated."),
    ] = None,
    at: AtOption = None,
    as_json: JsonOption = False,
) -> None:
    """Run a scene without drawing, record it, and print how good it is.

    Ctrl-C ends it early and keeps what ran: all that was asked for is written. A second Ctrl-C
    ends at once and writes nothing.
    """
    for path in output or []:  # before any long work: what is wrong is said at once
        _exporter(path)
    settings = _settings(scene, count, throws)
    from kumite.scene import seconds_to_throw, throws_within

    if seconds is None:
        seconds = SECONDS if throws is None else max(SECONDS, seconds_to_throw(settings))
    elif throws is not None:
        asked_for, settings = settings, throws_within(settings, seconds)
        if settings.balls is not None and settings is not asked_for:
            every = settings.balls.every
            say(f"a ball every {every:.2f} s, so that all {throws} are thrown in {seconds:g} s")
    everyone = (
        settings.model_copy(update={"crowd": None}).names if settings.crowd else settings.names
    )
    _check_outputs(output or [], [*everyone, *(["the crowd"] if settings.crowd else [])])
    live = _live_scene(settings, library, seed)
    from kumite.control.conductor import ControllerError
    from kumite.scene import measure, record

    with progress() as bars, _asked_to_stop() as asked:
        bar = bars.add(f"running {scene}", total=1.0)
        failed: KumiteError | None = None
        try:
            recording = record(live, seconds, lambda share: bars.update(bar, share), asked.is_set)
        except ControllerError as error:
            failed, recording = error, error.recording
    if asked.is_set():
        err.print(f"interrupted after {recording.seconds:.1f} of {seconds:g} s", highlight=False)
    for path in output or []:
        say(f"writing {path}")
        _export(recording, path, at)
    if failed is not None:
        raise failed
    show_metrics(measure(recording), as_json)
    if not as_json:
        for line in (*_thinking(live), *(f"wrote {path}" for path in output or [])):
            out.print(line, markup=False, highlight=False)
    if asked.is_set():
        raise typer.Exit(INTERRUPTED)


@contextmanager
def _asked_to_stop() -> Iterator[threading.Event]:
    """Whether Ctrl-C was pressed: the first time it only asks, the second time it interrupts."""
    asked = threading.Event()
    before = signal.getsignal(signal.SIGINT)
    in_main = threading.current_thread() is threading.main_thread()
    if not in_main or before is not signal.default_int_handler:  # it is ignored, or another's
        yield asked
        return

    def ask(number: int, frame: Any) -> None:
        asked.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    signal.signal(signal.SIGINT, ask)
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)


def _thinking(live: Any) -> list[str]:
    """How long decisions took. Not in the recording: the same seed gives the same bytes."""
    seconds = sorted(d.seconds for d in getattr(live, "decisions", []))
    if not seconds:
        return []
    mean = sum(seconds) / len(seconds)
    return [f"{1e3 * mean:.1f} ms a decision, at most {1e3 * seconds[-1]:.1f} ms"]


@app.command()
def metrics(
    recording: Annotated[Path, typer.Argument(help="A .rec file.")], as_json: JsonOption = False
) -> None:
    """Figures of a recording: what it is about (blows, balls, errands, …), and how all move."""
    refuse_no_recording(recording)
    from kumite.scene import load_recording, measure

    show_metrics(measure(load_recording(recording)), as_json)


SECONDS = 30.0  # of a run
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


def _export(recording: Any, path: Path, at: str | None = None) -> None:
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
        from kumite.export.moment_sheet import moment_sheet

        moment_sheet(path, recording, at)


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
    at: AtOption = None,
) -> None:
    """Write a recording as GLB (all characters), BVH (one of them) or a contact sheet."""
    for path in output:
        _exporter(path)  # a wrong ending is said before anything heavy is imported
    refuse_no_recording(recording)
    from kumite.scene import load_recording

    loaded = load_recording(recording)
    if character is not None:
        loaded = loaded.only(character)
    _check_outputs(output, loaded.names)
    for path in output:
        _export(loaded, path, at)
        out.print(f"wrote {path}", markup=False, highlight=False)


@app.command()
def studio(
    scene: Annotated[
        str,
        typer.Argument(
            help="A built-in scene, a .toml scene file, a .rec file, or a library of actions.",
            autocompletion=complete_shown,
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
    seconds: Annotated[
        float | None, typer.Option(help="End by itself after this time [s] of the live scene.")
    ] = None,
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
    wanted = Wanted(scene, library, count, throws, seed)
    stage, coming = _shown_first(wanted)
    from kumite.studio import serve

    serve(
        stage,
        coming=coming,
        host=host,
        port=8080 if port is None else port,
        strict_port=port is not None,
        allowed=allow_host or (),
        open_browser=browser,
        seconds=seconds,
        announce=lambda line: out.print(line, markup=False, highlight=False),
    )


def _shown_first(wanted: Wanted) -> tuple[Any, Any]:
    """What the studio shows, and what is prepared meanwhile where nothing is compiled yet."""
    if wanted.library is not None:
        refuse_no_library(wanted.library)
    if _is_played(wanted.scene) or not is_cold(wanted):
        return _stage(*wanted), None
    from kumite.studio import Coming, Interlude

    return Interlude(), Coming(settings_of(wanted).title, partial(prepare, wanted))


def _is_played(scene: str) -> bool:
    """Whether that is a recording or a library, not a scene."""
    return scene.endswith(".rec") or is_library(scene)


def _stage(
    scene: str, library: Path | None, count: int | None, throws: int | None, seed: int
) -> Any:
    """What the studio is to show."""
    if not _is_played(scene):
        return _live_scene(_settings(scene, count, throws), library, seed)
    if scene.endswith(".rec"):
        refuse_no_recording(scene)
        from kumite.scene import Playback, load_recording

        return Playback(load_recording(scene))
    for name, value in (("--library", library), ("--count", count), ("--throws", throws)):
        if value is not None:
            raise KumiteError(f"{name}: of a scene; {scene} is a library, whose actions are played")
    refuse_no_library(scene)
    from kumite.graph import load_library
    from kumite.scene import ActionPlayback

    return ActionPlayback(load_library(scene).layer("actions"))


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
