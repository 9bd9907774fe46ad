"""What mocap files do not say: the length unit, the axis that is up, the height of the floor.

Each is read off the body. Bones have a person's size in one known unit only; heads are above feet;
feet come down to the floor. Clips of one skeleton in one folder are one session with one scale,
one up axis and one floor, so that a clip that crawls or jumps does not settle these alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from kumite import rotation
from kumite.clip import SIDES, Skeleton, forward_kinematics
from kumite.errors import KumiteError
from kumite.mocap.raw import RawMotion, to_y_up

METRES_PER_UNIT = {
    "metres": 1.0,
    "centimetres": 0.01,
    "inches": 0.0254,
    "millimetres": 0.001,
    "CMU's 0.45-inch units": 0.0254 / 0.45,
}
USUAL_LEG = 0.86  # m, hip to ankle along the bones; adults have 0.75 to 1.0
LEG_RANGE = (0.5, 1.15)  # m; a child of five, and nearly the longest legs there are
USUAL_RANGE = (0.70, 1.05)  # m; adults: where two units fit, the one that gives these
STATED_RANGE = (0.4, 1.3)  # m; what a header may say of a performer
TOE_HEIGHT = 0.03  # m; a toe or foot tip of a body model when its sole is on the floor
ANKLE_HEIGHT = 0.08  # m; for skeletons that end at the ankle
NEAR_FLOOR = 0.08  # m; feet that come down this near to where they should keep the file's own floor
_LOW = 5.0  # percentile of the lowest foot point's height: low, but not one bad frame
_CLEAR = 0.2  # how much more upright a body must be along one axis than along the next
_SAY_UNIT = "say --metres-per-unit, or metres_per_unit in kumite.toml"
_SAY_UP = "say --up-axis, or up_axis in kumite.toml"
_ALWAYS = 0.8  # how upright along an unusual axis a body must be in the mean of all frames
_USUAL_AXES = ("Y", "Z")
_MOST_FRAMES = 2000  # of a clip that are looked at


T = TypeVar("T")


@dataclass(frozen=True)
class Inferred(Generic[T]):
    """A value and the sentence that explains it."""

    value: T
    why: str
    stated: bool = False  # by the file itself
    doubt: str = ""  # what may be otherwise, and how to say it; empty where nothing speaks for it


def leg_length(skeleton: Skeleton, roles: Mapping[str, int]) -> float:
    """Hip to ankle along the bones, the mean of both legs, in the skeleton's units."""
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    chains = [skeleton.chain(roles[f"{s}_thigh"], roles[f"{s}_foot"]) for s in SIDES]
    return float(np.mean([lengths[c].sum() for c in chains]))


def metres_per_unit(raw: RawMotion, roles: Mapping[str, int]) -> Inferred[float]:
    """The unit in which the legs are a person's; the header's own, if that is plausible.

    Errors: no known unit fits, or two do and neither gives an adult.
    """
    leg = leg_length(raw.skeleton, roles)
    stated = raw.metres_per_unit
    if stated is not None and _within(leg * stated, STATED_RANGE):
        return Inferred(stated, f"the header's units; legs of {leg * stated:.2f} m", stated=True)
    sizes = {name: leg * unit for name, unit in METRES_PER_UNIT.items()}
    fits = [name for name, size in sizes.items() if _within(size, LEG_RANGE)]
    usual = [name for name in fits if _within(sizes[name], USUAL_RANGE)]
    chosen = usual if len(usual) == 1 else fits
    if len(chosen) == 1:
        (name,) = chosen
        size = sizes[name]
        doubt = ""
        if not usual:
            kind = "a child's" if size < USUAL_LEG else "very long"
            doubt = f"such legs are {kind}; {_SAY_UNIT} if that is wrong"
        return Inferred(METRES_PER_UNIT[name], f"{name}; legs of {size:.2f} m", doubt=doubt)
    fit = "two known units" if fits else "no known unit"
    each = ", ".join(f"{sizes[n]:.3g} m with {u:.4g} ({n})" for n, u in METRES_PER_UNIT.items())
    raise KumiteError(f"the legs fit a person in {fit}: {each}; {_SAY_UNIT}")


def _within(size: float, bounds: tuple[float, float]) -> bool:
    return bounds[0] <= size <= bounds[1]


