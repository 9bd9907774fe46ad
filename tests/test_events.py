"""Events: checked by their annotations, the same after a file, and read from older files."""

from __future__ import annotations

import json
import re
from dataclasses import MISSING, FrozenInstanceError, fields
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kumite.errors import KumiteError
from kumite.scene import events, load_recording
from kumite.scene.events import KINDS, Decision, Event, EventIndex, Hit, Strike, read_events
from kumite.scene.wording import SAYS, describe
from tests.telling import FULL, event, one_of_each


def test_every_kind_comes_back_from_a_file_as_it_was():
    told = one_of_each()
    assert {type(e) for e in told} == set(KINDS.values()) == set(SAYS)
    rows = json.loads(json.dumps([e.to_json() for e in told], allow_nan=False))
    assert [row[3] for row in rows] == list(FULL.values())  # all that was said, and no more
    back = read_events(rows)
    assert back == told and [e.to_json() for e in back] == rows
    assert all(describe(e) for e in told)


def test_every_class_says_what_it_is():
    names = {field.name for field in fields(Event)}
    for kind, made in KINDS.items():
        assert made.kind == kind and made.__doc__ and not made.__doc__.startswith(made.__name__)
        own = {field.name for field in fields(made)} - names
        assert set(made.renamed.values()) | set(made.lacking) | set(made.times) <= own
        assert not own & (set(made.renamed) | made.dropped)


def test_an_event_is_made_of_plain_values_and_is_not_changed():
    place = events.place(np.array([0.123456, 1.0, np.float32(0.5)]))
    given: dict[str, Any] = {
        "victim": "blue", "limb": "left_hand", "part": "head", "speed": np.float32(6.54321),
        "place": place, "time": 0.1, "blocked": np.bool_(True),
    }  # fmt: skip
    hit = Hit(int(np.int64(3)), "red", **given)
    assert hit.to_json() == [
        3, "hit", "red", {"victim": "blue", "limb": "left_hand", "part": "head", "speed": 6.5432,
                          "place": [0.1235, 1.0, 0.5], "time": 0.1, "blocked": True},
    ]  # fmt: skip
    assert type(hit.frame) is int and type(hit.speed) is float and hit.blocked is True
    with pytest.raises((FrozenInstanceError, AttributeError)):
        hit.speed = 1.0  # type: ignore[misc]
    with pytest.raises(KumiteError):
        Event(1, "red")


@pytest.mark.parametrize(
    ("kind", "data", "said"),
    [
        ("hit", {"speed": "fast"}, "event 'hit': speed: 'fast'; expected a number"),
        ("hit", {"place": [0, 1]}, "event 'hit': place is [2], expected [3]"),
        ("hit", {"limb": "tail"}, "event 'hit': limb: 'tail'; expected one of left_hand"),
        ("hit", {"blocked": 1}, "event 'hit': blocked: 1; expected true or false"),
        ("hit", {"colour": "blue"}, "unknown field of event 'hit' 'colour'"),
        ("avoidance", {"attack": 1}, "event 'avoidance': outcome is missing"),
        ("avoidance", {"attack": 1, "outcome": "lost"}, "outcome: 'lost'; expected one of found"),
        ("avoidance", {"attack": 1, "outcome": "found", "costs": "abc"}, "'avoidance': costs"),
        ("launch", {"level": np.nan}, "event 'launch': level: nan"),
        ("throw", {"attack": 1.5}, "event 'throw': attack: 1.5; expected a whole number"),
        ("throw", {"attack": True}, "event 'throw': attack: True; expected a whole number"),
        ("cue", {"style": 3}, "event 'cue': style: 3; expected text"),
        ("cue", {"wanted": "jab"}, "event 'cue': wanted: 'jab'; expected names"),
    ],
)
def test_an_event_says_what_its_kind_says(kind, data, said):
    with pytest.raises(KumiteError, match=re.escape(said)):
        event(3, kind, "red", data)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ([3, "hti", "red", {}], "unknown kind of event 'hti'; did you mean 'hit'"),
        ([3, 4, "red", {}], "event: 4; expected text"),
        ([3, "hit", "red", []], "event 'hit': data: a list; expected a Mapping"),
        ([-1, "done", "red", {"motion": "x"}], "event 'done': frame: -1; expected at least 0"),
        ([3, "done", 5, {"motion": "x"}], "event 'done': character: 5; expected text"),
    ],
)
def test_a_row_that_is_no_event_is_refused(row, said):
    with pytest.raises(KumiteError, match=re.escape(said)):
        read_events([row])


