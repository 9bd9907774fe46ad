"""What a recording is about: figures counted by hand from a few events."""

from __future__ import annotations

from typing import Any

import numpy as np

from kumite.scene.recording import Recording
from kumite.scene.reports import reports
from tests import toys
from tests.telling import event

FPS = 10.0


def told(names: tuple[str, ...], *events: tuple[int, str, str, dict], **settings: Any) -> dict:
    """The reports of a recording of 100 frames in which this happened."""
    skeleton = toys.skeleton()
    shape = (100, len(names))
    happened = tuple(event(*e) for e in events)
    recording = Recording(
        scene="made up",
        fps=FPS,
        skeleton=skeleton,
        names=names,
        root_position=np.zeros((*shape, 3)),
        wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (*shape, len(skeleton), 1)),
        contacts=np.zeros((*shape, 2), dtype=bool),
        library_frame=np.zeros(shape, dtype=int),
        events=happened,
        objects=tuple(dict.fromkeys(n for e in happened for n in e.things)),
        settings=settings,
    )
    return {r.name: r for r in reports(recording)}


def test_a_fight():
    found = told(
        ("red", "blue"),
        (5, "strike", "red", {}),
        (6, "hit", "red", {"victim": "blue", "speed": 6.0, "blocked": False}),
        (15, "strike", "red", {}),
        (16, "hit", "red", {"victim": "blue", "speed": 9.0, "blocked": True}),
        (20, "strike", "blue", {}),
        (30, "strike", "red", {}),
        (31, "hit", "red", {"victim": "blue", "speed": 7.0, "blocked": False}),
        (31, "reaction", "blue", {"size": "fall"}),
        (40, "run over", "red", {"by": "car", "speed": 14.0}),
    )
    assert list(found) == ["fight"]
    red, blue = found["fight"].rows["red"], found["fight"].rows["blue"]
    assert red == {
        "thrown": 3, "landed": 2, "blocked": 1, "taken": 0, "fastest m/s": 7.0, "knocked down": 1,
    }  # fmt: skip
    assert blue == {
        "thrown": 1, "landed": 0, "blocked": 0, "taken": 2, "fastest m/s": None, "knocked down": 1,
    }  # fmt: skip
    assert found["fight"].total["thrown"] == 4 and found["fight"].total["fastest m/s"] is None


def test_a_fight_in_which_nothing_happened_is_one():
    assert told(("red", "blue"), aims_at={"red": "blue"})["fight"].rows["red"]["thrown"] == 0
    assert not told(("anna",))
    nobody = told(("red", "blue"), aims_at={"red": "blue"}, scene={"bout": {"catch": 0.8}})
    assert list(nobody) == ["chase"] and nobody["chase"].rows["red"]["caught"] == 0


def test_throws():
    """Of six balls: two avoided (one told twice), one by luck, one wide, one struck, one flies."""
    throws = [(n, "throw", "a", {"attack": n}) for n in range(1, 7)]
    found = told(
        ("a", "b"),
        *throws,
        (7, "throw", "b", {"attack": 7}),
        (8, "avoidance", "a", {"attack": 1, "outcome": "wide"}),
        (9, "avoidance", "a", {"attack": 1, "outcome": "found"}),
        (10, "avoidance", "a", {"attack": 2, "outcome": "found"}),
        (10, "avoidance", "a", {"attack": 2, "outcome": "found"}),
        (11, "avoidance", "a", {"attack": 5, "outcome": "found"}),
        (11, "avoidance", "b", {"attack": 3, "outcome": "found"}),  # of another's ball
        (12, "avoided", "a", {"attack": 1}),
        (13, "avoided", "a", {"attack": 2}),
        (14, "avoided", "a", {"attack": 3}),
        (15, "missed", "a", {"attack": 4}),
        (16, "struck", "a", {"attack": 5}),
        (17, "struck", "a", {"attack": 7}),
    )
    assert list(found) == ["throws"]  # a ball that is missed is no check point that was missed
    a, b = found["throws"].rows["a"], found["throws"].rows["b"]
    assert list(a.values()) == [6, 2, 1, 1, 1, 1, 1]
    assert list(b.values()) == [1, 0, 0, 1, 0, 0, 0]


