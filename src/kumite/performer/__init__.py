"""The built-in performer: original clips authored in code, and their ground truth.

Moves are tables (:mod:`kumite.performer.punches` and others); a user's own :class:`Move` is
performed alike:

    clip, truth = perform_take("mine", [as_written(move)], BOXING, rng=np.random.default_rng(0))
"""

from kumite.performer.avoidance import AVOIDANCE
from kumite.performer.boxing import BOXING
from kumite.performer.errands import ERRANDS
from kumite.performer.kept import performed, truth_to_json
from kumite.performer.locomotion import LOCOMOTION
from kumite.performer.moves import Blow, Move, Plant, Step, Style, Take, aim, put
from kumite.performer.perform import Performance, perform
from kumite.performer.skeleton import skeleton
from kumite.performer.styles import STYLES
from kumite.performer.sword import SWORD
from kumite.performer.take import Performed, as_written, perform_take, vary
from kumite.performer.truth import Action, Strike, Truth

__all__ = [
    "AVOIDANCE",
    "BOXING",
    "ERRANDS",
    "LOCOMOTION",
    "STYLES",
    "SWORD",
    "Action",
    "Blow",
    "Move",
    "Performance",
    "Performed",
    "Plant",
    "Step",
    "Strike",
    "Style",
    "Take",
    "Truth",
    "aim",
    "as_written",
    "perform",
    "perform_take",
    "performed",
    "put",
    "skeleton",
    "truth_to_json",
    "vary",
]
