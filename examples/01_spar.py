"""Two boxers of the built-in performer spar for ten seconds; the fight leaves as GLB."""

from kumite import World, builtin_layer, load_scene, measure, record
from kumite.export.gltf import write_glb

library = builtin_layer(None)
print(f"{library.table.states} states, {library.table.actions} actions")

scene = World(load_scene("sparring"), library, seed=7)
fight = record(scene, seconds=10)
for boxer in measure(fight).characters:
    print(f"{boxer.name}: {boxer.thrown} thrown, {boxer.landed} landed")

write_glb("spar.glb", fight)
