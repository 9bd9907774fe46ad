"""Actions on the stage and in the studio: what is shown is what the text says."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from kumite.annotate import DIRECTIONS, KINDS, NO_LIMB
from kumite.body.palette import main_colours
from kumite.clip import LIMBS, facing_frame, forward_kinematics
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.scene import ActionPlayback, action_recording
from kumite.studio import Studio
from kumite.studio.action_list import Filter, action_html
from tests import browser
from tests.browser import viewer_of
from tests.stranger import wait


def test_an_action_is_the_capture_from_the_origin(whole: Layer):
    actions, clips = whole.actions, whole.clips
    assert actions is not None
    for k in range(0, len(actions), 31):
        a, b = int(actions.start[k]), int(actions.stop[k])
        one = action_recording(whole, k)
        assert np.array_equal(one.library_frame[:, 0], np.arange(a, b))
        root, wxyz = (x[:, 0].astype(np.float64) for x in (one.root_position, one.wxyz))
        facing = facing_frame(clips.skeleton, root, wxyz)
        assert np.abs(facing[0]).max() < 1e-5
        # The same motion, only moved and turned: all distances between joints and times stay.
        ours, _ = forward_kinematics(clips.skeleton, root, wxyz)
        theirs = clips.world[0][a:b]
        gaps = [np.linalg.norm(x - x[:1, ::-1], axis=-1) for x in (ours, theirs)]
        assert np.abs(gaps[0] - gaps[1]).max() < 1e-5
        assert np.abs(ours[..., 1] - theirs[..., 1]).max() < 1e-6
        blows = whole.strikes.frame[(whole.strikes.frame >= a) & (whole.strikes.frame < b)]
        assert [e.frame for e in one.events] == (blows - a).tolist()


def test_it_plays_over_and_over(whole: Layer):
    stage = ActionPlayback(whole, 3)
    count = len(stage.recording)
    seen = []
    for _ in range(2 * count):
        seen.append(stage.frame)
        assert stage.step()
    assert seen == [*range(count)] * 2
    stage.choose(5)
    assert stage.frame == 0 and stage.action == 5
    assert whole.actions is not None
    assert len(stage.recording) == whole.actions.stop[5] - whole.actions.start[5]


def test_only_actions_of_an_action_level_library(whole: Layer, library: Layer):
    with pytest.raises(KumiteError, match="--layer actions"):
        ActionPlayback(library)
    with pytest.raises(KumiteError, match=r"action 9999; expected 0 to \d+"):
        ActionPlayback(whole).choose(9999)


def test_every_action_is_listed_once_by_clip_and_by_kind(whole: Layer):
    stage = ActionPlayback(whole)
    listed = Filter(stage)
    everything = list(range(len(stage.actions)))
    by_clip = []
    for clip, name in zip(listed.clips, listed.clip_names):
        listed.set_clip(clip)
        assert name.endswith(f" ({len(listed.actions)})")
        assert len(set(listed.action_names)) == len(listed.actions)  # a dropdown needs that
        by_kind = []
        for kind, said in zip(listed.kinds, listed.kind_names):
            listed.kind = kind
            assert listed.actions and said.endswith(f" ({len(listed.actions)})")
            by_kind += [] if kind is None else listed.actions
        listed.kind = None
        assert sorted(by_kind) == listed.actions
        by_clip += [] if clip is None else listed.actions
    assert by_clip == everything == listed.actions  # the last: all clips
    assert listed.beside(everything[-1], 1) == 0 and listed.beside(0, -1) == everything[-1]


def test_a_kind_that_a_clip_has_not_is_all_kinds(whole: Layer):
    listed = Filter(ActionPlayback(whole))
    kinds = {c: (listed.set_clip(c), set(listed.kinds))[1] for c in listed.clips}
    with_reactions = next(c for c, k in kinds.items() if KINDS.index("reaction") in k)
    without = next(c for c, k in kinds.items() if KINDS.index("reaction") not in k)
    listed.set_clip(with_reactions)
    listed.kind = KINDS.index("reaction")
    listed.set_clip(without)
    assert listed.kind is None and listed.actions


def test_the_text_says_what_an_action_is(whole: Layer):
    actions = whole.actions
    assert actions is not None
    odd = replace(actions, label=("<b>mine</b>", *actions.label[1:]))
    stage = ActionPlayback(replace(whole, actions=odd))
    assert "&lt;b&gt;mine&lt;/b&gt;" in action_html(stage)  # a person's word is no markup
    attack = int(np.flatnonzero(actions.kind == KINDS.index("attack"))[0])
    stage.choose(attack)
    text = action_html(stage)
    assert actions.label[attack] in text and "attack" in text
    assert LIMBS[actions.limb[attack]].replace("_", " ") in text
    assert DIRECTIONS[actions.direction[attack]] in text
    ways = np.diff(whole.table.action_start)
    state = np.searchsorted(whole.table.state_frame, actions.stop[attack] - 1)
    assert f"{ways[state]} actions may follow" in text


def _text(page) -> str:
    return page.locator("body").inner_text()


def _pick(page, name: str, option: str) -> None:
    """Choose an option of a dropdown, as a person does: click it, type, click what is found."""
    box = page.get_by_label(name, exact=True).first
    box.click()
    box.fill(option)
    page.get_by_role("option", name=option, exact=True).click()


@pytest.mark.slow
def test_a_click_plays_an_action(whole: Layer):
    stage = ActionPlayback(whole)
    actions = stage.actions
    listed = Filter(stage)
    attack = KINDS.index("attack")
    clip = next(
        c
        for c in np.unique(actions.clip).tolist()
        if np.sum((actions.clip == c) & (actions.kind == attack)) >= 3
    )
    mine = np.flatnonzero((actions.clip == clip) & (actions.kind == attack)).tolist()
    studio = Studio(stage, port=0)
    with browser.watching(studio) as (page, client):

        def plays(k: int) -> None:
            """Action k is played, and the page says so and shows a frame of it."""
            assert wait(lambda: stage.action == k), (stage.action, k)
            begin = int(actions.clip_start[actions.clip[k]])
            inside = range(int(actions.start[k]) - begin, int(actions.stop[k]) - begin)

            def said() -> bool:
                text = _text(page)
                frame = re.search(r"frame (\d+) of its clip", text)
                limb = actions.limb[k]
                words = [actions.label[k], KINDS[actions.kind[k]]]
                words += [] if limb == NO_LIMB else [LIMBS[limb].replace("_", " ")]
                words.append(f"frames {inside.start}–{inside.stop - 1}")
                words.append(f"{k + 1} of {len(actions)}")
                return (
                    frame is not None and int(frame[1]) in inside and all(w in text for w in words)
                )

            browser.wait_until(page, said, f"the text of action {k}", 20)
            assert stage.clip_frame in inside

        plays(0)
        listed.set_clip(clip)
        _pick(page, "Clip", listed.clip_names[listed.clips.index(clip)])
        assert wait(lambda: stage.actions.clip[stage.action] == clip)
        _pick(page, "Kind", listed.kind_names[listed.kinds.index(attack)])
        listed.kind = attack
        plays(mine[0])
        _pick(page, "Action", listed.action_name(mine[1]))
        plays(mine[1])
        page.get_by_role("button", name="Next").click()
        plays(mine[2])
        page.get_by_role("button", name="Previous").click()
        plays(mine[1])
        page.mouse.click(60, 300)  # keys are words while a box is being typed in
        page.keyboard.press("f")
        plays(mine[2])

        # The scrubber: at its end stands the action's last frame, and the body where it is then.
        studio.toggle()
        studio.seek(10**6)
        last = int(actions.stop[mine[2]] - 1 - actions.clip_start[clip])
        browser.wait_until(page, lambda: f"frame {last} of its clip" in _text(page), "the end")
        slider = page.get_by_role("slider").nth(1)
        shown = float(slider.get_attribute("aria-valuenow") or "nan")
        assert shown == pytest.approx((len(stage.recording) - 1) / stage.fps, abs=1e-2)
        page.wait_for_timeout(1500)
        chest, _ = forward_kinematics(stage.skeleton, stage.root_position, stage.wxyz)
        place = viewer_of(studio).seen_at(chest[0, stage.skeleton.joint("chest")])
        patch = browser.around(
            browser.picture(page), browser.project(place, client.camera, page), 25
        ).astype(int)
        (shirt,) = main_colours(stage.names)
        strong, weak = int(np.argmax(shirt)), int(np.argmin(shirt))
        assert ((patch[..., strong] - patch[..., weak]) > 40).mean() > 0.3
