"""Bones of one length, out of files whose joints have position channels below the root.

A clip has one length a bone. Position channels below the root say another thing, and files mean
four things by them:

- *a place in the parent's axes*, instead of OFFSET, as BVH has it;
- *a shift* that is added to OFFSET: values around zero beside a real OFFSET;
- *a place in the world*, or *a way in the world's axes* from the parent: some exporters write
  these, and they are known by saying the same as OFFSET and rotations do.

A joint on the way from the root to the hips may move as it likes: the lowest of them becomes the
root, at the same place in space, and what hangs beside it (a prop) is left out. Of any other joint
the offset is held, and how far this takes joints from where the file has them is worked out, so
that more than a few centimetres can be refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kumite import rotation
from kumite.clip import NO_PARENT, Skeleton, forward_kinematics
from kumite.mocap.raw import RawMotion, Stretch

_ALIKE = 0.03  # of the longest bone: ways to read a position that differ less say the same
_ZERO = 0.1  # of OFFSET: values that stay below it are shifts, not places
_NOTHING = 1e-4  # of the longest bone: noise of the digits that a file is written with
_MEANINGS = {
    "world": "are places in the world",
    "axes": "are ways from the parent in the world's axes",
}


def fixed_bones(
    raw: RawMotion, roles: Mapping[str, int], *, follow: bool = True
) -> tuple[RawMotion, dict[str, int]]:
    """The motion with one offset a joint, and the roles in its joints.

    follow: False leaves position channels out below the hips; bones are the OFFSETs then.
    """
    if not raw.positions:
        return raw, dict(roles)
    skeleton, notes = raw.skeleton, list(raw.notes)
    above = _path(skeleton, roles["pelvis"])
    offsets = skeleton.offsets.copy()
    offsets[0] = 0.0
    longest = float(np.linalg.norm(offsets, axis=1).max())
    longest = longest or max(float(_length(p).max()) for p in raw.positions.values())
    world = forward_kinematics(skeleton, raw.root_position, raw.wxyz)[1]
    place: dict[int, np.ndarray] = {0: raw.root_position}  # of joints, as the file means them
    moving: dict[int, np.ndarray] = {}
    found: dict[str, list[str]] = {}
    for j in range(1, len(skeleton)):
        parent = int(skeleton.parents[j])
        local = raw.positions.get(j)
        if local is not None and (follow or j in above):
            back = rotation.conjugate(world[:, parent])
            meaning, local = _read(
                local, offsets[j], place[parent], back, _ALIKE * longest, free=j in above
            )
            found.setdefault(meaning, []).append(skeleton.names[j])
            middle = np.median(local, axis=0)
            if float(_length(local - middle).max()) <= _ALIKE * longest and j not in above:
                # The files of a session share their OFFSETs, but not the middles of their noise.
                near = float(_length(middle - offsets[j])) <= 0.5 * _ALIKE * longest
                middle = offsets[j] if near and np.ptp(local, axis=0).any() else middle
            offsets[j] = middle
            if np.ptp(local, axis=0).any():
                moving[j] = local
        elif local is not None:
            found.setdefault("told", []).append(skeleton.names[j])
        step = moving[j] if j in moving else offsets[j]
        place[j] = place[parent] + rotation.rotate(world[:, parent], step)
    for meaning, said in _MEANINGS.items():
        if meaning in found:
            notes.append(f"position channels of {_listed(found[meaning])} {said}, and read as that")
    if "told" in found:
        notes.append(f"position channels of {_listed(found['told'])} are left out, as said")
    raw = replace(
        raw,
        skeleton=replace(skeleton, offsets=np.concatenate([skeleton.offsets[:1], offsets[1:]])),
        positions={},
    )
    roles = dict(roles)
    carriers = [j for j in above if j in moving]
    if carriers and _only_props_beside(skeleton, carriers[-1], roles):
        raw, roles, place, moving = _from(carriers[-1], raw, roles, world, place, moving, notes)
    stretch = None
    if moving:
        here, _ = forward_kinematics(raw.skeleton, raw.root_position, raw.wxyz)
        far = max(float(_length(here[:, j] - place[j]).max()) for j in range(len(raw.skeleton)))
        wildest = max(
            moving, key=lambda j: float(_length(moving[j] - raw.skeleton.offsets[j]).max())
        )
        stretch = Stretch(raw.skeleton.names[wildest], far)
        names = _listed([raw.skeleton.names[j] for j in moving])
        if far > _NOTHING * longest:
            notes.append(
                f"bones that change length keep one: {names}; joints lie up to {far:.2g} file "
                "units from where the file has them"
            )
    return replace(raw, notes=tuple(notes), stretch=stretch), roles


def _read(
    position: np.ndarray,
    offset: np.ndarray,
    parent: np.ndarray,
    back: np.ndarray,
    alike: float,
    *,
    free: bool,
) -> tuple[str, np.ndarray]:
    """What positions [F, 3] mean, and the places in the parent's axes that they come to.

    parent: [F, 3] its place; back: [F, 4] from the world's axes to its; free: it may move.
    """
    known = float(_length(offset)) > alike
    if known and float(_length(np.median(position, axis=0))) < _ZERO * float(_length(offset)):
        if not np.any(position):
            return "place", np.tile(offset, (len(position), 1))
        if not free:
            return "shift", position + offset
    off = float(_length(position - offset).max())
    if known and not free and off > 2 * alike:
        for meaning, way in (("world", position - parent), ("axes", position)):
            local = rotation.rotate(back, way)
            if float(_length(local - offset).max()) <= min(0.25 * off, 4 * alike):
                return meaning, local
    return "place", position


def _from(
    root: int,
    raw: RawMotion,
    roles: Mapping[str, int],
    world: np.ndarray,
    place: Mapping[int, np.ndarray],
    moving: Mapping[int, np.ndarray],
    notes: list[str],
) -> tuple[RawMotion, dict[str, int], dict[int, np.ndarray], dict[int, np.ndarray]]:
    """All of it with another joint as the root, and only what hangs on it."""
    skeleton = raw.skeleton
    kept = _below(skeleton, root)
    index = {j: k for k, j in enumerate(kept)}
    ends = [t for t, j in enumerate(skeleton.tip_parents.tolist()) if j in index]
    parents = [NO_PARENT if j == root else index[int(skeleton.parents[j])] for j in kept]
    above = [j for j in _path(skeleton, root) if j != root]
    beside = [skeleton.names[j] for j in range(len(skeleton)) if j not in index and j not in above]
    name = skeleton.names[root]
    merged = [skeleton.names[j] for j in above]
    joint, was = ("joint", "was") if len(merged) == 1 else ("joints", "were")
    notes.append(f"{joint} {_listed(merged)} above {name} {was} merged into it")
    if beside:
        notes.append(f"what hangs beside {name} was left out: {_listed(beside)}")
    wxyz = raw.wxyz[:, kept].copy()
    wxyz[:, 0] = world[:, root]
    raw = replace(
        raw,
        skeleton=Skeleton(
            tuple(skeleton.names[j] for j in kept),
            np.array(parents),
            skeleton.offsets[kept],
            tip_parents=np.array([index[int(skeleton.tip_parents[t])] for t in ends], np.int32),
            tip_offsets=skeleton.tip_offsets[ends],
        ),
        root_position=place[root],
        wxyz=wxyz,
    )
    return (
        raw,
        {r: index[j] for r, j in roles.items() if j in index},
        {index[j]: p for j, p in place.items() if j in index},
        {index[j]: p for j, p in moving.items() if j in index and j != root},
    )


def _only_props_beside(skeleton: Skeleton, root: int, roles: Mapping[str, int]) -> bool:
    """Whether no part of the body hangs beside a joint: then it may become the root."""
    return set(roles.values()) <= {*_below(skeleton, root), *_path(skeleton, root)}


def _path(skeleton: Skeleton, joint: int) -> list[int]:
    """From below the root down to a joint; the root itself comes first."""
    return [0, *skeleton.chain(0, joint)]


def _below(skeleton: Skeleton, root: int) -> list[int]:
    """A joint and all below it, in order."""
    inside = {root}
    for j in range(root + 1, len(skeleton)):
        if int(skeleton.parents[j]) in inside:
            inside.add(j)
    return sorted(inside)


def _length(v: np.ndarray) -> np.ndarray:
    return np.linalg.norm(v, axis=-1)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - 6} more" if len(names) > 6 else ""
    return ", ".join(names[:6]) + more
