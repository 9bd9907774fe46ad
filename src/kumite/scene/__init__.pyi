from kumite.scene.actions import ActionPlayback, action_recording
from kumite.scene.evasion import EvasionScene
from kumite.scene.events import Event, EventIndex
from kumite.scene.metrics import CharacterMetrics, Metrics, measure
from kumite.scene.prepare import PrepareScene
from kumite.scene.recording import Recording, load_recording, save_recording
from kumite.scene.run import record
from kumite.scene.settings import (
    SceneSettings,
    builtin_scenes,
    load_scene,
    seconds_to_throw,
    throws_within,
    with_count,
    with_throws,
)
from kumite.scene.stage import Playback, SceneObject, Stage
from kumite.scene.world import Character, World

__all__ = [
    "ActionPlayback",
    "Character",
    "CharacterMetrics",
    "EvasionScene",
    "Event",
    "EventIndex",
    "Metrics",
    "Playback",
    "PrepareScene",
    "Recording",
    "SceneObject",
    "SceneSettings",
    "Stage",
    "World",
    "action_recording",
    "builtin_scenes",
    "load_recording",
    "load_scene",
    "measure",
    "record",
    "save_recording",
    "seconds_to_throw",
    "throws_within",
    "with_count",
    "with_throws",
]
