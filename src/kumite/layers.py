"""What a library may hold over the same frames, by name."""

LAYERS = ("frames", "actions", "avoidance", "preparation")

TAKES = {
    "frames": "clips of somebody who steps about: feet that lift off the floor and land",
    "actions": "clips of blows, steps and, for who is struck, reactions",
    "avoidance": "clips in which somebody ducks, leans or steps out of the way",
    "preparation": "clips of walks, and of what they lead to: kicks, crawls, jumps, blows",
}
"""What captures each takes."""
