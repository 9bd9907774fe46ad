"""Contacts and effective hits on motions whose truth is known by construction."""

from __future__ import annotations

import numpy as np
import pytest

from kumite import mocap as mocap_files
from kumite.annotate import find_contacts, find_strikes
from kumite.clip import Clip, concatenate
from kumite.errors import KumiteError
from kumite.rotation import from_axis_angle
from tests import toys


def lifted(frames: int = 60, start: int = 20, stop: int = 40, fps: float = 30.0) -> Clip:
    """Stands, but for the left leg, which is bent up between two frames."""
    c = toys.still(frames, fps=fps)
    wxyz = c.wxyz.copy()
    t = np.clip((np.arange(frames) - start) / 5, 0, 1) * np.clip(
        (stop - np.arange(frames)) / 5, 0, 1
    )
    wxyz[:, c.skeleton.joint("left_thigh")] = from_axis_angle([1, 0, 0], -1.2 * t)
    wxyz[:, c.skeleton.joint("left_shin")] = from_axis_angle([1, 0, 0], 1.6 * t)
    return Clip("lifted", c.skeleton, fps, c.root_position, wxyz)


def test_a_lifted_foot_is_off_the_ground_and_the_other_on_it():
    contacts = find_contacts(concatenate([lifted()]))
    left, right = contacts.on_ground.T
    assert right.all()
    assert left[:20].all() and left[45:].all() and not left[23:37].any()
    lift_off = contacts.lift_off(np.array([0, 60]))
    assert lift_off[:, 0].sum() == 1 and 18 <= np.argmax(lift_off[:, 0]) <= 23
    assert not lift_off[:, 1].any()


def test_contacts_do_not_depend_on_the_rate():
    slow = find_contacts(concatenate([lifted()])).on_ground
    fast = find_contacts(concatenate([lifted(120, 40, 80, 60.0)])).on_ground
    assert abs(slow.mean() - fast.mean()) < 0.03


def test_the_end_of_a_clip_is_no_lift_off():
    both = concatenate([toys.still(10, name="a"), lifted(60)])
    contacts = find_contacts(both)
    assert not contacts.lift_off(both.clip_start)[9].any()


def punch(speed: float, frames: int = 60, fps: float = 60.0, away: bool = False) -> Clip:
    """Stands while the whole body slides to its left at ``speed`` m/s for a third of the time: the
    left fist moves along its forearm, the right one against it."""
    c = toys.still(frames, fps=fps)
    v = np.zeros(frames)
    v[frames // 3 : 2 * frames // 3] = -speed if away else speed
    root = c.root_position.copy()
    root[:, 0] += np.cumsum(v) / fps
    return Clip("punch", c.skeleton, fps, root, c.wxyz)


def test_a_blow_is_a_fist_that_moves_along_its_forearm():
    strikes = find_strikes(concatenate([punch(4.0)]))
    assert list(strikes.limb) == [0]
    assert 20 <= strikes.frame[0] < 40
    # Central differences halve the speed of the first and the last frame.
    assert (strikes.start[0], strikes.stop[0]) == (20, 39)
    assert np.allclose(strikes.velocity[0], [4, 0, 0], atol=1e-9)
    assert np.allclose(strikes.speed[30, :2], [4, -4])
    # Shoulder, upper arm, forearm and fist lie in a line: 0.18 + 0.28 + 0.25 + 0.1 m to the left.
    assert np.allclose(strikes.tip[30, 0], [0.81, toys.HIP_HEIGHT + 0.6, 0])
    assert np.allclose(strikes.points, strikes.tip[strikes.effective])


def test_slow_and_backward_fists_are_no_blows():
    assert len(find_strikes(concatenate([punch(1.5)]))) == 0
    back = find_strikes(concatenate([punch(4.0, away=True)]))
    assert list(back.limb) == [1]  # the right fist now leads


def test_blows_end_at_clip_borders():
    two = [punch(4.0), punch(4.0)]
    cut = [
        Clip(f"c{i}", c.skeleton, c.fps, c.root_position[25:35], c.wxyz[25:35])
        for i, c in enumerate(two)
    ]
    strikes = find_strikes(concatenate(cut))
    assert list(strikes.start) == [0, 10] and list(strikes.stop) == [10, 20]


def test_thresholds_must_be_positive():
    clips = concatenate([toys.still(5)])
    with pytest.raises(KumiteError):
        find_strikes(clips, hand_speed=0)
    with pytest.raises(KumiteError):
        find_contacts(clips, height=-1)


@pytest.mark.slow
def test_real_takes_hold_the_blows_that_their_names_tell(mocap):
    clips = mocap_files.load(mocap / "boxer").clip_set()
    strikes = find_strikes(clips)
    owner = clips.clip_of_frame[strikes.frame]

    def count(name: str, limb: int) -> int:
        return int(((owner == clips.names.index(name)) & (strikes.limb == limb)).sum())

    # Counted by eye, not by the annotator: on a plot of how far each arm is stretched over time,
    # and for jab_left on rendered frames, ten a second, too (21 as well).
    for name, left, right in (
        ("jab_left", 21, 0),
        ("jab_right", 0, 21),
        ("straight_right", 0, 21),
        ("onetwo", 21, 21),
        ("uppercut_both", 10, 10),
        ("blocking", 0, 0),
        ("being_hit", 0, 0),
    ):
        assert abs(count(name, 0) - left) <= 1 and abs(count(name, 1) - right) <= 1, name
    assert not (strikes.limb >= 2).any()  # a boxer does not kick