def test_blows_avoided():
    seen = [
        (n, "foreseen", "red", {"attack": n, "at": "blue", "gap": gap})
        for n, gap in ((1, -0.1), (2, -0.1), (3, 0.4), (4, -0.1), (5, -0.1), (6, -0.1))
    ]
    found = told(
        ("blue", "red"),
        *seen,
        (7, "foreseen", "red", {"attack": 1, "at": "blue", "gap": -0.2}),  # more of it
        (8, "strike", "red", {"attack": 1}),
        (9, "avoidance", "blue", {"attack": 1, "outcome": "found"}),
        (10, "avoided", "blue", {"attack": 1}),
        (11, "avoided", "blue", {"attack": 2}),
        (12, "avoided", "blue", {"attack": 3}),
        (13, "hit", "red", {"attack": 4, "victim": "blue", "speed": 5.0, "blocked": False}),
        (14, "hit", "red", {"attack": 5, "victim": "blue", "speed": 5.0, "blocked": True}),
        (15, "counter", "blue", {"victim": "red"}),
        (16, "hit", "blue", {"victim": "red", "speed": 5.0, "blocked": False}),
    )
    assert list(found) == ["fight", "blows avoided"]
    assert found["blows avoided"].rows == {
        "blue": {
            "blows": 6, "avoided": 1, "by luck": 1, "wide": 1, "struck": 1, "blocked": 1,
            "struck back": 1, "landed": 1,
        }
    }  # fmt: skip


def test_errands():
    def launch(frame: int, motion: str, level: float, apart: float):
        return frame, "launch", "anna", {"motion": motion, "level": level, "apart_deg": apart}

    found = told(
        ("anna", "opponent 1"),
        launch(1, "kick_ball", 0.5, 4.0),
        (2, "strike", "anna", {}),
        (3, "hit", "anna", {"victim": "ball", "speed": 6.0}),
        (4, "done", "anna", {}),
        launch(5, "kick_ball", 0.9, 2.0),
        (6, "strike", "anna", {}),
        (7, "done", "anna", {}),
        launch(8, "jump_over", 0.8, 5.0),
        (9, "touched", "anna", {"thing": "hurdle", "part": "left_foot"}),
        (9, "passed", "anna", {"thing": "hurdle", "clearance": -0.013}),
    )
    assert list(found) == ["errands", "launches"]
    assert found["errands"].rows == {
        "anna": {
            "begun": 3, "done": 2, "blows": 2, "met": 1, "passed": 1, "touched": 1,
            "nearest m": -0.01,
        }
    }  # fmt: skip
    assert found["launches"].rows == {
        "jump_over": {"launched": 1, "level": 0.8, "lowest": 0.8, "apart deg": 5.0},
        "kick_ball": {"launched": 2, "level": 0.7, "lowest": 0.5, "apart deg": 3.0},
    }


def test_chases_and_check_points():
    found = told(
        ("red", "blue"),
        (25, "caught", "red", {"victim": "blue", "distance": 0.7}),
        (45, "caught", "red", {"victim": "blue", "distance": 0.7}),
        (10, "check point", "red", {"point": 0, "late_by": 0.0, "distance": 0.2}),
        (20, "missed", "red", {"point": 1, "due": 2.0, "by": 0.6}),
        (30, "check point", "red", {"point": 1, "late_by": 1.0, "distance": 0.4}),
        (40, "missed", "red", {"point": 2, "due": 4.0, "by": 3.0}),
    )
    assert found["chase"].rows["blue"] == {"caught": 0, "was caught": 2, "first at s": 2.5}
    assert found["check points"].rows == {
        "red": {
            "reached": 2, "in time": 1, "not reached": 1, "latest s": 1.0, "mean distance m": 0.3,
        }
    }  # fmt: skip
