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

__all__ = [
    "EFFECTIVE_MASS",
    "Cast",
    "Moment",
    "Pushed",
    "Ragdoll",
    "Responses",
    "Tone",
    "blow_impulse",
    "find_responses",
    "has_physics",
]
