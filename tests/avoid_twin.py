"""Oshita & Masaoka's search, slow and in plain NumPy: what the kernels must come to.

Written from the paper's equations and from what the modules say of where ours differ; nothing of
``kumite.kernels`` is used, and nothing is skipped: every path, sphere and sample is looked at.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kumite.body import Spheres
from kumite.clip import SIDES
from kumite.control.attack import NEAR, Attack
from kumite.control.avoidance import END_EFFECTORS, AvoidanceRules, Standing
from kumite.graph import Layer
from kumite.synthesis.cast import JOIN_HALF_LIFE, LONGEST_FOOT_OFFSET, ROOT_HALF_LIFE

VALID, HIT, STIFF, TOO_FAST = "valid", "hit", "stiff", "too fast"


@dataclass(frozen=True)
class Edge:
    """Layer frames that are played, from the one before the first, and where they are."""

    enter: float  # phase at which it begins
    stop: int
    stretch: int
    anchor: np.ndarray  # [3]


@dataclass(frozen=True)
class Weighed:
    path: tuple[int, ...]
    part: int  # of the library's
    outcome: str
    e: float = np.inf
    costs: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    overlap: float = 0.0
    d: float = np.nan
    d0: float = np.nan
    s: float = 1.0


def turned(yaw: float) -> np.ndarray:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, s], [-s, c]])  # x, z


def placed(anchor: np.ndarray, facing: np.ndarray) -> np.ndarray:
    return np.array([*(anchor[:2] + turned(anchor[2]) @ facing[:2]), anchor[2] + facing[2]])


def anchored(here: np.ndarray, facing: np.ndarray) -> np.ndarray:
    """The anchor that puts a facing frame of the library here."""
    yaw = here[2] - facing[2]
    return np.array([*(here[:2] - turned(yaw) @ facing[:2]), yaw])


class Twin:
    def __init__(self, library: Layer, spheres: Spheres, rules: AvoidanceRules) -> None:
        self.library, self.rules = library, rules
        clips = library.clips
        position, world = clips.world
        self.centre = spheres.at(position, world).astype(np.float32).astype(float)  # [F, B, 3]
        self.radius = spheres.radius.astype(np.float32).astype(float)
        self.spheres, self.position, skeleton = spheres, position, clips.skeleton
        self.legs = [
            [skeleton.joint(f"{side}_{part}") for part in ("thigh", "shin", "foot")]
            for side in SIDES
        ]
        table, fps = library.table, clips.fps
        ends = [clips.skeleton.joint(role) for role in END_EFFECTORS]
        fastest = []
        for first, last in zip(table.first, table.last):
            way = np.diff(position[first - 1 : last + 1, ends], axis=0)
            fastest.append(np.linalg.norm(way, axis=2).max() * fps)
        v = np.array(fastest)
        self.slows = (v > rules.fast) | (v <= rules.still)
        self.quickens = ((v > rules.still) & (v < rules.slow)) | (v <= rules.still)

    # Candidates ----------------------------------------------------------------------------------

    def parts_in(self, stretch: int) -> list[int]:
        table, parts = self.library.table, self.library.avoidance
        return [
            p
            for p in range(len(parts))
            if parts.start[p] >= table.first[stretch] and parts.stop[p] - 1 <= table.last[stretch]
        ]

    def centre_of(self, part: int) -> float:
        parts = self.library.avoidance
        return 0.5 * (parts.start[part] + parts.stop[part] - 1)

    def candidates(
        self, standing: Standing, aim: float, earlier: int
    ) -> Iterator[tuple[tuple[int, ...], int, float]]:
        """Paths, their parts and the frames to the parts' middles (Eq. 1)."""
        fps, table = self.library.clips.fps, self.library.table
        low, high = ((aim + sign * 0.5 * self.rules.window) * fps for sign in (-1, 1))
        if standing.stretch >= 0:
            for p in self.parts_in(standing.stretch):
                middle = self.centre_of(p) - standing.phase
                if middle > 0 and low < middle < high:
                    yield (), p, middle

        def onward(state: int, path: tuple[int, ...], gone: float, earlier: int):
            for a in range(table.action_start[state], table.action_start[state + 1]):
                s = int(table.stretch[a])
                for p in self.parts_in(s):
                    middle = gone + self.centre_of(p) - (table.first[s] - 1)
                    if low < middle < high:
                        yield (*path, s), p, middle
                after = gone + table.last[s] - table.first[s] + 1
                left = earlier - bool(self.parts_in(s))
                if after < high and left >= 0:
                    yield from onward(int(table.target[s]), (*path, s), after, left)

        found = np.flatnonzero(table.state_frame == standing.stop)
        if len(found):
            yield from onward(int(found[0]), (), standing.stop - standing.phase, earlier)

    # Time ----------------------------------------------------------------------------------------

    def edges(self, standing: Standing, path: Sequence[int]) -> list[Edge]:
        facing, table = self.library.clips.facing, self.library.table
        anchor = np.asarray(standing.anchor, dtype=float)
        out = [Edge(standing.phase, standing.stop, standing.stretch, anchor)]
        for s in path:
            enter = int(table.first[s]) - 1
            anchor = anchored(placed(anchor, facing[out[-1].stop]), facing[enter])
            out.append(Edge(enter, int(table.last[s]), s, anchor))
        return out

    def timed(self, standing: Standing, edges: list[Edge], middle: float, aim: float):
        """s of Eq. 3, s as played, frames of the path [n] and when they show [n], or why not."""
        rules, fps = self.rules, self.library.clips.fps
        ramp, s0 = rules.ramp * fps, standing.slowness
        length = np.array([e.stop - e.enter for e in edges])
        upto = np.cumsum(length)
        left = np.clip(1.0 - np.linspace(0, middle, 20001) / ramp, 0.0, None)
        natural = middle + (s0 - 1.0) * np.trapezoid(left, np.linspace(0, middle, 20001))
        want = aim * fps
        may = np.zeros(len(edges), dtype=bool)
        scale = 1.0
        if abs(want - natural) >= 0.5:
            fits = self.slows if want > natural else self.quickens
            may = np.array([e.stretch >= 0 and bool(fits[e.stretch]) for e in edges])
            counted = np.minimum(upto, middle) - np.minimum(upto - length, middle)  # to the middle
            some = counted[may].sum()
            if some < 0.5:
                return STIFF
            scale = (want - (natural - some)) / some  # Eq. 3
        whole = [n for e, u in zip(edges, upto) for n in (u - np.arange(e.stop - e.enter)[::-1])]
        at = np.unique(np.concatenate([[0.0], np.round(whole, 9)]))
        weight = np.zeros(len(at))
        k = 0
        while k < len(edges):  # neighbours that may be adjusted are one stretch of time
            if not may[k]:
                k += 1
                continue
            low = upto[k] - length[k]
            while k + 1 < len(edges) and may[k + 1]:
                k += 1
            way = min(ramp, 0.5 * (upto[k] - low))
            inside = (at >= low - 1e-9) & (at <= upto[k] + 1e-9)
            up = np.minimum(at - low, upto[k] - at) / max(way, 1e-12)
            weight[inside] = np.clip(up, 0.0, 1.0)[inside]
            k += 1
        fades = np.clip(1.0 - at / ramp, 0.0, None)
        weight = np.minimum(weight, 1.0 - fades)

        def shown(s: float, x: np.ndarray) -> np.ndarray:
            slow = 1.0 + (s - 1.0) * weight + (s0 - 1.0) * fades
            nodes = np.union1d(at, x)
            slow = np.interp(nodes, at, slow)
            step = 0.5 * (slow[1:] + slow[:-1]) * np.diff(nodes)
            return np.interp(x, nodes, np.append(0.0, np.cumsum(step)))

        played = 1.0
        if scale != 1.0:
            m = np.array([middle])
            first, second = shown(1.0, m)[0], shown(2.0, m)[0]
            played = 1.0 + (want - first) / (second - first) if second - first > 1e-9 else 1.0
        return scale, played, upto, at, shown(played, at) / fps

    # What joins leave ---------------------------------------------------------------------------

    def tracked(self, frame: int) -> np.ndarray:
        """Root, left and right ankle [3, 3] at a library frame."""
        root = self.library.clips.root_position[frame]
        return np.array([root, *(self.position[frame, leg[2]] for leg in self.legs)])

    def steps(self, frame: int) -> np.ndarray:
        """How these move from the frame before in the clip, by the frame [3, 3]."""
        of = self.library.clips.clip_of_frame
        before = frame - 1 if frame > 0 and of[frame - 1] == of[frame] else frame
        return self.tracked(frame) - self.tracked(before)

    def offsets(self, standing: Standing, edges: list[Edge], upto, at, when) -> tuple:
        """Offsets [n, 3, 3] of root and ankles as each frame is come to, and as it is left."""
        fps, table = self.library.clips.fps, self.library.table
        half = np.array([ROOT_HALF_LIFE, JOIN_HALF_LIFE, JOIN_HALF_LIFE])
        rate = 2 * np.log(2) / half
        steps = np.diff(when)
        # The matrix exponential of a critically damped spring, [n - 1, 3, 2, 2].
        y, t = rate, steps[:, None]
        fades = np.array([[1 + y * t, t + 0 * y], [-y * y * t, 1 - y * t]]) * np.exp(-y * t)
        fades = np.moveaxis(fades, (0, 1), (2, 3))
        state = np.zeros((2, 3, 3)) if standing.left is None else np.array(standing.left)
        came, left, k = [], [], 0
        for i in range(len(at)):
            if i > 0:
                frame = edges[k].stop - round(upto[k] - at[i])
                new = np.einsum("pab,bpc->apc", fades[i - 1], state)
                for s in range(2):
                    short = np.hypot(*state[0, 1 + s, [0, 2]]) <= LONGEST_FOOT_OFFSET
                    if self.library.contacts.on_ground[frame, s] and short:
                        for axis in (0, 2):
                            new[:, 1 + s, axis] = state[0, 1 + s, axis], 0.0
                state = new
            came.append(state[0].copy())
            while k + 1 < len(edges) and upto[k] - at[i] < 1e-9:
                old, nxt = edges[k], edges[k + 1]
                source, target = old.stop, int(table.first[nxt.stretch]) - 1
                if source != target:
                    lasted = steps[i - 1] if i > 0 else standing.slowness / fps
                    lasts = steps[i] if i < len(steps) else lasted
                    place = [
                        _set(e.anchor, self.tracked(f)) for e, f in ((old, source), (nxt, target))
                    ]
                    speed = [
                        _set(np.array([0, 0, e.anchor[2]]), self.steps(f)) / t
                        for e, f, t in ((old, source, lasted), (nxt, target, lasts))
                    ]
                    state = state + np.array([place[0] - place[1], speed[0] - speed[1]])
                k += 1
            left.append(state[0].copy())
        return np.array(came), np.array(left)

    def shown(self, body, edges, phase, edge, x, at, offsets) -> np.ndarray:
        """Spheres [T, B, 3] of a captured body as they will be shown."""
        came, left = offsets
        i = np.maximum(1, np.searchsorted(at, x, side="left"))
        part = ((x - at[i - 1]) / (at[i] - at[i - 1]))[:, None, None]
        begin = np.where(part > 0, left[i - 1], came[i - 1])
        offset = begin + part * (came[i] - begin)
        stop, anchor = (
            np.array([getattr(edges[k], name) for k in edge]) for name in ("stop", "anchor")
        )
        row = np.minimum(phase.astype(int), stop)
        after = np.minimum(row + 1, stop)
        legs = self.position[:, self.legs]  # [F, 2, 3, 3]
        joints = legs[row] + (phase - row)[:, None, None, None] * (legs[after] - legs[row])
        joints = np.array([_set(a, j) for a, j in zip(anchor, joints)])
        root = offset[:, 0, None]
        moves = np.tile(root, (1, len(self.radius), 1))
        for s in range(2):
            h, k, a = np.moveaxis(joints[:, s], 1, 0)
            knee, ankle = _bent(h, k, a, h + root[:, 0], a + offset[:, 1 + s])
            ways = [root, (knee - k)[:, None], (ankle - a)[:, None], (ankle - a)[:, None]]
            for bone, joint in enumerate(self.legs[s]):
                some = np.flatnonzero(self.spheres.joint == joint)
                to = self.library.clips.skeleton.offsets[self.legs[s][min(bone + 1, 2)]]
                along = np.clip(self.spheres.centre[some] @ to / (to @ to), 0, 1)[:, None]
                moves[:, some] = ways[bone] + along * (ways[bone + 1] - ways[bone])
        return body + moves

    # Distances -----------------------------------------------------------------------------------

    def bodies(self, edges: list[Edge], upto: np.ndarray, x: np.ndarray):
        """Spheres [T, B, 3] after x [T] frames of a path, phases [T] and edges [T]."""
        edge = np.searchsorted(upto[:-1], x, side="left")
        phase = np.array(
            [edges[k].enter + v for k, v in zip(edge, x - (upto - _length(edges))[edge])]
        )
        return np.array([self.body(edges[k], f) for k, f in zip(edge, phase)]), phase, edge

    def body(self, edge: Edge, phase: float) -> np.ndarray:
        row = min(int(phase), edge.stop)
        after = min(row + 1, edge.stop)
        out = self.centre[row] + (phase - row) * (self.centre[after] - self.centre[row])
        out[:, [0, 2]] = edge.anchor[:2] + out[:, [0, 2]] @ turned(edge.anchor[2]).T
        return out

    def smallest(self, centre: np.ndarray, radius: np.ndarray, body: np.ndarray) -> float:
        """Smallest distance of spheres [T, I, 3] and a body [T, B, 3], all in straight lines."""
        apart = centre[:, :, None] - body[:, None]  # [T, I, B, 3]
        size = radius[:, None] + self.radius
        if len(apart) == 1:
            return float((np.linalg.norm(apart, axis=3) - size).min())
        s, u = apart[:-1], np.diff(apart, axis=0)
        along = -np.sum(s * u, axis=3) / (np.sum(u * u, axis=3) + 1e-18)
        near = s + np.clip(along, 0.0, 1.0)[..., None] * u
        first = np.linalg.norm(apart[0], axis=2) - size
        return float(min((np.linalg.norm(near, axis=3) - size).min(), first.min()))

    # All of it -----------------------------------------------------------------------------------

    def weigh(self, standing, path, part, middle, aim, given) -> Weighed:
        rules, parts = self.rules, self.library.avoidance
        edges = self.edges(standing, path)
        found = self.timed(standing, edges, middle, aim)
        if isinstance(found, str):
            return Weighed(path, part, found)
        scale, played, upto, at, when = found
        for s in (scale, played):
            if not 1.0 / rules.most <= s <= rules.most:
                return Weighed(path, part, TOO_FAST)
        d, d0, overlap = np.inf, np.inf, 0.0
        offsets = self.offsets(standing, edges, upto, at, when)
        for m, (t, lasts, centre, radius) in enumerate(given):
            some = t <= when[-1]
            if not some.any():
                continue
            t, lasts, centre = t[some], lasts[some], centre[some]
            x = np.interp(t, when, at)
            body, phase, edge = self.bodies(edges, upto, x)
            shown = body
            if rules.joins:
                shown = self.shown(body, edges, phase, edge, x, at, offsets)
            nearest = self.smallest(centre, radius, shown)
            if nearest < rules.clearance:
                return Weighed(path, part, HIT)
            if m > 0:
                continue
            d = nearest
            start, stop = int(parts.start[part]), int(parts.stop[part]) - 1
            still = self.body(edges[-1], start)
            size = radius[:, None] + self.radius
            was = np.linalg.norm(centre[:, :, None] - still, axis=3) - size  # [T, I, B]
            is_now = np.linalg.norm(centre[:, :, None] - body[:, None], axis=3) - size
            d0 = float(was.min())
            away = (edge == len(path)) & (start <= phase) & (phase <= stop)
            moved = np.linalg.norm(body - still, axis=2) >= rules.left
            counts = (was < 0) & (is_now >= 0) & moved[:, None] & away[:, None, None]
            depth = was - is_now  # Eq. 5
            overlap = float(np.sum(np.where(counts, -depth, 0.0) * lasts[:, None, None]))  # Eq. 4
        e_avoid = max(0.0, 1.0 - overlap / rules.enough)  # Eq. 6
        e_body = 1.0 if d <= d0 else min(1.0, (d - d0) / rules.far)  # Eq. 8
        e_time = max(scale, 1.0 / scale) / rules.most  # Eq. 9
        e = float(np.dot(rules.weights, (e_avoid, e_body, e_time)))  # Eq. 10
        costs = (e_avoid, e_body, e_time)
        return Weighed(path, part, VALID, e, costs, overlap, d, d0, played)

    def given(self, attacks: Sequence[Attack], now: float, place: np.ndarray):
        """Of attacks what is still to come, from when it is near to when it has gone by."""
        out = []
        for attack in attacks:
            t = attack.dense[0]
            t = np.concatenate([[now] if t[0] < now < t[-1] else [], t[t >= now]])
            centre = attack.at(t)
            off = np.linalg.norm(centre[..., [0, 2]] - place, axis=2) < NEAR + attack.radius
            near = np.flatnonzero(off.any(axis=1))
            if len(near):
                part = slice(near[0], near[-1] + 1)
                t, centre = t[part], centre[part]
                step = np.diff(t)
                lasts = 0.5 * (np.append(step, 0.0) + np.append(0.0, step))
                out.append((t - now, lasts, centre, attack.radius))
            else:
                out.append(None)
        return out

    def search(self, standing: Standing, attacks: Sequence[Attack], now: float):
        """(outcome, aim, everything that was weighed, the best first)."""
        rules, fps = self.rules, self.library.clips.fps
        if attacks[0].when[-1] <= now:
            return "too late", np.nan, []
        here = Edge(standing.phase, standing.stop, standing.stretch, np.asarray(standing.anchor))
        facing = self.library.clips.facing[int(standing.phase)]
        given = self.given(attacks, now, placed(here.anchor, facing)[:2])
        if given[0] is None:
            return "wide", np.nan, []
        t, _, centre, radius = given[0]
        gaps = []
        for when, c in zip(t, centre):
            x = min(when * fps / standing.slowness, here.stop - here.enter)
            body = self.body(here, here.enter + x)
            size = radius[:, None] + self.radius
            gaps.append((np.linalg.norm(c[:, None] - body, axis=2) - size).min())
        gaps = np.array(gaps)
        if t[0] <= 0 and gaps[0] < 0:
            return "too late", np.nan, []
        if gaps.min() > rules.wide:
            return "wide", np.nan, []
        by = np.flatnonzero(gaps <= max(gaps.min(), 0.0) + rules.wide)
        aim = 0.5 * float(t[by[0]] + t[by[-1]])
        if aim > rules.ahead:
            return "early", aim, []
        rest = [g for g in given if g is not None]
        weighed = []
        for earlier in (0, 1):
            weighed = [
                self.weigh(standing, path, part, middle, aim, rest)
                for path, part, middle in self.candidates(standing, aim, earlier)
            ]
            if any(w.outcome == VALID and w.overlap > 0.0 for w in weighed):
                break
        if not weighed:
            return "no candidate", aim, []
        order = sorted(
            range(len(weighed)),
            key=lambda c: (
                weighed[c].outcome != VALID,
                weighed[c].overlap <= 0.0,
                weighed[c].e,
                c,
            ),
        )
        weighed = [weighed[c] for c in order]
        return ("found" if weighed[0].outcome == VALID else "hit"), aim, weighed


