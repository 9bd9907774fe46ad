"""The styles of the repertoire, by name."""

from kumite.performer.avoidance import AVOIDANCE
from kumite.performer.boxing import BOXING
from kumite.performer.errands import ERRANDS
from kumite.performer.locomotion import LOCOMOTION
from kumite.performer.sword import SWORD

STYLES = {style.name: style for style in (BOXING, SWORD, LOCOMOTION, ERRANDS, AVOIDANCE)}
