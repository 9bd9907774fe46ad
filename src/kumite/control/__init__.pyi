from kumite.caches import cache_folder
from kumite.control.approaching import Approach, approach_motions, trained_approach
from kumite.control.attack import Attack, thrown
from kumite.control.avoidance import Avoidance, AvoidanceSearch, Standing
from kumite.control.combination import (
    HIT_DIRECTIONS,
    POSITIONS,
    Annotations,
    CombinationTable,
    Entry,
    Pair,
    annotate_actions,
    build_table,
)
from kumite.control.combination_file import read_table, write_table
from kumite.control.fighter import Fighters, Skill
from kumite.control.grid import TargetGrid, approach_grid, heading_grid, strike_grid
from kumite.control.policy import (
    BEHAVIOURS,
    Behaviour,
    Policy,
    Station,
    approach,
    circle,
    keep_off,
    solve,
    stretch_tracks,
    strike,
    take_place,
)
from kumite.control.preparation import (
    Motions,
    PreparationPolicy,
    PreparationSettings,
    gradual,
    trained_preparation,
)
from kumite.control.routes import CheckPoint, Missed, Progress, Reached, Route
from kumite.control.rules import AvoidanceRules, Temper
from kumite.control.styles import STYLES, Style, short_range, style
from kumite.control.training import trained
from kumite.control.worth import Worth, measure_worth

__all__ = [
    "BEHAVIOURS",
    "HIT_DIRECTIONS",
    "POSITIONS",
    "STYLES",
    "Annotations",
    "Approach",
    "Attack",
    "Avoidance",
    "AvoidanceRules",
    "AvoidanceSearch",
    "Behaviour",
    "CheckPoint",
    "CombinationTable",
    "Entry",
    "Fighters",
    "Missed",
    "Motions",
    "Pair",
    "Policy",
    "PreparationPolicy",
    "PreparationSettings",
    "Progress",
    "Reached",
    "Route",
    "Skill",
    "Standing",
    "Station",
    "Style",
    "TargetGrid",
    "Temper",
    "Worth",
    "annotate_actions",
    "approach",
    "approach_grid",
    "approach_motions",
    "build_table",
    "cache_folder",
    "circle",
    "gradual",
    "heading_grid",
    "keep_off",
    "measure_worth",
    "read_table",
    "short_range",
    "solve",
    "stretch_tracks",
    "strike",
    "strike_grid",
    "style",
    "take_place",
    "thrown",
    "trained",
    "trained_approach",
    "trained_preparation",
    "write_table",
]
