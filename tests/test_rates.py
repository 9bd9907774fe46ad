"""Characters played faster or slower: phases between frames, exact time, joins, feet."""

from __future__ import annotations

from pathlib import Path

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kumite import rotation
from kumite.errors import KumiteError
from kumite.graph import Layer
from kumite.kernels import character as kernels
from kumite.kernels import phase as phases
from kumite.scene import (
    World,
    load_recording,
    load_scene,
    measure,
    policy_fighter,
    record,
    with_count,
)
from kumite.scene.events import Decision
from kumite.scene.metrics import foot_skate, source_skate
from kumite.scene.recording import save_recording
from kumite.synthesis import Cast
from kumite.synthesis.cast import FASTEST, SLOWEST

rates = st.floats(SLOWEST, FASTEST)


@pytest.mark.jit_off
@settings(max_examples=60, deadline=None)
@given(st.lists(rates, min_size=1, max_size=40))
def test_phases_move_on_by_the_rate(many):
    frame, fraction = np.array([7]), np.array([0.0])
    rate, pace = np.zeros(1), np.zeros(1)
    for r in many:
        rate[0] = r
        phases.move_on(0, frame, fraction, rate, pace)
        assert 0.0 <= fraction[0] < 1.0 and pace[0] == r
    assert frame[0] + fraction[0] == pytest.approx(7 + sum(many), abs=1e-8)


@pytest.mark.jit_off
def test_phases_end_at_frames_whatever_the_sum():
    """Ten tenths are a frame, though their floating-point sum is less."""
    frame, fraction, rate, pace = np.array([0]), np.zeros(1), np.array([0.1]), np.zeros(1)
    for _ in range(10):
        phases.move_all(frame, fraction, rate, pace)
    assert (frame[0], fraction[0]) == (1, 0.0)
    clip = np.array([0, 0, 0, 1, 1])
    assert phases.earlier(clip, 2, 0.5, 1.0) == (1, 0.5)
    assert phases.earlier(clip, 2, 0.0, 1.75) == (0, 0.25)
    assert phases.earlier(clip, 4, 0.5, 4.0) == (3, 0.0)  # no farther than the clip goes
    assert phases.earlier(clip, 1, 0.0, 4.0) == (0, 0.0)
    assert [phases.following(clip, f) for f in range(5)] == [1, 2, 2, 4, 4]


@pytest.mark.jit_off
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 0.4), st.floats(0.0, 1.0), st.booleans())
def test_rotations_on_the_way_are_those_of_slerp(seed, angle, part, flipped):
    rng = np.random.default_rng(seed)
    axis = rng.normal(0, 1, 3)
    turn = rotation.exp(axis / np.linalg.norm(axis) * angle)
    a = rotation.exp(rng.normal(0, 2, 3))
    b = rotation.multiply(a, turn) * (-1.0 if flipped else 1.0)
    wxyz = np.array([[a], [b]])
    found = np.array(phases.part_way(wxyz, 0, 1, 0, part))
    assert np.linalg.norm(found) == pytest.approx(1.0, abs=1e-12)
    assert rotation.angle(found, rotation.slerp(a, b, np.array(part))) <= angle**3 / 62 + 1e-7


def _shown(frame, fraction, root, ankle, wxyz):
    """Place of root and ankles and rotations at a phase, by linear interpolation and slerp."""
    after = min(frame + 1, len(root) - 1)
    turned = rotation.slerp(wxyz[frame], wxyz[after], np.array(fraction))
    return [p[frame] + fraction * (p[after] - p[frame]) for p in (root, ankle)] + [turned]