def up_axis(clips: Sequence[RawMotion], roles: Mapping[str, int]) -> Inferred[str]:
    """The axis along which heads are above feet: in the motion, or else in the rest pose.

    Errors: an unusual axis in the motion that the rest pose does not confirm.
    """
    upright = np.zeros(3)
    frames = 0
    for raw in clips:
        position, _ = forward_kinematics(raw.skeleton, *_some_frames(raw))
        upright += _body_axis(position, roles).sum(axis=0)
        frames += len(position)
    upright /= max(frames, 1)
    moving = _clear_axis(upright)
    if moving not in (None, *_USUAL_AXES) and float(np.abs(upright).max()) < _ALWAYS:
        moving = None  # who crawls has been upright, too, or turns round
    resting = _clear_axis(_body_axis(clips[0].skeleton.rest_positions[None], roles)[0])
    why = "heads are above feet in the motion"
    if moving is None:
        if resting is None:
            doubt = f"{_SAY_UP} if people lie"
            return Inferred("Y", "usual; neither motion nor rest pose tells", doubt=doubt)
        return Inferred(resting, "the head is above the feet in the rest pose")
    if moving == resting or moving == "Y":
        return Inferred(moving, why)
    if moving == "Z":
        doubt = f"the rest pose stands along {resting}; {_SAY_UP} if people lie on the floor"
        return Inferred(moving, why, doubt="" if resting is None else doubt)
    rest = "tells nothing" if resting is None else f"along {resting}"
    raise KumiteError(
        f"heads are above feet along {moving} in the motion, the rest pose {rest}: people lie or "
        f"{moving} is up; {_SAY_UP}"
    )


def _clear_axis(upright: np.ndarray) -> str | None:
    """The axis, with its sign, that a vector [3] follows clearly more than the others."""
    order = np.argsort(-np.abs(upright))
    first, second = np.abs(upright[order[:2]])
    if first - second < _CLEAR:
        return None
    return f"{'-' if upright[order[0]] < 0 else ''}{'XYZ'[order[0]]}"


def ground_height(
    clips: Sequence[RawMotion],
    roles: Mapping[str, int],
    metres_per_unit: float,
    up_axis: str,
) -> Inferred[float]:
    """The floor [m] of a session, in its own frame once that is Y up.

    It is the file's own zero wherever the feet come down near it, since mocap rooms are measured
    and body models are not: their toes float by some centimetres. Otherwise it is put under the
    feet.
    """
    points = _foot_points(clips[0].skeleton, roles)
    has_toes = any(np.any(offset) or j not in _ankles(roles) for j, offset in points)
    above = TOE_HEIGHT if has_toes else ANKLE_HEIGHT
    lows = []
    for raw in clips:
        raw = to_y_up(raw, up_axis)
        position, world = forward_kinematics(raw.skeleton, *_some_frames(raw))
        ends = _foot_points(raw.skeleton, roles)
        heights = [
            (position[:, j] + rotation.rotate(world[:, j], offset))[:, 1] for j, offset in ends
        ]
        lows.append(float(np.percentile(np.min(heights, axis=0), _LOW)) * metres_per_unit)
    low = float(np.median(lows))
    if abs(low - above) <= NEAR_FLOOR:
        return Inferred(0.0, f"the file's own zero; feet come down to {low:+.3f} m")
    return Inferred(low - above, f"feet come down to {low:+.3f} m and stand {above:.2f} m high")


def _some_frames(raw: RawMotion) -> tuple[np.ndarray, np.ndarray]:
    step = -(-len(raw) // _MOST_FRAMES)
    return raw.root_position[::step], raw.wxyz[::step]


def _body_axis(position: np.ndarray, roles: Mapping[str, int]) -> np.ndarray:
    """Unit vectors [F, 3] from between the feet to the head."""
    axis = position[:, roles["head"]] - 0.5 * sum(position[:, roles[f"{s}_foot"]] for s in SIDES)
    return axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)


def _ankles(roles: Mapping[str, int]) -> tuple[int, ...]:
    return tuple(roles[f"{s}_foot"] for s in SIDES)


def _foot_points(skeleton: Skeleton, roles: Mapping[str, int]) -> list[tuple[int, np.ndarray]]:
    """What may touch the floor, (joint, offset [3]): ankles, and joints and tips below them."""
    below = set(_ankles(roles))
    for j in range(1, len(skeleton)):
        if int(skeleton.parents[j]) in below:
            below.add(j)
    points = [(j, np.zeros(3)) for j in sorted(below)]
    tips = zip(skeleton.tip_parents.tolist(), skeleton.tip_offsets)
    return points + [(j, offset) for j, offset in tips if j in below]