def test_files_of_before_are_read():
    """Rows as they were written before events had classes."""
    hit = {"victim": "ball", "limb": "right_foot", "part": "ball", "speed": 6.0,
           "place": [0, 0, 1], "time": 0.2}  # fmt: skip
    rows = [
        [0, "decision", "a", {"stretch": 3, "worth": 0.5}],  # of an attacker
        [0, "decision", "a", {"state": 1, "stretch": 3, "worth": 0.5, "considered": 9, "apart": 9,
                              "jump": True}],
        [0, "decision", "a", {"action": "jab", "stretch": 3, "comp": 1.0, "coop": 0.0, "nodes": 9,
                              "considered": 12, "pruned": 0.1, "jump": False}],
        [0, "decision", "b", {"stretch": 3, "jump": False, "frames": 12}],
        [1, "foreseen", "a", {"attack": 1, "limb": "left_hand", "blow": 4, "at": "b", "gap": 0.1,
                              "begins": 0.2}],
        [2, "avoidance", "b", {"attack": 1, "outcome": "early"}],
        [3, "avoided", "b", {"attack": 1}],
        [4, "throw", "b", {"attack": 2, "ball": "ball 1", "speed": 9.0, "place": [0, 1, 2]}],
        [5, "stale", "b", {"attack": 2, "dropped": 2}],
        [6, "missed", "b", {"attack": 2}],
        [7, "missed", "b", {"point": 1, "due": None, "by": 0.3}],
        [8, "run over", "b", {"by": "car", "speed": 9.0}],
        [9, "hit", "b", hit],
        [9, "avoided", "b", {"attack": 77}],  # what that was nobody says
    ]  # fmt: skip
    told = read_events(rows)
    assert [e.by for e in told if isinstance(e, Decision)] == ["policy", "policy", "tree", "avoid"]
    assert told[4] == events.Foreseen(
        1, "a", attack=1, limb="left_hand", blow=4, victim="b", gap=0.1, begins=0.2
    )
    assert [(e.ball, e.attacker) for e in told if isinstance(e, events.Attacked)] == [
        (None, "a"), (None, "a"), ("ball 1", None), ("ball 1", None), (None, None),
    ]  # fmt: skip
    assert told[8].to_json()[3] == {"attack": 2, "ball": "ball 1", "paths": 2}
    assert told[10] == events.CheckPointMissed(7, "b", point=1, due=None, distance=0.3)
    assert told[11] == events.RunOver(8, "b", vehicle="car", speed=9.0)
    assert isinstance(told[12], Hit) and told[12].blocked is False and told[12].blow is None
    assert [describe(e) for e in told if isinstance(e, events.Avoided)] == [
        "a's blow is avoided",
        "attack 77 is avoided",
    ]


def test_the_recording_that_is_shipped_is_read():
    """It was written before events had classes."""
    with resources.as_file(resources.files("kumite.studio") / "sparring.rec") as path:
        told = EventIndex(load_recording(path).events)
    assert {e.by for e in told.of(Decision)} == {"policy"}
    assert told.of(Hit) and told.of(Strike, told.of(Hit)[0].character)


def test_times_are_counted_from_where_a_recording_begins():
    later = [e.counted_from(0, 10.0) for e in one_of_each()]
    assert later == list(one_of_each())
    for kind, field, told, then in (
        ("hit", "time", 1.95, 0.95),
        ("foreseen", "begins", 2.5, 1.5),
        ("check point missed", "due", 2.0, 1.0),
        ("check point missed", "due", None, None),
    ):
        said = {field: told, "attack": 1} if kind == "foreseen" else {field: told}
        moved = event(20, kind, "red", said).counted_from(10, 10.0)
        assert (moved.frame, getattr(moved, field)) == (10, then)


def table() -> list[str]:
    """The kinds, as docs/events.md lists them."""
    out = ["| in files | class | what | fields |", "|---|---|---|---|"]
    common = {field.name for field in fields(Event)}
    for kind, made in KINDS.items():
        own = [f for f in fields(made) if f.name not in common]
        names = [f"`{f.name}`" if f.default is MISSING else f"[`{f.name}`]" for f in own]
        what = str(made.__doc__).split("\n")[0].rstrip(".")
        out.append(f"| {kind} | `{made.__name__}` | {what} | {', '.join(names)} |")
    return out


def test_the_docs_list_every_kind():
    text = (Path(__file__).parent.parent / "docs" / "events.md").read_text("utf-8")
    listed = text.split("<!-- made by tests/test_events.py -->\n")[1].split("<!-- end -->")[0]
    assert listed.strip().split("\n") == table()
