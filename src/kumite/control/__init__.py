"""Controllers: given what a character sees, choose its next action."""

from kumite.control.fighter import Fighters, Skill, Temper
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
from kumite.control.trained import cache_folder, trained
from kumite.control.worth import Worth, measure_worth

__all__ = [
    "BEHAVIOURS",
    "Behaviour",
    "Fighters",
    "Policy",
    "Skill",
    "Station",
    "TargetGrid",
    "Temper",
    "Worth",
    "approach",
    "approach_grid",
    "cache_folder",
    "circle",
    "heading_grid",
    "keep_off",
    "measure_worth",
    "solve",
    "stretch_tracks",
    "strike",
    "strike_grid",
    "take_place",
    "trained",
]