def _set(anchor: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Layer points [..., 3] in the scene."""
    out = np.array(points, dtype=float)
    out[..., [0, 2]] = anchor[:2] + out[..., [0, 2]] @ turned(anchor[2]).T
    return out


def _bent(h, k, a, hip, goal) -> tuple[np.ndarray, np.ndarray]:
    """Knees and ankles [T, 3] of legs h, k, a that are taken to a hip and reach for a goal."""

    def norm(v):
        return np.linalg.norm(v, axis=1, keepdims=True)

    thigh, shin, was, far = norm(k - h), norm(a - k), norm(a - h), norm(goal - hip)
    longest = np.maximum(0.999 * (thigh + shin), was)
    want = np.clip(far, np.abs(thigh - shin) + 1e-4, longest)
    old, new = (a - h) / was, (goal - hip) / far
    axis, c = np.cross(old, new), np.sum(old * new, axis=1, keepdims=True)
    s = norm(axis)
    axis = axis / np.maximum(s, 1e-12)
    knee = k - h  # Rodrigues
    onto = np.sum(axis * knee, axis=1, keepdims=True)
    knee = knee * c + np.cross(axis, knee) * s + axis * onto * (1 - c)
    side = knee - np.sum(knee * new, axis=1, keepdims=True) * new
    side /= norm(side)
    angle = np.arccos(np.clip((thigh**2 + want**2 - shin**2) / (2 * thigh * want), -1, 1))
    return hip + thigh * (np.cos(angle) * new + np.sin(angle) * side), hip + want * new


def _length(edges: list[Edge]) -> np.ndarray:
    return np.array([e.stop - e.enter for e in edges])
