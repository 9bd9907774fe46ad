"""Controllers: given what a character sees, choose its next action."""

from kumite.control.fighter import Fighters, Skill, Temper
from kumite.control.grid import TargetGrid, approach_grid, strike_grid
from kumite.control.policy import Behaviour, Policy, approach, solve, stretch_tracks, strike
from kumite.control.trained import cache_folder, trained

__all__ = [
    "Behaviour",
    "Fighters",
    "Policy",
    "Skill",
    "TargetGrid",
    "Temper",
    "approach",
    "approach_grid",
    "cache_folder",
    "solve",
    "stretch_tracks",
    "strike",
    "strike_grid",
    "trained",
]
