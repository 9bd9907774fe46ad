"""From a folder of motion capture to its blows: here BVH files that this script writes itself."""

from pathlib import Path

from kumite import find_strikes, mocap, performer
from kumite.clip import LIMBS
from kumite.export.bvh import write_bvh

for clip in performer.perform().clips[:3]:
    write_bvh(Path("takes") / f"{clip.name}.bvh", clip)

loaded = mocap.load("takes")
for line in loaded.report():
    print(line)  # all that was inferred: units, up axis, floor, roles

clips = loaded.clip_set()
strikes = find_strikes(clips)
for frame, limb, velocity in zip(strikes.frame, strikes.limb, strikes.velocity):
    name = clips.names[clips.clip_of_frame[frame]]
    print(f"{name:24} {frame / clips.fps:6.2f} s  {LIMBS[limb]:10}  ahead {velocity[2]:+.1f} m/s")