@pytest.mark.jit_off
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("pace, rate", [(0.5, 0.5), (1.0, 2.0), (1.7, 1.6), (0.3, 1.0)])
def test_what_is_shown_goes_on_through_a_join_at_any_rate(seed, pace, rate):
    """As at the captured speed, from phase 3.4 to phase 9.7: velocities are those of scene time."""
    rng = np.random.default_rng(seed)
    fps, joints = 30.0, 3
    clip = np.repeat([0, 1], 6).astype(np.int32)
    facing = rng.normal(0, 1, (12, 3))
    root, ankle = (np.cumsum(rng.normal(0, 0.1, s), axis=0) for s in ((12, 3), (12, 2, 3)))
    wxyz = rotation.exp(np.cumsum(rng.normal(0, 0.05, (12, joints, 3)), axis=0))
    anchor = rng.normal(0, 1, 3)
    offset, spin = rng.normal(0, 0.3, (2, joints, 3))
    root_offset, root_velocity = rng.normal(0, 0.3, (2, 3))
    foot_offset, foot_velocity = rng.normal(0, 0.3, (2, 2, 3))

    def shown(frame: int, fraction: float, speed: float):
        back = frame + fraction - speed
        past = _shown(int(np.floor(back)), back - np.floor(back), root, ankle, wxyz)
        now = _shown(frame, fraction, root, ankle, wxyz)
        base = now[2].copy()
        base[0] = rotation.multiply(rotation.from_yaw(anchor[2]), base[0])
        turned = rotation.multiply(base, rotation.exp(offset))
        moved = rotation.log(rotation.multiply(rotation.conjugate(past[2]), now[2])) * fps
        before, here = ([rotation.planar_apply(anchor, p) for p in x[:2]] for x in (past, now))
        return (
            here[0] + root_offset,
            (here[0] - before[0]) * fps + root_velocity,
            here[1] + foot_offset,
            (here[1] - before[1]) * fps + foot_velocity,
            turned * np.sign(turned[:, :1]),
            moved + spin,
        )

    before = shown(3, 0.4, pace)
    state = (offset, spin, root_offset, root_velocity, foot_offset, foot_velocity, spin, spin)
    stood = rotation.planar_compose(anchor, facing[4])
    kernels.join_at(
        0,
        4,
        10,
        phases.Phase(3, 0.4, pace),
        phases.Phase(9, 0.7, rate),
        anchor[None],
        kernels.Capture(fps, root, wxyz, facing, ankle, np.ones((12, 2), bool), clip),
        kernels.Offsets(*(x[None] for x in state)),
    )
    # Rotations [1] and rad/s: of up to 3 rad/s, slerp's arcs against chords.
    for a, b, within in zip(before, shown(9, 0.7, rate), (*[1e-9] * 4, 1e-4, 5e-3)):
        assert np.allclose(a, b, atol=within)
    # The frames at which actions end and begin lie on each other, not the phases.
    assert np.allclose(stood[:2], rotation.planar_compose(anchor, facing[10])[:2])


def _walk(library: Layer, rate, frames: int, seed: int):
    """A cast of one that takes random actions; rate(i) at each shown frame."""
    cast, rng = Cast(library, 1), np.random.default_rng(seed)
    table = library.table
    cast.place(0, int(rng.integers(table.states)), np.array([2.0, 0.0, 3.0]))
    cast.show(0.0)
    position, contacts, joined = [cast.position[0].copy()], [cast.contacts[0]], [False]
    passed, steps = 0.0, 0.0  # library frames of actions that have ended; sum of rates
    begun, where = 0, 0.0
    for i in range(frames):
        cast.set_rate(0, rate(i))
        jump = False
        if len(cast.waiting):
            state = int(np.searchsorted(table.state_frame, cast.reached[0]))
            assert cast.reached[0] == cast.stop[0] == table.state_frame[state]
            a = table.actions_of(state)
            stretch = int(table.stretch[rng.integers(a.start, a.stop)])
            passed += cast.stop[0] - begun if i else 0
            cast.begin(np.array([0]), np.array([stretch]))
            begun, jump = int(table.first[stretch]) - 1, bool(cast.jump[0])
        cast.advance()
        steps += cast.rate[0]
        where = passed + cast.phase[0] - begun
        assert cast.phase[0] <= cast.stop[0]
        position.append(cast.position[0].copy())
        contacts.append(cast.contacts[0])
        joined.append(jump)
    return np.array(position), np.array(contacts), np.array(joined), where - steps


@pytest.mark.parametrize("seed", range(3))
def test_time_is_exact_over_any_chain_of_actions(library: Layer, seed: int):
    rng = np.random.default_rng(seed)
    drawn = np.exp(rng.uniform(np.log(SLOWEST), np.log(FASTEST), 1500))
    *_, joined, off = _walk(library, lambda i: drawn[i], len(drawn), seed)
    assert joined.sum() > 10
    assert abs(off) < 1e-6


