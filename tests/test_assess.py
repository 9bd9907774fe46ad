"""Joins that are bounded, and what a library is said to be worth."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kumite import mocap as mocap_files
from kumite.clip import Clip, concatenate, forward_kinematics
from kumite.errors import KumiteError
from kumite.graph import (
    JoinBound,
    JoinMeter,
    Layer,
    assess,
    build_actions,
    build_avoidance,
    build_frames,
    builtin_layer,
)
from kumite.graph.assess import SOON, ways_out_soon
from kumite.rotation import angle, from_axis_angle, multiply
from tests import toys


def joins_of(library: Layer) -> tuple[np.ndarray, np.ndarray]:
    """Source and target [X] of all joins of a table."""
    table = library.table
    source = table.state_frame[np.repeat(np.arange(table.states), np.diff(table.action_start))]
    target = table.first[table.stretch]
    joined = source != target - 1
    return source[joined], target[joined]


def test_jumps_are_those_of_the_poses():
    """A clip that is raised, turned in one elbow and pushed, against one that is not."""
    still = toys.still(10)
    root, wxyz = still.root_position.copy(), still.wxyz.copy()
    root[:, 1] += 0.2
    root[:, 0] += 0.5 * np.arange(10) / still.fps
    elbow = still.skeleton.joint("left_forearm")
    wxyz[:, elbow] = multiply(wxyz[:, elbow], from_axis_angle([0.0, 1.0, 0.0], 0.7))
    other = Clip("other", still.skeleton, still.fps, root, wxyz)
    meter = JoinMeter(concatenate([still, other]))
    jumps = meter.joins(np.array([4, 4]), np.array([16, 7]))
    assert np.allclose(jumps.height, [0.2, 0.0], atol=1e-9)
    assert np.allclose(jumps.angle, [0.7, 0.0], atol=1e-3)
    assert np.allclose(jumps.speed, [0.5, 0.0], atol=1e-9)
    assert len(meter.own()) == 18  # none from one clip into the next
    assert np.allclose(meter.own().angle, 0.0, atol=1e-3)


TIGHT = JoinBound(0.03, 0.4, 0.8)


@pytest.mark.parametrize(
    "build, bound",
    [
        (build_frames, JoinBound(0.01, 0.09, 0.15)),
        (build_actions, TIGHT),
        (build_avoidance, TIGHT),
    ],
)
def test_no_join_jumps_farther_than_the_bound(library: Layer, build, bound: JoinBound):
    """Measured by forward kinematics, apart from what measures it in the build."""
    clips = concatenate(list(library.clips)[:10])
    free = build(clips, bound=JoinBound(9.0, 9.0, 99.0))
    made = build(clips, bound=bound)
    source, target = joins_of(made)
    position = forward_kinematics(clips.skeleton, clips.root_position, clips.wxyz)[0]
    height = position[:, clips.skeleton.joint("pelvis"), 1]
    assert np.abs(height[source] - height[target - 1]).max() <= bound.height + 1e-6
    roles = [f"{side}_{part}" for side in ("left", "right") for part in ("forearm", "shin")]
    joints = [clips.skeleton.joint(role) for role in roles]
    turned = angle(clips.wxyz[source][:, joints], clips.wxyz[target - 1][:, joints])
    assert turned.max() <= bound.angle + 1e-3
    assert made.table.actions < free.table.actions
    assert made.report["joins_over_bound"] > 0 == free.report["joins_over_bound"]
    left = assess(made).left_out
    assert sum(left.values()) == pytest.approx(1.0 - assess(made).reached, abs=1e-9)
    ways = np.diff(made.table.action_start)
    assert ways.min() >= 1 and np.isin(made.table.target, np.arange(made.table.states)).all()


def test_a_bound_that_nothing_keeps_to_names_its_options(library: Layer):
    clips = concatenate(list(library.clips)[:3])
    with pytest.raises(KumiteError, match=r"--join-height.*--join-angle.*--join-speed"):
        build_frames(clips, bound=JoinBound(1e-9, 1e-9, 1e-9))
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(KumiteError, match="expected more than 0"):
            JoinBound(angle=wrong)


def test_a_good_library_loses_no_join(library: Layer, whole: Layer):
    for one in (library, whole):
        assert one.report["joins_over_bound"] == 0


def test_verdicts_follow_what_is_there(library: Layer, whole: Layer):
    found = assess(library)
    assert found.verdict("fight by policy").word == "will work"
    assert "--layer actions" in found.verdict("fight by tree").advice
    assert "--layer preparation" in found.verdict("prepare").advice
    assert assess(whole).verdict("fight by tree").word == "will work"
    own, joins = JoinMeter(library.clips).own(), joins_of(library)
    jumps = JoinMeter(library.clips).joins(*joins)
    assert found.joins.count == len(joins[0])
    assert found.joins.height.worst == pytest.approx(jumps.height.max())
    assert found.joins.speed.own_99 == pytest.approx(np.percentile(own.speed, 99))
    none = replace(library.strikes, **{
        name: getattr(library.strikes, name)[:0]
        for name in ("frame", "start", "stop", "limb", "velocity")
    })  # fmt: skip
    peaceful = assess(replace(library, strikes=none)).verdict("fight by policy")
    assert (peaceful.word, "no blow" in peaceful.why) == ("will not", True)


def test_build_ends_with_what_the_library_is_worth(run, tmp_path: Path):
    run("perform", "boxing", "-o", "takes")
    only = ("--layer", "frames", "--join-height", "0.1")
    status, out, _ = run("build", "takes/jab.bvh", "-o", "jab.kumite", *only)
    assert status == 0
    for word in ("frames in the graph", "fight by policy", "pelvis height", "was not built"):
        assert word in out, word
    status, out, _ = run("build", "takes/jab.bvh", "-o", "jab.kumite", "--json")
    told = json.loads(out)
    worth = told["layers"]["frames"]["worth"]
    assert worth["states"] > 1 and 0 < worth["reached"] <= 1
    assert {v["kind"] for v in told["scenes"]} == {
        "fight by policy", "fight by tree", "avoid", "prepare",
    }  # fmt: skip
    status, out, err = run("build", "takes/jab.bvh", "-o", "x.kumite", "--join-angle", "0")
    assert status == 2 and "angle 0" in err and not Path("x.kumite").exists()


def test_verdicts_on_people_are_those_of_the_scenes(boxer: Layer, mocap: Path):
    """What was seen: the boxer lands blows; of 80 balls he avoids 27, as few ways out are near;
    who runs and kicks now and then has blows, but throws none in 40 s of sparring."""
    assert assess(boxer).verdict("fight by policy").word == "will work"
    dodger = build_avoidance(boxer.clips)
    assert assess(dodger).verdict("avoid").word == "thin"
    runner = build_frames(mocap_files.load(mocap / "cmu" / "127").clip_set())
    found = assess(runner).verdict("fight by policy")
    assert found.word == "thin" and "from where one stands" in found.why


def test_ways_out_that_are_soon_equal_a_count_by_hand():
    dodgers = builtin_layer(None, style="avoidance", level="avoidance")
    table, fps = dodgers.table, dodgers.clips.fps
    begin, part = dodgers.parts_of_stretch
    total, time = 0.0, 0
    for state in range(table.states):
        ways = {
            int(p)
            for a in table.stretch[table.actions_of(state)]
            for p in part[begin[a] : begin[a + 1]]
            if dodgers.avoidance.centre[p] - table.first[a] + 1 <= SOON * fps
        }
        here = int(table.duration[table.target == state].sum())
        total, time = total + len(ways) * here, time + here
    assert ways_out_soon(dodgers) == pytest.approx(total / time)
    assert assess(dodgers).verdict("avoid").word == "will work"
