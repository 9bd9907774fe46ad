"""The command that cuts clips into actions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from kumite.cli.app import JsonOption, app, out, print_json
from kumite.cli.progress import Stages, progress
from kumite.cli.reading import FpsOption, Reading, SkipBad, reads_mocap
from kumite.errors import KumiteError


@app.command()
@reads_mocap
def segment(
    source: Annotated[
        list[str] | None,
        typer.Argument(help="Mocap: a folder, a glob, .bvh files, .amc files."),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The text file; your edits in it are kept.")
    ] = Path("actions.txt"),
    style: Annotated[
        str | None, typer.Option(help="A style of the built-in performer instead of files.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the style.")] = 0,
    score: Annotated[
        bool,
        typer.Option(help="How well a style's actions are found; kinds in each clip of files."),
    ] = False,
    as_json: JsonOption = False,
    fps: FpsOption = None,
    skip_bad: SkipBad = False,
    *,
    reading: Reading,
) -> None:
    """Cut clips into actions: a text file to edit. Run it again as often as you like."""
    from kumite.files import refuse_unwritable

    if bool(source) == (style is not None):
        raise KumiteError("name motion capture files, or a --style of the built-in performer")
    refuse_unwritable(output)
    if source:
        reading.refuse(source, fps)
    from kumite.annotate import find_actions, find_avoidance, find_contacts, find_strikes
    from kumite.annotate.action_file import check, merge, parse, to_lines, write
    from kumite.clip import Clip, concatenate
    from kumite.performer import Truth
    from kumite.performer import perform as perform_style

    known = parse(output) if output.exists() else None  # before the work, not after
    truth: dict[str, Truth] = {}
    groups: list[list[Clip]] = []
    if style is not None:
        made = perform_style(style, seed, mirrored=False)
        truth = {clip.name: t for clip, t in zip(made.clips, made.truth)}
        groups = [list(made.clips)]
        if fps is not None and fps != made.clips[0].fps:
            raise KumiteError(f"--fps: a style is at {made.clips[0].fps:g} frames a second")
    else:
        loaded = reading.load(source or [], fps, skip_bad=skip_bad)
        groups = loaded.by_skeleton()
    sets = [concatenate(group) for group in groups]
    if known is not None:
        check(output, known, sets)
    found, avoidance = [], []
    with progress() as bars:
        stage = Stages(bars)
        for clips in sets:
            stage(f"cutting {len(clips.names)} clips")
            contacts = find_contacts(clips)
            found.append(find_actions(clips, contacts, find_strikes(clips)))
            avoidance.append(find_avoidance(clips, contacts, actions=found[-1]))
    lines = [line for one in zip(found, sets, avoidance) for line in to_lines(*one)]
    content, kept = merge(known, lines, sets)
    write(output, content)
    scored = _scored(sets, found, avoidance, truth) if score else {}
    if as_json:
        print_json(
            {
                "output": str(output),
                "clips": sum(len(s.names) for s in sets),
                "actions": kept.written + kept.lines,
                "avoidance_parts": kept.parts,
                "kept_lines": kept.lines,
                "kept_gaps": kept.gaps,
                "kept_comments": kept.comments,
                "kept_in": kept.clips,
                **scored,
            }
        )
        return
    out.print(
        f"wrote {output}: {kept.written + kept.lines} actions and {kept.parts} avoidance parts of "
        f"{sum(len(s.names) for s in sets)} clips",
        markup=False,
        highlight=False,
    )
    if known is not None:
        out.print(
            f"kept what you did: {kept.lines} lines, {kept.gaps} gaps, {kept.comments} comments",
            markup=False,
            highlight=False,
        )
    if score:
        _print_score(scored)


def _scored(
    sets: Sequence[Any], found: Sequence[Any], avoidance: Sequence[Any], truth: dict[str, Any]
) -> dict[str, Any]:
    """Scores as plain values: against truth, where there is one, else the kinds in each clip."""
    from kumite.annotate import KINDS
    from kumite.annotate.action_score import kind_shares, score_actions, score_avoidance

    if truth:
        (clips,), (actions,), (found_parts,) = sets, found, avoidance
        true = [truth[name] for name in clips.names]
        s = score_actions(clips, actions, true)
        parts = score_avoidance(clips, found_parts, true)
        return {
            "boundaries": {
                "true": s.true,
                "found": s.found,
                "precision": round(s.precision, 4),
                "recall": round(s.recall, 4),
            },
            "avoidance": {
                "true": parts.true,
                "found": parts.found,
                "precision": round(parts.precision, 4),
                "recall": round(parts.recall, 4),
            },
            "kinds_right": round(s.kinds_right, 4),
            "confusion": {
                kind: dict(zip(KINDS, row)) for kind, row in zip(KINDS, s.confusion.tolist())
            },
        }
    return {
        "kinds": {
            name: dict(zip(KINDS, counts.tolist()))
            for clips, actions in zip(sets, found)
            for name, counts in kind_shares(clips, actions).items()
        }
    }


def _print_score(scored: dict[str, Any]) -> None:
    from kumite.annotate import KINDS

    if "boundaries" in scored:
        b = scored["boundaries"]
        out.print(
            f"boundaries: {b['true']} true, {b['found']} found, precision {b['precision']:.3f}, "
            f"recall {b['recall']:.3f}; kinds right {scored['kinds_right']:.3f}",
            markup=False,
            highlight=False,
        )
        a = scored["avoidance"]
        if a["true"] or a["found"]:
            out.print(
                f"avoidance parts: {a['true']} true, {a['found']} found, "
                f"precision {a['precision']:.3f}, recall {a['recall']:.3f}",
                markup=False,
                highlight=False,
            )
    rows = scored.get("confusion") or scored["kinds"]
    true = "confusion" in scored
    table = Table(title="true kinds (rows), found kinds" if true else "kinds found, share of clip")
    table.add_column("true" if true else "clip", no_wrap=True)
    for kind in KINDS:
        table.add_column(kind, justify="right")
    for name, counts in rows.items():
        total = max(sum(counts.values()), 1)
        cells = (f"{n}" if true else f"{n} ({n / total:.0%})" for n in counts.values())
        table.add_row(name, *cells)
    out.print(table)
