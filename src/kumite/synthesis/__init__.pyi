from kumite.synthesis.cast import Cast
from kumite.synthesis.moment import Moment
from kumite.synthesis.preparation import (
    LevelFilter,
    Preparation,
    References,
    curves,
    level_displacements,
    prepare_clip,
    references,
    repeat_cycle,
    smooth_levels,
)
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
    "LevelFilter",
    "Moment",
    "Preparation",
    "Pushed",
    "Ragdoll",
    "References",
    "Responses",
    "Tone",
    "blow_impulse",
    "curves",
    "find_responses",
    "has_physics",
    "level_displacements",
    "prepare_clip",
    "references",
    "repeat_cycle",
    "smooth_levels",
]
