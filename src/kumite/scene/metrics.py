"""How good a recording is, in numbers. The captured clips are the yardstick."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from kumite.checks import instance
from kumite.clip import SIDES, Skeleton, facing_frame, forward_kinematics
from kumite.graph import Layer
from kumite.rotation import wrap_angle
from kumite.scene.events import Decision, EventIndex, Hit, Strike
from kumite.scene.recording import NO_FRAME, Recording
from kumite.scene.reports import Report, reports

FACING_WITHIN = np.radians(45.0)


@dataclass(frozen=True)
class CharacterMetrics:
    name: str
    thrown: int  # blows thrown
    landed: int  # blows that struck the head or trunk of the one aimed at, or the thing aimed at
    blocked: int  # blows that an arm of the one aimed at stopped
    skate_m_s: float  # mean speed over the ground of a planted foot
    skate_ratio: float | None  # over the same of the captured clips
    facing_share: float | None  # share of frames facing the one aimed at within 45°
    join_jump_m_s: float  # largest change of the root's speed from one frame to the next at a join
    joins: int  # jumps between captured frames
    variety: float  # different actions over actions taken


@dataclass(frozen=True)
class Metrics:
    seconds: float
    min_separation_m: float | None  # smallest distance between two pelvises over the ground
    characters: tuple[CharacterMetrics, ...]
    reports: tuple[Report, ...] = ()  # what the recording is about

    def to_json(self) -> dict:
        told = {r.name: {label: dict(row) for label, row in r.rows.items()} for r in self.reports}
        return {**asdict(replace(self, reports=())), "reports": told}


def foot_skate(
    skeleton: Skeleton, position: np.ndarray, on_ground: np.ndarray, fps: float
) -> float:
    """Mean ground speed [m/s] of planted feet: of ankle and toe the slower, since a foot may roll
    over either. position [F, J, 3], on_ground [F, 2]; 0 where no foot is planted.
    """
    speeds = []
    for s, side in enumerate(SIDES):
        roles = [r for r in (f"{side}_foot", f"{side}_toe") if r in skeleton.roles]
        moved = [np.diff(position[:, skeleton.joint(r)][:, [0, 2]], axis=0) for r in roles]
        slowest = np.min([np.linalg.norm(m, axis=1) for m in moved], axis=0) * fps
        speeds.append(slowest[on_ground[1:, s] & on_ground[:-1, s]])
    planted = np.concatenate(speeds)
    return float(planted.mean()) if len(planted) else 0.0


def source_skate(library: Layer) -> float:
    """Foot skate of the captured clips [m/s]."""
    clips = library.clips
    position, _ = clips.world
    on_ground = library.contacts.on_ground.copy()
    on_ground[clips.clip_start[:-1]] = False  # the step from one clip to the next is no motion
    return foot_skate(clips.skeleton, position, on_ground, clips.fps)


def _closest(ground: np.ndarray) -> list[float]:
    """The smallest distance [m] between any two of ground [F, K, 2] in each frame."""
    return [float(np.min(KDTree(frame).query(frame, k=2)[0][:, 1])) for frame in ground]


def _goes_on(recording: Recording, k: int) -> np.ndarray:
    """Whether a character [F - 1] shows what comes next in the capture, at its rate."""
    passed = np.diff(recording.library_frame[:, k])
    if recording.rate is None:
        return passed == 1
    rate = recording.rate[1:, k]
    return (passed == np.floor(rate)) | (passed == np.ceil(rate))


def measure(recording: Recording) -> Metrics:
    """Score a recording. Errors: it is none."""
    instance(recording, Recording, "measure")
    skeleton, fps = recording.skeleton, recording.fps
    count = len(recording.names)
    aims: dict[str, str] = dict(recording.settings.get("aims_at", {}))
    source = recording.settings.get("source_skate_m_s")
    pelvis, facing, positions = [], [], []
    for k in range(count):
        root = recording.root_position[:, k].astype(np.float64)
        wxyz = recording.wxyz[:, k].astype(np.float64)
        position, _ = forward_kinematics(skeleton, root, wxyz)
        positions.append(position)
        pelvis.append(position[:, skeleton.joint("pelvis")][:, [0, 2]])
        facing.append(facing_frame(skeleton, root, wxyz))
    gaps = _closest(np.stack(pelvis, axis=1)) if count > 1 else []
    events, rows = EventIndex(recording.events), []
    for k, name in enumerate(recording.names):
        skate = foot_skate(skeleton, positions[k], recording.contacts[:, k], fps)
        target = aims.get(name)
        aimed = None
        if target in recording.names:
            aimed = pelvis[recording.names.index(target)]
        elif target in recording.objects:
            o = recording.objects.index(target)
            aimed = recording.object_position[:, o][:, [0, 2]].astype(np.float64)
        share = None
        if aimed is not None:
            d = aimed - facing[k][:, :2]
            off = wrap_angle(np.arctan2(d[:, 0], d[:, 1]) - facing[k][:, 2])
            share = float(np.mean(np.abs(off) <= FACING_WITHIN))
        shown = recording.library_frame[:, k]
        physical = (shown[1:] == NO_FRAME) & (shown[:-1] == NO_FRAME)
        jump = np.flatnonzero(~_goes_on(recording, k) & ~physical) + 1
        speed = np.linalg.norm(np.diff(positions[k][:, 0], axis=0), axis=1) * fps
        inner = jump[(jump >= 2) & (jump < len(recording))]
        change = np.abs(speed[inner - 1] - speed[inner - 2])
        taken = [e.stretch for e in events.of(Decision, name)]
        blocked = [e.blocked for e in events.of(Hit, name)]
        rows.append(
            CharacterMetrics(
                name,
                len(events.of(Strike, name)),
                len(blocked) - sum(blocked),
                sum(blocked),
                skate,
                skate / source if source else None,
                share,
                float(change.max()) if len(change) else 0.0,
                len(jump),
                len(set(taken)) / len(taken) if taken else 0.0,
            )
        )
    nearest = float(min(gaps)) if gaps else None
    return Metrics(recording.seconds, nearest, tuple(rows), reports(recording))
