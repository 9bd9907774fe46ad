"""Two stories: a car that runs an enemy down, and a friend who steps in; what happened and when."""

from kumite import BoutScene, builtin_layer, load_scene

TOLD = ("cue", "run over", "reaction")

for name, style in (("car", "boxing"), ("alley", "sword")):
    settings = load_scene(name)
    scene = BoutScene(settings, builtin_layer(None, style=style, level="actions"), seed=0)
    for _ in range(25 * round(scene.fps)):
        scene.step()
    print(settings.about)
    for event in scene.events:
        if event.kind in TOLD and event.data.get("size", "fall") == "fall":
            what = event.data.get("by") or event.data.get("action") or "fights otherwise"
            print(f"{event.frame / scene.fps:6.2f} s  {event.kind}: {event.character}, {what}")
