"""How like a person clips move: what a body can do, measured on any capture.

Joint angles within human limits, feet that stand still while they stand, parts that do not pass
through each other, balance; and how fast and how far fists and feet go, to be laid beside another
capture's. Speeds and accelerations are taken at 30 Hz, so that captures of any rate compare.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from kumite.annotate.contacts import Contacts, find_contacts
from kumite.annotate.strikes import find_strikes
from kumite.body import Body, lay_body
from kumite.brief import brief
from kumite.clip import LIMBS, SIDES, ClipSet, concatenate, forward_kinematics, tip_positions
from kumite.kernels.overlap import overlaps
from kumite.rotation import angle, conjugate, multiply, rotate

RATE = 30.0  # Hz at which speeds and accelerations are taken
SLOW = 0.1  # m/s of the centre of mass, below which a body stands rather than moves
SLOW_FOOT = 0.5  # m/s of either foot: a quick step is a movement too
UPRIGHT = 0.6  # m of the pelvis: below it hands, knees and trunk carry weight too
HALF_FOOT = 0.045  # m, half the width of a sole
ALLOWED_OVERLAP = 0.02  # m: flesh and gloves give
BLOW = 4.0  # m/s of a fist at the least, for its path to count as a blow's
REST = 1.0  # m/s of a fist, below which a blow has not begun or is over
SHUFFLE = 0.03  # m: shorter steps are not steps

LIMITS = {
    "elbow": (0.0, 150.0),
    "knee": (0.0, 160.0),
    "ankle": (-48.0, 65.0),
    "hip forward": (-38.0, 145.0),
    "hip aside": (-45.0, 65.0),
    "spine": (0.0, 80.0),
    "neck": (0.0, 85.0),
    "wrist": (0.0, 90.0),
}
"""Degrees a joint can be bent: Norkin & White, Measurement of Joint Motion, with some room for
quick movements; ankles under the body's weight bend further. Ankle: + toes down; hip: + thigh ahead
of the trunk and + away from the other."""


@brief
@dataclass(frozen=True)
class Likeness:
    """Measures of one set of clips. Percentiles are the 5th, 50th and 95th."""

    seconds: float
    skate: np.ndarray  # [3] m/s of the balls of planted feet
    joints: dict[str, tuple[float, float]]  # smallest and largest bend [deg]: see LIMITS
    overlap: float  # m, deepest of all
    overlap_frames: float  # share of frames with more than ALLOWED_OVERLAP
    overlap_worst: str  # which parts, where
    off_balance: float  # share of slow upright frames with the centre of mass outside the feet
    furthest_off: float  # m that it is outside at the most (95th percentile of those frames)
    blows: int
    fist_speed: np.ndarray  # [3] m/s, the peak of each blow
    fist_path: np.ndarray  # [3] m, from rest to rest
    blow_time: np.ndarray  # [3] s, from rest to rest
    step_length: np.ndarray  # [3] m
    step_time: np.ndarray  # [3] s in the air
    acceleration: dict[str, np.ndarray]  # m/s², 50th, 95th and 99.9th percentile

    def outside(self) -> list[str]:
        """Joints bent beyond human limits."""
        return [
            f"{joint} {low:.0f} to {high:.0f}°, expected {LIMITS[joint][0]:.0f} to "
            f"{LIMITS[joint][1]:.0f}°"
            for joint, (low, high) in self.joints.items()
            if low < LIMITS[joint][0] - 1 or high > LIMITS[joint][1] + 1
        ]

    def rows(self) -> list[tuple[str, str]]:
        """The measures as a table of labels and texts."""

        def three(values: np.ndarray, digits: int = 2) -> str:
            return " ".join(f"{v:.{digits}f}" for v in values)

        return [
            ("clips (s)", f"{self.seconds:.0f}"),
            ("planted feet skate (m/s)", three(self.skate, 3)),
            *((f"{j} bend (deg)", f"{a:.0f} to {b:.0f}") for j, (a, b) in self.joints.items()),
            ("deepest self-penetration (m)", f"{self.overlap:.3f}"),
            ("frames with more than 2 cm", f"{self.overlap_frames:.1%}"),
            ("slow frames out of balance", f"{self.off_balance:.1%}"),
            ("blows", str(self.blows)),
            ("fist, peak speed (m/s)", three(self.fist_speed, 1)),
            ("fist, path (m)", three(self.fist_path)),
            ("fist, time from rest to rest (s)", three(self.blow_time)),
            ("step length (m)", three(self.step_length)),
            ("step, time in the air (s)", three(self.step_time)),
            *(
                (f"{name} acceleration, 50th 95th 99.9th (m/s²)", three(values, 0))
                for name, values in self.acceleration.items()
            ),
        ]

    def to_json(self) -> dict[str, Any]:
        """The measures as plain values."""

        def plain(value: Any) -> Any:
            if isinstance(value, np.ndarray):
                return [round(float(v), 4) for v in value]
            if isinstance(value, dict):
                return {k: plain(v) for k, v in value.items()}
            if isinstance(value, tuple):
                return [round(float(v), 2) for v in value]
            return round(value, 4) if isinstance(value, float) else value

        return {k: plain(v) for k, v in vars(self).items()}


def measure_likeness(clips: ClipSet) -> Likeness:
    """Measures of clips [F] of one skeleton. Errors: roles that are missing."""
    contacts = find_contacts(clips)
    body = lay_body(clips.skeleton)
    start, end = body_ends(clips, body)
    depth, pairs = self_overlap(clips, body, start, end)
    worst = np.unravel_index(int(np.argmax(depth)), depth.shape)
    first, second = pairs[worst[1]]
    clip = int(clips.clip_of_frame[worst[0]])
    where = f"{first} in {second}, {clips.names[clip]} frame {worst[0] - clips.clip_start[clip]}"
    off = off_balance(clips, contacts, body, start, end)
    blows = _blows(clips)
    steps = _steps(clips, contacts)
    return Likeness(
        seconds=clips.seconds,
        skate=_three(_skate(clips, contacts)),
        joints=joint_bends(clips),
        overlap=float(depth.max()),
        overlap_frames=float((depth.max(axis=1) > ALLOWED_OVERLAP).mean()),
        overlap_worst=where,
        off_balance=float((off > 0.01).mean()) if len(off) else 0.0,
        furthest_off=float(np.percentile(off, 95)) if len(off) else 0.0,
        blows=len(blows),
        fist_speed=_three(blows[:, 0]),
        fist_path=_three(blows[:, 1]),
        blow_time=_three(blows[:, 2]),
        step_length=_three(steps[:, 0]),
        step_time=_three(steps[:, 1]),
        acceleration=_accelerations(clips),
    )


def _three(values: np.ndarray) -> np.ndarray:
    """The 5th, 50th and 95th percentile [3]; zeros of nothing."""
    return np.percentile(values, (5.0, 50.0, 95.0)) if len(values) else np.zeros(3)


def body_ends(clips: ClipSet, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """World ends [F, B, 3] of the body's capsules in every frame."""
    position, world = clips.world
    at, turned = position[:, body.joint], world[:, body.joint]
    return at + rotate(turned, body.start), at + rotate(turned, body.end)


