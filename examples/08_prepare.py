"""Somebody who prepares for a kick on the way to the ball, and who does not: what differs."""

from kumite import PrepareScene, builtin_layer, load_scene
from kumite.scene.events import Hit, Launch
from kumite.scene.settings_prepare import PrepareSettings

library = builtin_layer(None, style="targets", level="preparation")
for preparation in ("none", "ours"):
    settings = load_scene("ball-kick").model_copy(
        update={"prepare": PrepareSettings(preparation=preparation)}
    )
    scene = PrepareScene(settings, library, seed=1)
    while scene.frame < 30 * scene.fps and not any(isinstance(e, Hit) for e in scene.events):
        scene.step()
    launch = next(e for e in scene.events if isinstance(e, Launch))
    hit = next(e for e in scene.events if isinstance(e, Hit))
    print(
        f"{preparation:5}: prepared to {launch.level:.2f}, {launch.apart_deg:.1f} degrees "
        f"from the motion's pose, foot on the ball {launch.to_contact:.2f} s later "
        f"at {hit.speed:.1f} m/s"
    )
