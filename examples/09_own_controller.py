"""A controller of one's own, before those that a fighter has: it backs off after it was hit."""

import numpy as np

from kumite import World, builtin_library, load_scene
from kumite.control.protocol import PASS, View

SECONDS = 1.5  # for which it backs off


class BackOff:
    """Chooses the step that leads farthest from the opponent, for a while after a blow."""

    name = "back off"

    def __init__(self, layer):
        self.table = layer.table
        self.steps = np.flatnonzero(layer.actions.kind[layer.action_of_stretch] == 2)  # transitions
        self.start()

    def start(self):
        self.until = 0.0

    def watch(self, view: View):
        return None  # it breaks nothing off

    def choose(self, view: View):
        if view.seconds > self.until:
            return PASS  # the next controller is asked
        ahead = self.table.displacement[self.steps, 1]  # m, where it faces: towards the opponent
        return view.spans.span("actions", self.steps[np.argmin(ahead)])

    def rate(self, view: View):
        return 1.0

    def interrupted(self, view: View):
        self.until = view.seconds + SECONDS


library = builtin_library(None, layers=("actions",))
for careful in (False, True):
    scene = World(load_scene("boxing"), library, seed=3)
    if careful:
        for controllers in scene.controllers:
            controllers.insert(0, BackOff(library.layer("actions")))
    near = []
    for _ in range(20 * int(scene.fps)):
        scene.step()
        near.append(np.linalg.norm(scene.root_position[0] - scene.root_position[1]))
    hits = sum(e.kind == "hit" for e in scene.events)
    print(f"{'careful' if careful else 'as they are'}: {hits} hits, {np.median(near):.2f} m apart")