def self_overlap(
    clips: ClipSet, body: Body, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, list[tuple[str, str]]]:
    """How deep [F, P] parts that are not neighbours are in each other [m], and which pairs."""
    pairs = [
        (a, b)
        for i, a in enumerate(body.parts)
        for b in body.parts[i + 1 :]
        if not _neighbours(a, b)
    ]
    first = np.array([body.part(a) for a, _ in pairs])
    second = np.array([body.part(b) for _, b in pairs])
    out = np.zeros((len(clips), len(pairs)))
    overlaps(start, end, body.radius_start, body.radius_end, first, second, out)
    return out, pairs


_CHAINS = (
    ("head", "neck", "chest", "waist", "pelvis"),
    *(("neck", "chest", f"{s}_upper_arm", f"{s}_forearm", f"{s}_hand") for s in SIDES),
    *(("waist", "pelvis", f"{s}_thigh", f"{s}_shin", f"{s}_foot") for s in SIDES),
)


def _neighbours(a: str, b: str) -> bool:
    """Parts that touch by nature: joined ones, those one joint further, and both thighs."""
    if {a, b} == {"left_thigh", "right_thigh"}:
        return True
    return any(a in c and b in c and abs(c.index(a) - c.index(b)) <= 2 for c in _CHAINS)


def off_balance(
    clips: ClipSet, contacts: Contacts, body: Body, start: np.ndarray, end: np.ndarray
) -> np.ndarray:
    """How far [m] the centre of mass is outside the planted soles, in every slow upright frame.

    Slow is the centre of mass and are both feet.
    """
    mass = body.mass / body.mass.sum()
    centre = np.einsum("fbc,b->fc", 0.5 * (start + end), mass)
    inside = np.ones(len(clips), dtype=bool)
    inside[clips.clip_start[:-1]] = inside[clips.clip_start[1:] - 1] = False
    speed = np.zeros(len(clips))
    speed[1:-1] = np.linalg.norm((centre[2:] - centre[:-2])[:, [0, 2]], axis=1) * clips.fps / 2
    high = clips.world[0][:, clips.skeleton.joint("pelvis"), 1] > UPRIGHT
    for part in (body.part(f"{side}_foot") for side in SIDES):
        step = np.zeros(len(clips))
        step[1:-1] = np.linalg.norm(end[2:, part] - end[:-2, part], axis=1) * clips.fps / 2
        inside &= step < SLOW_FOOT
    still = inside & (speed < SLOW) & high & contacts.on_ground.any(axis=1)
    # A hull's support function: how far it reaches in each of many directions.
    angles = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    ways = np.stack([np.sin(angles), np.cos(angles)])
    reach = np.full((int(still.sum()), len(angles)), -np.inf)
    for s, side in enumerate(SIDES):
        part = body.part(f"{side}_foot")
        planted = contacts.on_ground[still, s]
        for point in (start, end):
            along = point[still][:, part][:, [0, 2]] @ ways + HALF_FOOT
            reach = np.where(planted[:, None], np.maximum(reach, along), reach)
    outside = centre[still][:, [0, 2]] @ ways - reach
    return np.maximum(outside.max(axis=1, initial=-np.inf), 0.0)