def test_between_frames_a_pose_lies_between_theirs(library: Layer):
    """At half speed along captured frames: every other pose is one, the rest are between."""
    cast, clips = Cast(library, 1), library.clips
    table = library.table
    k = int(np.argmax(table.last - table.first))
    f, last = int(table.first[k]) - 1, int(table.last[k])
    cast.frame[0], cast.stop[0] = f, last
    cast.set_rate(0, 0.5)
    position, _ = clips.world
    for i in range(1, 2 * (last - f) + 1):
        assert len(cast.waiting) == 0
        cast.advance()
        g, part = f + i // 2, 0.5 * (i % 2)
        assert (cast.frame[0], cast.fraction[0]) == (g, part)
        after = min(g + 1, last)
        between = position[g] + part * (position[after] - position[g])
        assert np.allclose(cast.root_position[0], between[0], atol=1e-12)
        assert np.allclose(cast.position[0], between, atol=0.01)
        facing = cast.facing[0, :2]
        assert np.allclose(
            facing, (1 - part) * clips.facing[g, :2] + part * clips.facing[after, :2]
        )
        ground = library.contacts.on_ground
        assert np.array_equal(cast.contacts[0], ground[g] & ground[after if part else g])
    assert len(cast.waiting) == 1


@pytest.mark.parametrize("rate", [0.5, 2.0])
def test_joins_do_not_jump_and_feet_hold_at_any_rate(library: Layer, rate: float):
    """As much as at the captured speed: a foot of the capture moves ``rate`` times as fast, and
    from one shown frame to the next speeds change by the square of it."""
    fps, skeleton = library.clips.fps, library.clips.skeleton
    frames = 3000
    found = {}
    for r in (1.0, rate):
        position, contacts, joined, _ = _walk(library, lambda i, r=r: r, int(frames / r), 5)
        speed = np.linalg.norm(np.diff(position[:, 0], axis=0), axis=1) * fps
        change = np.abs(np.diff(speed))[joined[1:-1]]
        found[r] = foot_skate(skeleton, position, contacts, fps), np.median(change)
    assert found[rate][0] < 1.2 * rate * found[1.0][0] + 0.5 * rate * source_skate(library)
    assert found[rate][1] < 1.5 * max(rate, 1.0) ** 2 * found[1.0][1] + 0.01


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.5, 2.0])
def test_the_real_boxers_feet_hold_at_any_rate(boxer: Layer, rate: float):
    position, contacts, joined, _ = _walk(boxer, lambda i: rate, int(3600 / rate), 1)
    assert joined.sum() > 10
    skate = foot_skate(boxer.clips.skeleton, position, contacts, boxer.clips.fps)
    assert skate < 1.5 * rate * source_skate(boxer)


def test_speed_is_continuous_while_the_rate_changes_smoothly(library: Layer):
    """Along one action: what the pose moves by is the rate times the capture's own speed."""
    table, fps = library.table, library.clips.fps
    k = int(np.argmax(table.last - table.first))
    f, last = int(table.first[k]) - 1, int(table.last[k])
    cast = Cast(library, 1)
    cast.frame[0], cast.stop[0] = f, last
    cast.show(0.0)
    root = library.clips.root_position
    own = np.linalg.norm(np.diff(root[f : last + 1], axis=0), axis=1) * fps
    bend = np.abs(np.diff(root[f : last + 1], 2, axis=0)).sum(axis=1).max() * fps
    speeds, asked, before = [], [], cast.root_position[0].copy()
    for i in range(1000):
        cast.set_rate(0, 1.0 + 0.6 * np.sin(0.08 * i))
        if len(cast.waiting):
            break
        cast.advance()
        asked.append(cast.rate[0])
        speeds.append(np.linalg.norm(cast.root_position[0] - before) * fps)
        before = cast.root_position[0].copy()
    assert len(speeds) > 20
    steps = np.abs(np.diff(speeds))
    assert steps.max() <= np.abs(np.diff(asked)).max() * own.max() + 1.6 * 1.6 * bend + 1e-9


