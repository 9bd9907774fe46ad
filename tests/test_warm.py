"""Kernels are compiled ahead: all that a scene calls, shared out among processes."""

from __future__ import annotations

from pathlib import Path

import pytest

from kumite import warm
from kumite.cli import scenes
from kumite.kernels.known import Known, called, forget, known, read_types, spell
from kumite.scene import load_scene, record


def test_the_table_of_known_kernels_names_kernels_and_types():
    rows = known()
    assert len({(row.name, row.types) for row in rows}) == len(rows) > 30
    for row in rows:
        assert spell(read_types(row.types)) == row.types
        count = warm.kernel_of(row.name).py_func.__code__.co_argcount
        assert len(read_types(row.types)) == count, row.name


@pytest.mark.parametrize(
    "name", ["sparring", "boxing", "dodgeball", "slip", "ball-kick", "under-fire"]
)
def test_scenes_call_known_kernels_only(name: str):
    settings = load_scene(name)
    scenes._live_scene(settings, None, 0)  # the library is made, where it is not there yet
    forget()
    record(scenes._live_scene(settings, None, 0), 1.0)
    needs = warm.needs_of(settings)
    ahead = {(row.name, row.types) for row in known() if needs.intersection(row.needs)}
    assert called() and called() <= ahead


def test_kernels_are_compiled_once_in_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    small = sorted(known(), key=lambda row: len(row.types))[:4]
    monkeypatch.setattr("kumite.kernels.known.known", lambda: small)
    forget()
    told: list[tuple[int, int, float]] = []
    assert warm.warm(progress=lambda *at: told.append(at), processes=2) == 4
    assert [at[:2] for at in told] == [(n, 4) for n in range(5)]
    assert told[0][2] == 0.0 and abs(told[-1][2] - 1.0) < 1e-9
    assert len(list(tmp_path.rglob("*.nbc"))) == 4
    assert warm.warm(progress=lambda *at: told.append(at)) == 0 and len(told) == 5


def test_shares_hold_every_kernel_once_and_take_about_as_long():
    seconds = (9.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.5, 0.5)
    rows = [Known(("all",), s, f"m{n}.k", "()") for n, s in enumerate(seconds)]
    for count in (1, 2, 3, 20):
        found = warm.shares(rows, count)
        assert sorted(r for share in found for r in share) == sorted(rows)
        most = max(sum(r.seconds for r in share) for share in found)
        assert most <= max(9.0, 1.34 * sum(seconds) / count)
