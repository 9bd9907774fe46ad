"""How like a person clips move: each measure against a case worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from kumite.annotate import find_contacts, measure_likeness
from kumite.annotate.likeness import body_ends, joint_bends, off_balance, self_overlap
from kumite.body import lay_body
from kumite.clip import Clip, ClipSet, concatenate
from kumite.kernels.overlap import SAMPLES, overlaps
from kumite.performer import LOCOMOTION, as_written, perform_take, skeleton
from kumite.rotation import from_axis_angle


def _standing(frames: int = 30) -> Clip:
    stand = [as_written(LOCOMOTION.find("stand"))]
    clip, _ = perform_take("stand", stand, LOCOMOTION, rng=np.random.default_rng(0))
    root = np.repeat(clip.root_position[:1], frames, axis=0)
    return Clip("stand", skeleton(), 60.0, root, np.repeat(clip.wxyz[:1], frames, axis=0))


def _turned(clip: Clip, joint: str, axis: tuple[float, float, float], degrees: float) -> ClipSet:
    """The clip with one joint turned to an angle about its own axis."""
    wxyz = clip.wxyz.copy()
    wxyz[:, clip.skeleton.names.index(joint)] = from_axis_angle(np.array(axis), np.radians(degrees))
    return concatenate([Clip(clip.name, clip.skeleton, clip.fps, clip.root_position, wxyz)])


def test_overlaps_equal_a_slow_twin():
    rng = np.random.default_rng(1)
    start, end = rng.normal(0, 0.3, (20, 5, 3)), rng.normal(0, 0.3, (20, 5, 3))
    r0, r1 = rng.uniform(0.03, 0.1, 5), rng.uniform(0.03, 0.1, 5)
    first, second = np.array([0, 1, 3]), np.array([2, 4, 0])
    out = np.zeros((20, 3))
    overlaps(start, end, r0, r1, first, second, out)

    def inside(f: int, i: int, j: int) -> float:
        deepest = 0.0
        for t in np.linspace(0, 1, SAMPLES):
            p = start[f, i] + t * (end[f, i] - start[f, i])
            axis = end[f, j] - start[f, j]
            u = np.clip((p - start[f, j]) @ axis / (axis @ axis), 0, 1)
            gap = np.linalg.norm(p - start[f, j] - u * axis) - (r0[j] + u * (r1[j] - r0[j]))
            deepest = max(deepest, r0[i] + t * (r1[i] - r0[i]) - gap)
        return deepest

    slow = [
        [max(inside(f, i, j), inside(f, j, i)) for i, j in zip(first, second)] for f in range(20)
    ]
    assert np.allclose(out, slow)
    assert out.max() > 0.05 and (out == 0).any()


def test_bends_are_those_that_were_bent():
    clip = _standing()
    knee = joint_bends(_turned(clip, "LeftLeg", (1, 0, 0), 70))["knee"]
    assert knee[1] == pytest.approx(70, abs=0.1)
    elbow = joint_bends(_turned(clip, "RightForeArm", (0, 1, 0), 100))["elbow"]
    assert elbow[1] == pytest.approx(100, abs=0.1)
    hip = joint_bends(_turned(clip, "LeftUpLeg", (1, 0, 0), -60))["hip forward"]
    assert hip[1] == pytest.approx(60, abs=3)  # the spine rests 2 degrees off the plumb line
    wide = joint_bends(_turned(clip, "LeftUpLeg", (0, 0, 1), 40))["hip aside"]
    assert wide[1] == pytest.approx(40, abs=2)
    wrist = joint_bends(_turned(clip, "RightHand", (0, 0, 1), 50))["wrist"]
    assert wrist[1] == pytest.approx(50, abs=0.1)
    # Twist of the hand about the forearm is not a bend of the wrist.
    assert joint_bends(_turned(clip, "RightHand", (1, 0, 0), 50))["wrist"][1] < 0.1


def test_a_knee_bent_too_far_is_said():
    found = measure_likeness(_turned(_standing(), "LeftLeg", (1, 0, 0), 175))
    assert any(line.startswith("knee") and "expected 0 to 160" in line for line in found.outside())


def test_a_hand_in_the_head_is_found():
    clip = _standing()
    body = lay_body(clip.skeleton)
    clips = concatenate([clip])
    start, end = body_ends(clips, body)
    head, hand = body.part("head"), body.part("left_hand")
    start[:, hand] = end[:, hand] = 0.5 * (start[:, head] + end[:, head])
    depth, pairs = self_overlap(clips, body, start, end)
    worst = pairs[int(np.argmax(depth[0]))]
    assert worst == ("head", "left_hand")
    wanted = body.radius_end[hand] + 0.5 * (body.radius_start[head] + body.radius_end[head])
    assert depth[0].max() == pytest.approx(wanted, abs=1e-3)


def test_leaning_out_over_the_feet_is_out_of_balance():
    clips = concatenate([_standing()])
    body, contacts = lay_body(clips.skeleton), find_contacts(clips)
    start, end = body_ends(clips, body)
    assert off_balance(clips, contacts, body, start, end).max() == 0.0
    # The whole body but its feet, half a metre ahead: so far out, less what the feet reach.
    feet = [body.part(f"{side}_foot") for side in ("left", "right")]
    moved = np.setdiff1d(np.arange(len(body)), feet)
    toes = start[0, feet, 2].max(initial=end[0, feet, 2].max()) + 0.045
    for ends in (start, end):
        ends[:, moved, 2] += 0.5
    mass = body.mass / body.mass.sum()
    centre = float((0.5 * (start[0] + end[0])[:, 2]) @ mass)
    outside = off_balance(clips, contacts, body, start, end)
    assert outside.max() == pytest.approx(centre - toes, abs=0.01)


def test_a_body_carried_to_and_fro_strikes_nothing_and_accelerates_so():
    """1.5 m out to the side and back in a second, as a raised cosine: 0.75 m * (2 pi)^2."""
    clip = _standing(180)
    t = np.arange(180) / 60.0
    swing = np.where((t > 1) & (t < 2), 0.5 - 0.5 * np.cos(2 * np.pi * (t - 1)), 0.0)
    root = clip.root_position + 1.5 * swing[:, None] * np.array([1.0, 0.0, 0.0])
    found = measure_likeness(concatenate([Clip("out", clip.skeleton, 60.0, root, clip.wxyz)]))
    assert found.blows == 0
    assert found.acceleration["pelvis"][2] == pytest.approx(0.75 * (2 * np.pi) ** 2, rel=0.05)


def test_rows_and_json_say_the_same():
    found = measure_likeness(concatenate([_standing()]))
    assert found.to_json()["seconds"] == pytest.approx(0.5)
    assert ("clips (s)", "0") in found.rows() or ("clips (s)", "1") in found.rows()
    assert found.outside() == []
