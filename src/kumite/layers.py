"""What a library may hold over the same frames, by name."""

LAYERS = ("frames", "actions", "avoidance", "preparation")
