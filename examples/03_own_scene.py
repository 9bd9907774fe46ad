"""A scene of one's own: three boxers in a ring, each after the next one; and its event log."""

from pathlib import Path

from kumite import World, builtin_layer, load_scene, record, save_recording
from kumite.scene.events import Hit

Path("ring.toml").write_text(
    """
title = "Each after the next"

[[character]]
name = "ann"
position = [0.0, -0.8]
aims_at = "bea"

[[character]]
name = "bea"
position = [-0.8, 0.6]
yaw_deg = 120
aims_at = "cy"

[[character]]
name = "cy"
position = [0.8, 0.6]
yaw_deg = -120
aims_at = "ann"
strike = 5.0
"""
)
scene = World(load_scene("ring.toml"), builtin_layer(None), seed=2)
fight = record(scene, seconds=20)
for event in fight.events:
    if isinstance(event, Hit):
        print(f"{event.time:6.2f} s  {event.character} hits {event.victim}'s {event.part} "
              f"with the {event.limb.replace('_', ' ')} at {event.speed:.1f} m/s")  # fmt: skip
save_recording("ring.rec", fight)
