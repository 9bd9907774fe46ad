"""Figures of a recording, as tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rich.table import Table

from kumite.cli.app import out, print_json

if TYPE_CHECKING:
    from kumite.scene import CharacterMetrics, Metrics
    from kumite.scene.reports import Report

MOST_SHOWN = 40  # rows of a table; of more the sum is shown
ALL = "all"


def show_metrics(metrics: Metrics, as_json: bool) -> None:
    """What a recording is about, then how well everyone moves."""
    if as_json:
        print_json(metrics.to_json())
        return
    count = len(metrics.characters)
    who = f", {count} characters" if count > MOST_SHOWN else ""
    out.print(f"{metrics.seconds:.1f} s{who}", markup=False, highlight=False)
    for report in metrics.reports:
        _show_report(report)
    _show_motion(metrics.characters)
    if metrics.min_separation_m is not None:
        out.print(f"smallest distance between bodies: {metrics.min_separation_m:.2f} m")


def _show_report(report: Report) -> None:
    rows = dict(report.rows)
    if len(rows) > MOST_SHOWN:
        rows = {}
    if len(report.rows) > 2:
        rows[ALL] = report.total
    _show(report.name, rows)


def _show_motion(characters: tuple[CharacterMetrics, ...]) -> None:
    rows = {
        c.name: {
            "skate m/s": round(c.skate_m_s, 3),
            "of source": None if c.skate_ratio is None else round(c.skate_ratio, 2),
            "facing %": None if c.facing_share is None else round(100 * c.facing_share),
            "join jump m/s": round(c.join_jump_m_s, 2),
            "joins": c.joins,
            "variety %": round(100 * c.variety) if c.variety else None,
        }
        for c in characters
    }
    if len(rows) > MOST_SHOWN:
        worst = ("skate m/s", "of source", "join jump m/s")
        rows = {"worst": {k: max(r[k] or 0.0 for r in rows.values()) for k in worst}}
    _show("motion", rows)


def _show(title: str, rows: Mapping[str, Mapping[str, Any]]) -> None:
    """A table; columns in which nothing stands are left out."""
    columns = [c for c in next(iter(rows.values())) if any(r[c] is not None for r in rows.values())]
    table = Table(title=title, title_justify="left")
    for column in ("", *columns):
        table.add_column(column, justify="right", no_wrap=True)
    for label, row in rows.items():
        table.add_row(label, *("" if row[c] is None else f"{row[c]:,}" for c in columns))
    out.print(table)