def joint_bends(clips: ClipSet) -> dict[str, tuple[float, float]]:
    """The smallest and the largest bend [deg] of each kind of joint, left and right together."""
    position, world = clips.world
    at = {role: position[:, j] for role, j in clips.skeleton.roles.items()}
    turned = {role: world[:, j] for role, j in clips.skeleton.roles.items()}
    bends: dict[str, list[np.ndarray]] = {}
    left = np.array(clips.skeleton.lateral_axis)
    rest = clips.skeleton.rest_positions
    joint = clips.skeleton.joint
    spine = rest[joint("chest")] - rest[joint("pelvis")]
    spine = _unit((spine - left * float(spine @ left))[None])[0]
    aside, up = rotate(turned["pelvis"], left), rotate(turned["pelvis"], spine)
    ahead = np.cross(aside, up)
    for side, sign in zip(SIDES, (1.0, -1.0)):
        limb = {p: at[f"{side}_{p}"] for p in ("upper_arm", "forearm", "hand")}
        leg = {p: at[f"{side}_{p}"] for p in ("thigh", "shin", "foot")}
        bends.setdefault("elbow", []).append(_bend(*limb.values()))
        bends.setdefault("knee", []).append(_bend(*leg.values()))
        thigh = _unit(leg["shin"] - leg["thigh"])
        forward = np.arctan2(_dot(thigh, ahead), -_dot(thigh, up))
        forward = np.degrees(forward)
        bends.setdefault("hip forward", []).append(np.where(forward < -90, forward + 360, forward))
        out = np.arcsin(np.clip(sign * _dot(thigh, aside), -1, 1))
        bends.setdefault("hip aside", []).append(np.degrees(out))
        toe = clips.skeleton.roles.get(f"{side}_toe")
        if toe is not None:
            foot = _unit(position[:, toe] - leg["foot"])
            flat = _unit((rest[toe] - rest[joint(f"{side}_foot")])[None])[0]
            standing = np.degrees(np.arcsin(np.clip(flat[1], -1, 1)))  # of the foot's line, at rest
            shin = _unit(leg["foot"] - leg["shin"])
            down = np.degrees(np.arcsin(np.clip(_dot(foot, shin), -1, 1)))
            bends.setdefault("ankle", []).append(down + standing)
        # The forearm's own twist turns the hand too; a bend is what is left without it.
        bone = _unit(clips.skeleton.offsets[joint(f"{side}_hand")][None])[0]
        hand = rotate(turned[f"{side}_hand"], bone)
        bend = _dot(hand, rotate(turned[f"{side}_forearm"], bone))
        bends.setdefault("wrist", []).append(np.degrees(np.arccos(np.clip(bend, -1, 1))))
    bends["spine"] = [_between(turned, "pelvis", "chest")]
    bends["neck"] = [_between(turned, "chest", "head")]
    return {k: (float(np.min(v)), float(np.max(v))) for k, v in bends.items()}


