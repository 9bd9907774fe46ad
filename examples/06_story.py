"""Two stories: a car that runs an enemy down, and a friend who steps in; what happened and when."""

from kumite import World, builtin_layer, load_scene
from kumite.scene.events import Cue, Reaction, RunOver
from kumite.scene.wording import describe

for name, style in (("car", "boxing"), ("alley", "sword")):
    settings = load_scene(name)
    scene = World(settings, builtin_layer(None, style=style, level="actions"), seed=0)
    for _ in range(25 * round(scene.fps)):
        scene.step()
    print(settings.about)
    for event in scene.events:
        match event:
            case Cue() | RunOver() | Reaction(size="fall"):
                print(f"{event.frame / scene.fps:6.2f} s  {event.character}, {describe(event)}")
