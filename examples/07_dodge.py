"""Balls thrown at somebody who gets out of the way: what a search finds, and what comes of it."""

import numpy as np

from kumite import AvoidanceSearch, World, builtin_layer, load_scene
from kumite.control import Standing, thrown
from kumite.scene.events import Avoided, Struck, Throw

library = builtin_layer(None, style="avoidance", level="avoidance")

# One search by hand: somebody at rest, a ball on its way to the chest.
search = AvoidanceSearch(library)
frame = int(library.table.state_frame[0])
facing = library.clips.facing[frame]
standing = Standing(np.zeros(3), phase=float(frame), stop=frame)
ahead = np.array([np.sin(facing[2]), 0.0, np.cos(facing[2])])
ball = thrown([facing[0], 1.2, facing[1]] + 7.0 * ahead, -8.0 * ahead + [0.0, 4.2, 0.0], 0.11)
found = search.search(standing, [ball], now=0.0)
print(f"{found.outcome}: {found.candidates} candidates, the best keeps {found.distance:.2f} m off")

# A scene that throws by itself.
scene = World(load_scene("dodgeball"), library, seed=3)
for _ in range(12 * round(scene.fps)):
    scene.step()
for event in scene.events:
    if isinstance(event, Throw | Avoided | Struck):
        print(f"{event.frame / scene.fps:6.2f} s  {event.kind} (attack {event.attack})")
