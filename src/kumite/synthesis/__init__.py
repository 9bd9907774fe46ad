"""From choices to poses: joins, foot lock, reactions."""

from kumite.synthesis.cast import Cast
from kumite.synthesis.moment import Moment
from kumite.synthesis.ragdoll import (
    EFFECTIVE_MASS,
    Pushed,
    Ragdoll,
    Tone,
    blow_impulse,
    has_physics,
)
from kumite.synthesis.response import Responses, find_responses
from kumite.synthesis.warp import Warp, edge_frames, make_profile, place_of, time_warp

__all__ = [
    "EFFECTIVE_MASS",
    "Cast",
    "Moment",
    "Pushed",
    "Ragdoll",
    "Responses",
    "Tone",
    "Warp",
    "blow_impulse",
    "edge_frames",
    "find_responses",
    "has_physics",
    "make_profile",
    "place_of",
    "time_warp",
]
