"""What a library holds, as lines and as plain values."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kumite.cli.app import out, print_json
from kumite.errors import KumiteError

if TYPE_CHECKING:
    from rich.table import Table

    from kumite.graph import Layer, Library
    from kumite.graph.preparing import Preparing

ENDING = ".kumite"
MOST_CLIPS = 20  # named by info


def is_library(source: Path | str) -> bool:
    """Whether a name is that of a library: by what the file says of itself, or by its ending."""
    if str(source).endswith(ENDING):
        return True
    if not os.path.isfile(source):  # noqa: PTH113 - Path.is_file raises on names that are too long
        return False
    from kumite import files

    return files.kind_of(source) == files.LIBRARY[0]


def refuse_no_library(path: Path | str) -> None:
    """Say what a file is instead of a library before anything is imported that computes."""
    from kumite import files

    files.refuse_unreadable(path, *files.LIBRARY)


def library_values(library: Library) -> dict[str, Any]:
    """What a library holds, as JSON values: what its layers share, then each of them."""
    from kumite.graph import assess_library

    worth, verdicts = assess_library(library)
    return {
        "clips": len(library.clips.names),
        "frames": len(library.clips),
        "fps": library.clips.fps,
        "layers": {
            name: {
                **layer_values(layer),
                "digest": layer.digest,
                "worth": worth[name].to_json(),
            }
            for name, layer in library.layers.items()
        },
        "missing": dict(library.missing),
        "scenes": [asdict(verdict) for verdict in verdicts],
    }


def layer_values(library: Layer) -> dict[str, Any]:
    """What a layer holds, as JSON values: how it was built, then what is counted here."""
    import numpy as np

    values = {**library.report, "avoidance_parts": len(library.avoidance)}
    if library.preparing is not None:
        values["target_motions"] = _target_values(library.preparing)
    if library.actions is not None:
        ways = np.diff(library.table.action_start)
        values["ways_on"] = {
            "least": int(ways.min()),
            "most": int(ways.max()),
            "mean": round(float(ways.mean()), 4),
        }
    return values


def library_lines(library: Library) -> list[str]:
    """What a library holds, to be read: what its layers share, each of them, those it lacks."""
    clips = library.clips
    lines = [f"{len(clips)} frames of {len(clips.names)} clips at {clips.fps:g} frames/s"]
    for name, layer in library.layers.items():
        first, *more = layer_lines(layer)
        lines += [f"{name}: {first}", *(f"  {line}" for line in more)]
    return lines + [f"{name}: not built: {why}" for name, why in library.missing.items()]


def layer_lines(library: Layer) -> list[str]:
    """What a layer holds, to be read."""
    import numpy as np

    from kumite.annotate import KINDS

    r, clips, table = library.report, library.clips, library.table
    lines = [f"{len(library.strikes)} blows"]
    if len(library.avoidance):
        held = len(np.unique(library.parts_of_stretch[1]))
        mean = float(np.mean(library.avoidance.stop - library.avoidance.start)) / clips.fps
        lines.append(
            f"{len(library.avoidance)} avoidance parts of {mean:.2f} s on average, "
            f"{held} of them connected, each within one action"
        )
    if library.preparing is not None:
        return lines + _preparation_lines(library)
    if library.actions is None:
        mean = table.duration[table.stretch].mean() / clips.fps
        kept = ""
        if _says(r, "frames_kept", "hits_kept"):
            kept = f"{r['frames_kept']} frames connected, {r['hits_kept']} blows in them: "
        lines.append(
            f"{kept}{table.states} states, {table.actions} actions of {mean:.2f} s on average"
        )
        if _says(r, "transitions", "candidates", "mean_join_cost", "threshold"):
            if r.get("level") == "avoidance" and "every" in r:
                where = f"an avoidance may be begun every {r['every']:g} s"
            else:
                event = r.get("event", "none")
                where = "anywhere" if event == "none" else f"{event} lift-off"
            lines.append(
                f"{r['transitions']} transitions of {r['candidates']} candidates ({where}), "
                f"mean join cost {r['mean_join_cost']:.2f}, accepted below {r['threshold']:.2f}"
            )
        return lines
    kind, ways = library.actions.kind[library.action_of_stretch], np.diff(table.action_start)
    counts = ", ".join(f"{name} {np.sum(kind == k)}" for k, name in enumerate(KINDS))
    joined = table.join_cost[table.join_cost > 0]
    lines += [
        f"{len(library.actions)} actions, {len(table.first)} of them connected"
        + (f" ({r['hits_kept']} blows)" if "hits_kept" in r else "")
        + f", of {table.duration.mean() / clips.fps:.2f} s on average: {counts}",
        (
            f"{r['nodes']} nodes of postures alike within {r['alike']:g} rad; "
            if _says(r, "nodes", "alike")
            else ""
        )
        + f"after an action {ways.min()} to {ways.max()} are offered, {ways.mean():.1f} on "
        "average, reactions never",
    ]
    if len(joined):
        lines.append(f"mean join cost {joined.mean():.2f} rad")
    return lines


def worth_table(library: Library) -> Table:
    """What a library is worth: what of its clips each layer reaches, its joins, and what kinds of
    scenes the library is good for."""
    from rich.table import Table
    from rich.text import Text

    from kumite.graph import assess_library

    table = Table(title="what it is worth", show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    worth, verdicts = assess_library(library)
    for name, found in worth.items():
        table.add_row(Text(f"layer {name}", style="bold"))
        for label, text in found.rows():
            table.add_row(Text(label), Text(text))
        table.add_section()
    for verdict in verdicts:
        table.add_row(Text(verdict.kind), Text(str(verdict)))
    return table


def _says(report: Mapping[str, Any], *names: str) -> bool:
    return all(name in report for name in names)


def _preparation_lines(library: Layer) -> list[str]:
    """Cores with the pace of each, then a target a line: what it is about, and where."""
    import numpy as np

    from kumite.clip import LIMBS
    from kumite.graph.preparing import KINDS, NO_LIMB

    preparing, table = library.preparing, library.table
    if preparing is None:
        return []
    fps, cores, targets = library.clips.fps, preparing.hierarchy.cores, preparing.hierarchy.targets
    kept = len(np.unique(np.concatenate([np.arange(a, b + 1) for a, b in _ranges(library)])))
    lines = [
        f"{kept} frames connected: {table.states} states, {table.actions} actions of "
        f"{table.duration[table.stretch].mean() / fps:.2f} s on average",
        f"{len(cores)} cores: "
        + ", ".join(f"{name} {v:.2f} m/s" for name, v in zip(cores.label, cores.speed)),
        f"{len(targets)} target motions:",
    ]
    for t, label in enumerate(targets.label):
        kind, limb, clear = KINDS[preparing.kind[t]], int(preparing.limb[t]), preparing.clear[t]
        x, y, z = preparing.place[t]
        about = {
            "strike": f"strikes with the {LIMBS[limb].replace('_', ' ')}"
            if limb != NO_LIMB
            else "",
            "under": f"gets under a bar {clear:.2f} m high",
            "over": f"gets over a hurdle {clear:.2f} m high",
        }[kind]
        height = f", {y:.2f} m high" if kind == "strike" else ""
        lines.append(
            f"{label}: {about}, {np.hypot(x, z):.2f} m from its start{height}, "
            f"{(preparing.contact[t] - targets.start[t]) / fps:.2f} s after it"
        )
        if not preparing.found[t]:
            lines.append(f"{label}: no frame fits, its first frame is taken")
    for label in library.report.get("targets_over_bound", ()):
        what = "kept, as it is marked" if label in targets.label else "left out"
        lines.append(
            f"{label}: its way in or out jumps farther than the bound (--join-angle, "
            f"--join-height, --join-speed): {what}"
        )
    return lines


def _target_values(preparing: Preparing) -> list[dict[str, Any]]:
    from kumite.clip import LIMBS
    from kumite.graph.preparing import KINDS, NO_LIMB

    targets = preparing.hierarchy.targets
    return [
        {
            "label": label,
            "kind": KINDS[preparing.kind[t]],
            "limb": None if preparing.limb[t] == NO_LIMB else LIMBS[preparing.limb[t]],
            "start": int(targets.start[t]),
            "stop": int(targets.stop[t]),
            "mark": int(targets.mark[t]),
            "reference": int(preparing.reference[t]),
            "found": bool(preparing.found[t]),
            "contact": int(preparing.contact[t]),
            "place": [round(v, 4) for v in preparing.place[t].tolist()],
            "clear": round(float(preparing.clear[t]), 4),
            "way": round(float(preparing.way[t]), 4),
        }
        for t, label in enumerate(targets.label)
    ]


def _ranges(library: Layer) -> list[tuple[int, int]]:
    return list(zip(library.table.first.tolist(), library.table.last.tolist()))


def show_library(path: Path | str, plot: Path | None, as_json: bool, given: list[str]) -> None:
    """``kumite info`` of a library. given: options that say how to read motion capture."""
    if given:
        raise KumiteError(f"{given[0]}: of motion capture; {path} is a library")
    refuse_no_library(path)
    from kumite.graph import load_library

    library = load_library(path)
    if plot is not None:
        from kumite.export.plot import plot_hits

        plot_hits(plot, next(iter(library.layers.values())).strikes, str(path))
    clips = library.clips
    names = dict(zip(clips.names, (round(c.seconds, 2) for c in clips)))
    if as_json:
        held = {"digest": library.digest, "joints": len(clips.skeleton), "seconds": names}
        print_json({**library_values(library), **held})
        return
    shown = [f"{name} {s:g} s" for name, s in names.items()]
    more = [f"and {len(shown) - MOST_CLIPS} more"] if len(shown) > MOST_CLIPS else []
    lines = [
        *library_lines(library),
        f"clips: {', '.join(shown[:MOST_CLIPS] + more)}",
        f"skeleton: {len(clips.skeleton)} joints; digest {library.digest}",
    ]
    for line in lines:
        out.print(line, markup=False, highlight=False)
    out.print(worth_table(library))
    if plot is not None:
        out.print(f"wrote {plot}", markup=False, highlight=False)