def test_who_stays_at_an_end_comes_to_it_and_stays(library: Layer):
    cast = Cast(library, 1)
    cast.place(0, 2, np.zeros(3))
    first = library.table.stretch[library.table.actions_of(2)][0]
    cast.begin(np.array([0]), np.array([first]))
    cast.set_rate(0, 0.7)
    while not len(cast.waiting):
        cast.advance()
    assert cast.stop[0] - 0.7 < cast.phase[0] <= cast.stop[0]
    for _ in range(3):
        cast.wait(0)
        cast.advance()
        assert (cast.frame[0], cast.fraction[0]) == (cast.stop[0], 0.0)
        assert len(cast.waiting) == 1


def test_what_is_foreseen_is_what_is_shown_at_any_rate(library: Layer):
    cast, alone = Cast(library, 2), Cast(library, 1)
    for k in range(2):
        cast.place(k, 4, np.array([k, 0.0, 1.0]))
    stretch = np.full(2, library.table.stretch[library.table.actions_of(4)][-1])
    cast.begin(np.arange(2), stretch)
    cast.set_rate(np.arange(2), np.array([0.6, 1.3]))
    cast.advance()
    alone.fraction[0] = 0.9
    roots, turns = cast.foresee(1, 10, alone)
    for root, turn in zip(roots, turns):
        cast.advance()
        assert np.array_equal(cast.root_position[1], root) and np.array_equal(cast.wxyz[1], turn)
    cast.place(1, 4, np.zeros(3))
    assert cast.phase[1] == cast.stop[1] and cast.rate[1] == 1.0


@pytest.mark.parametrize("rate", [0.0, -1.0, 0.2, 4.1, np.nan, np.inf])
def test_rates_out_of_bounds_are_refused(library: Layer, rate: float):
    cast = Cast(library, 3)
    with pytest.raises(KumiteError, match=r"cast: rate .*, expected 0.25 to 4"):
        cast.set_rate(np.array([0, 2]), np.array([1.0, rate]))
    assert np.all(cast.rate == 1.0)


def _uneven(library: Layer, count: int) -> World:
    scene = World(with_count(load_scene("crowd"), count), library, seed=3)
    scene.cast.set_rate(np.arange(count), np.linspace(0.5, 2.0, count))
    return scene


def test_a_crowd_of_many_rates_is_the_same_on_all_cores(
    library: Layer, monkeypatch: pytest.MonkeyPatch
):
    """And each has moved on by its rate, through all the actions that it took."""
    frames, cores = [], numba.get_num_threads()
    for many, threads in ((10**6, cores), (2, cores), (2, 1)):
        monkeypatch.setattr(policy_fighter, "MANY", many)
        numba.set_num_threads(threads)
        scene = _uneven(library, 20)
        for _ in range(120):
            scene.step()
            assert np.all(scene.cast.phase <= scene.cast.stop)
        frames.append((scene.cast.phase, scene.wxyz.copy()))
    numba.set_num_threads(cores)
    for phase, wxyz in frames[1:]:
        assert phase.tobytes() == frames[0][0].tobytes()
        assert wxyz.tobytes() == frames[0][1].tobytes()
    who = [e.character for e in scene.events if isinstance(e, Decision)]
    taken = [who.count(name) for name in scene.names]
    assert sum(taken[10:]) > 1.3 * sum(taken[:10])


def test_a_recording_keeps_the_rates(library: Layer, tmp_path: Path):
    """So that a frame shown twice, or passed over, is no join."""
    fight = record(_uneven(library, 6), 5.0)
    path = tmp_path / "uneven.rec"
    save_recording(path, fight)
    again = load_recording(path)
    assert fight.rate is not None and again.rate is not None
    assert np.array_equal(again.rate, fight.rate)
    assert fight.only(fight.names[1]).rate is not None
    decided = [e for e in fight.events if isinstance(e, Decision) and e.jump]
    found = measure(fight).characters
    assert sum(c.joins for c in found) == pytest.approx(len(decided), abs=6)
    assert record(World(with_count(load_scene("crowd"), 6), library), 1.0).rate is None
