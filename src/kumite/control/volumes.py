"""The body's volume at every library frame, and what it takes to foresee how joins move it."""

from __future__ import annotations

import numpy as np

from kumite.body import Spheres
from kumite.clip import SIDES, ClipSet, Skeleton
from kumite.graph import Layer
from kumite.kernels.avoid import Volumes
from kumite.kernels.character import LN2
from kumite.kernels.joins import ANKLE, KNEE, ROOT, Joins
from kumite.synthesis.cast import SPRINGS

GROUP = 8  # spheres that are looked at together, or not at all


def volumes_of(clips: ClipSet, spheres: Spheres) -> Volumes:
    """Spheres of all frames, and spheres around groups of neighbours."""
    centre, radius = spheres.of_frames(clips), spheres.radius.astype(np.float32)
    between, along = hung(clips.skeleton, spheres)
    other = np.flatnonzero(np.any(np.diff(between, axis=0), axis=1)) + 1
    runs = np.array([0, *other, len(spheres)])
    starts = [np.arange(low, high, GROUP) for low, high in zip(runs[:-1], runs[1:])]
    group = np.append(np.concatenate(starts), len(spheres))
    bound = np.zeros((len(clips), 4, len(group) - 1), dtype=np.float32)
    group_along, group_spread = np.zeros(len(group) - 1), np.zeros(len(group) - 1)
    for g, (low, high) in enumerate(zip(group[:-1], group[1:])):
        some = centre[:, :, low:high]
        middle = some.mean(axis=2, dtype=np.float64)
        reach = np.linalg.norm(some - middle[:, :, None], axis=1) + radius[low:high]
        bound[:, :3, g], bound[:, 3, g] = middle, reach.max(axis=1) + 1e-5  # float32's rounding
        group_along[g] = along[low:high].mean()
        group_spread[g] = np.abs(along[low:high] - group_along[g]).max()
    return Volumes(centre, radius, group, bound, between, along, group_along, group_spread)


def hung(skeleton: Skeleton, spheres: Spheres) -> tuple[np.ndarray, np.ndarray]:
    """Places [B, 2] (``joins.PLACES``) that each sphere hangs between, and how far it is from the
    one to the other [B]: on a thigh from the root to the knee, on a shin on to the ankle. What is
    on a foot goes with the ankle, everything else with the root.
    """
    between, along = np.full((len(spheres), 2), ROOT), np.zeros(len(spheres))
    for s, side in enumerate(SIDES):
        legs = [skeleton.joint(f"{side}_{part}") for part in ("thigh", "shin", "foot")]
        places = ROOT, KNEE + s, ANKLE + s
        for b, joint in enumerate(spheres.joint.tolist()):
            on = joint
            while on not in (*legs, -1):
                on = int(skeleton.parents[on])
            if on == -1:
                continue
            bone = legs.index(on)
            between[b] = places[bone], places[min(bone + 1, 2)]
            if bone < 2:
                rest = skeleton.rest_positions
                way = rest[legs[bone + 1]] - rest[on]
                at = rest[joint] + spheres.centre[b] - rest[on]
                along[b] = np.clip(at @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
    return between, along


def joins_of(library: Layer, reckoned: bool) -> Joins:
    """What of a library the offsets come from that joins leave. reckoned: whether they count."""
    clips, skeleton = library.clips, library.clips.skeleton
    position, _ = clips.world
    feet, hips, knees = (
        [skeleton.joint(f"{side}_{part}") for side in SIDES] for part in ("foot", "thigh", "shin")
    )
    frames = np.arange(len(clips))
    return Joins(
        np.concatenate([clips.root_position[:, None], position[:, feet]], axis=1),
        np.stack([position[:, hips], position[:, knees]], axis=2),
        np.where(np.isin(frames, clips.clip_start[:-1]), frames, frames - 1),
        library.contacts.on_ground,
        2.0 * LN2 / SPRINGS.root,
        2.0 * LN2 / SPRINGS.joint,
        SPRINGS.longest_foot_offset,
        reckoned,
    )
