"""Real motion capture that prepares: found, built and played without a label or a number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kumite import mocap as mocap_files
from kumite.annotate import find_contacts, find_strikes
from kumite.graph import Layer, build_preparation, find_targets
from kumite.graph.preparing import KINDS
from kumite.scene import PrepareScene
from kumite.scene.events import Launch, Passed
from kumite.scene.settings import SceneSettings
from kumite.scene.walkers import OFF

TAKES = (
    "1_walk_crawl_walk",
    "1_walk_jump_walk",
    "1_run_straight_1",
    "1_flying_kick",
    "3_walk",
)


@pytest.fixture(scope="module")
def woody(mocap: Path) -> Layer:
    clips = mocap_files.load([mocap / "woody" / f"{name}.amc" for name in TAKES]).clip_set()
    contacts, strikes = find_contacts(clips), find_strikes(clips)
    targets, cycles = find_targets(clips, contacts, strikes)
    return build_preparation(clips, targets, cycles, contacts=contacts, strikes=strikes)


@pytest.mark.slow
def test_real_clips_pass_under_and_over(woody: Layer, tmp_path: Path):
    preparing = woody.preparing
    assert preparing is not None
    labels = preparing.hierarchy.targets.label
    kinds = dict(zip(labels, (KINDS[k] for k in preparing.kind)))
    under = next(name for name in labels if kinds[name] == "under")
    over = next(name for name in labels if kinds[name] == "over")
    settings = SceneSettings.model_validate(
        {
            "title": "t",
            "about": "a",
            "walker": [{"name": "woody", "position": (0.0, -4.0), "goes_to": ("bar", "hurdle")}],
            "target": [
                {"name": "bar", "motion": under, "position": (0.0, 0.0)},
                {"name": "hurdle", "motion": over, "position": (0.0, 6.0)},
            ],
        }
    )
    scene = PrepareScene(settings, woody, seed=203, cache=tmp_path)
    positions = []
    for _ in range(round(25 * scene.fps)):
        scene.step()
        positions.append(scene.walkers.shown.position[0].copy())
    assert np.all(np.isfinite(positions))
    launches = [e for e in scene.events if isinstance(e, Launch)]
    assert {kinds[d.motion] for d in launches} == {"under", "over"}
    assert all(d.bent is not None and d.bent <= OFF for d in launches)
    passed = [e.clearance for e in scene.events if isinstance(e, Passed)]
    assert len(passed) >= 2 and min(passed) > 0