def _between(turned: dict[str, np.ndarray], a: str, b: str) -> np.ndarray:
    """Degrees between two joints' axes, from their middle over the clips (rest poses differ)."""
    between = multiply(conjugate(turned[a]), turned[b])
    between = np.where(between[:, :1] < 0, -between, between)
    middle = between.mean(axis=0)
    return np.degrees(angle(between, middle / np.linalg.norm(middle)))


def _bend(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip(_dot(_unit(b - a), _unit(c - b)), -1, 1)))


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1)


def _skate(clips: ClipSet, contacts: Contacts) -> np.ndarray:
    """Speeds [m/s] of the balls of planted feet, along the ground."""
    out = []
    for s, side in enumerate(SIDES):
        role = f"{side}_toe" if f"{side}_toe" in clips.skeleton.roles else f"{side}_foot"
        ball = clips.world[0][:, clips.skeleton.joint(role)]
        step = np.linalg.norm(np.diff(ball[:, [0, 2]], axis=0), axis=1) * clips.fps
        both = contacts.on_ground[1:, s] & contacts.on_ground[:-1, s]
        both[clips.clip_start[1:-1] - 1] = False
        out.append(step[both])
    return np.concatenate(out)


def _blows(clips: ClipSet) -> np.ndarray:
    """Peak speed [m/s], path [m] and time [s] from rest to rest of each blow of a fist [X, 3]."""
    slow = concatenate(list(clips), min(RATE, clips.fps))
    strikes = find_strikes(slow)
    rows = []
    for k, limb in enumerate(LIMBS[:2]):
        tip = tip_positions(slow.skeleton, limb, *slow.world)
        for c in range(len(slow.names)):
            lo, hi = int(slow.clip_start[c]), int(slow.clip_start[c + 1])
            speed = np.linalg.norm(np.gradient(tip[lo:hi], axis=0), axis=1) * slow.fps
            mine = strikes.frame[(strikes.limb == k) & (strikes.frame >= lo) & (strikes.frame < hi)]
            for f in mine - lo:
                a = max(0, f - 4)
                peak = a + int(np.argmax(speed[a : f + 5]))
                if speed[peak] < BLOW:
                    continue
                resting = np.flatnonzero(speed < REST)
                before, after = resting[resting < peak], resting[resting > peak]
                i = int(before[-1]) if len(before) else 0
                j = int(after[0]) if len(after) else len(speed) - 1
                rows.append((speed[peak], speed[i : j + 1].sum() / slow.fps, (j - i) / slow.fps))
    return np.array(rows).reshape(-1, 3)


def _steps(clips: ClipSet, contacts: Contacts) -> np.ndarray:
    """Length [m] and time in the air [s] of each step [X, 2]."""
    rows = []
    for s, side in enumerate(SIDES):
        role = f"{side}_toe" if f"{side}_toe" in clips.skeleton.roles else f"{side}_foot"
        ball = clips.world[0][:, clips.skeleton.joint(role)]
        for a, b in zip(clips.clip_start[:-1], clips.clip_start[1:]):
            on = contacts.on_ground[a:b, s]
            lifts = np.flatnonzero(on[:-1] & ~on[1:])
            lands = np.flatnonzero(~on[:-1] & on[1:]) + 1
            for lift in lifts:
                later = lands[lands > lift]
                if len(later):
                    move = ball[a + later[0]] - ball[a + lift]
                    rows.append((np.hypot(move[0], move[2]), (later[0] - lift) / clips.fps))
    out = np.array(rows).reshape(-1, 2)
    return out[out[:, 0] > SHUFFLE]


def _accelerations(clips: ClipSet) -> dict[str, np.ndarray]:
    """50th, 95th and 99.9th percentiles of joints' accelerations [m/s²]."""
    slow = concatenate(list(clips), min(RATE, clips.fps))
    position = forward_kinematics(slow.skeleton, slow.root_position, slow.wxyz)[0]
    pace = np.linalg.norm(np.diff(position, 2, axis=0), axis=2) * slow.fps**2
    whole = slow.clip_of_frame[2:] == slow.clip_of_frame[:-2]
    out = {}
    for name in ("pelvis", "head", "hand", "foot"):
        roles = [name] if name in slow.skeleton.roles else [f"{s}_{name}" for s in SIDES]
        joints = [slow.skeleton.joint(r) for r in roles]
        out[name] = np.percentile(pace[whole][:, joints], (50.0, 95.0, 99.9))
    return out
