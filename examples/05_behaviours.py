"""Behaviours are data: four of your own, weighed against each other while the scene runs."""

import numpy as np

from kumite import World, builtin_layer, load_scene
from kumite.control import Behaviour, Station, approach_grid, heading_grid

grid = approach_grid()  # where the target may be: all round, 2 m
behaviours = {
    # Stand 1.6 m from it, seen straight ahead.
    "stand_off": Behaviour("stand_off", grid, station=Station(distance=1.6, bearing=0.0)),
    # Go round it to the right, all the time, while it is within 2.5 m.
    "prowl": Behaviour(
        "prowl",
        grid,
        station=Station(distance=1.2, sigma=0.3, bearing=0.0, orbit=0.8, always=True),
        farthest=2.5,
    ),
    # Get away from it.
    "flee": Behaviour("flee", grid, station=Station(distance=3.0, sigma=0.8, always=True)),
    # Stand where it is and face the way it faces: its heading is a third axis of the grid.
    "be_there": Behaviour(
        "be_there", heading_grid(), station=Station(heading=0.0, sigma=0.15, always=True)
    ),
}
scene = World(load_scene("target"), builtin_layer(None), behaviours=behaviours)
kinds = ("approach", "strike", *behaviours)
weights = {t.field: t for t in scene.tunables if t.field in kinds}
target = scene.objects[0].position


def away_and_round(seconds: float) -> tuple[float, float]:
    """How far the boxer is from the target at last [m], and how far it has gone round it [rad]."""
    before, turned = None, 0.0
    for _ in range(round(seconds * scene.fps)):
        scene.step()
        x, _, z = scene.root_position[0] - target
        angle = np.arctan2(x, z)
        turned += 0.0 if before is None else (angle - before + np.pi) % (2 * np.pi) - np.pi
        before = angle
    return float(np.hypot(x, z)), turned


for name in ("prowl", "flee", "stand_off", "be_there"):
    weights[name].set(6.0)
    for other, control in weights.items():
        if other != name:
            control.set(0.0)
    away, turned = away_and_round(15)
    print(f"{name}: {away:.2f} m from the target, {turned:+.1f} rad round it")
