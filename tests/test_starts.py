"""No two seeds begin alike, and no two characters of a scene move in step."""

from __future__ import annotations

import numpy as np
import pytest

from kumite.cli.ahead import Wanted
from kumite.cli.scenes import live_scene
from kumite.graph import Layer, kinds
from kumite.graph.kinds import suited
from kumite.scene import catalogue, load_scene, record
from kumite.scene.starts import draw_starts, stream
from tests.shared import builtin

SECONDS = 2.0
IN_STEP = 1  # frames that twins are apart in the library, at most


def _twins(frame: np.ndarray) -> float:
    """Of frames [F, K] of a library, the share of everybody's time in step with somebody."""
    in_step = np.abs(frame[:, :, None] - frame[:, None, :]) <= IN_STEP
    in_step &= ~np.eye(frame.shape[1], dtype=bool)
    return float(in_step.any(axis=2).mean())


@pytest.mark.parametrize("name", catalogue.names())
def test_two_seeds_show_two_fights_and_nobody_is_a_twin(name: str):
    shown = [record(live_scene(Wanted(name, None, None, None, seed)), SECONDS) for seed in (1, 2)]
    frame = [r.library_frame.astype(np.int64) for r in shown]
    assert not np.array_equal(frame[0], frame[1])
    if not load_scene(name).attacker:  # whose library is another
        assert _twins(frame[0]) < 0.5


def test_one_more_changes_nobody_elses_luck():
    layer = builtin()
    every = np.arange(len(layer.table.first))
    few, many = (
        np.stack(draw_starts(layer, every, [stream(7, k) for k in range(n)])) for n in (5, 9)
    )
    np.testing.assert_array_equal(few, many[:, :5])
    frame = np.sort(many[1])
    assert np.diff(frame).min() > 0.2 * layer.clips.fps - 1


@pytest.fixture(scope="module")
def targets() -> Layer:
    return builtin("targets", "preparation")


def test_kinds_are_what_was_found(targets: Layer):
    found = suited(targets)
    of = {kind: {found.label[t] for t in which} for kind, which in found.of.items()}
    assert of == {
        "under": {"duck_under", "crawl_under"},
        "over": {"jump_over"},
        "kick": {"kick_ball", "front_kick"},
        "punch": {"punch"},
        "strike": {"kick_ball", "front_kick", "punch"},
    }
    under = found.of["under"]
    low, high = sorted(found.clear[under])
    # The nearest size that clears a bar; nobody gets under one that is lower than all.
    assert found.clear[found.fit(under, high + 0.3, 0.0)[0]] == high
    assert found.clear[found.fit(under, 0.5 * (low + high), 0.0)].tolist() == [low]
    assert len(found.fit(under, low - 0.01, 0.0)) == 0
    assert [found.label[t] for t in found.fit(found.of["kick"], None, 0.1)] == ["kick_ball"]
    assert found.label[found.fit(found.of["kick"], 0.8, 0.1)[0]] == "front_kick"


def test_who_lies_down_is_taken_only_at_need(targets: Layer, monkeypatch: pytest.MonkeyPatch):
    assert len(suited(targets).fit(suited(targets).of["under"], None, 0.0)) == 2
    monkeypatch.setattr(kinds, "LOW_HIPS", 0.35)  # as if who crawls lay, and who ducks did not
    found = suited(targets)
    under = found.of["under"]
    assert [found.label[t] for t in found.fit(under, None, 0.0)] == ["duck_under"]
    lowest = found.fit(under, found.clear[under].min() + 0.01, 0.0)
    assert [found.label[t] for t in lowest] == ["crawl_under"]
