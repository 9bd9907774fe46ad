"""The motion graph: pose distance, transitions, components, the action table, the library file."""

from kumite.graph.assess import Assessment, JoinQuality, Spread, Verdict, assess
from kumite.graph.avoiding import build_avoidance_library, find_avoiding_transitions
from kumite.graph.builtin import builtin_library
from kumite.graph.distance import PoseFeatures, pose_features
from kumite.graph.errands import build_preparation_library
from kumite.graph.finding import find_targets, marked_targets
from kumite.graph.hierarchy import (
    Hierarchy,
    Targets,
    authored_targets,
    build_hierarchy,
    hierarchy_table,
)
from kumite.graph.joins import JoinBound, JoinMeter, Jumps
from kumite.graph.library import Library, build_library, load_library, save_library
from kumite.graph.preparing import Preparing
from kumite.graph.table import ActionTable, fold
from kumite.graph.transitions import Transitions, find_transitions, strongest_component
from kumite.graph.whole import build_action_library

__all__ = [
    "ActionTable",
    "Assessment",
    "Hierarchy",
    "JoinBound",
    "JoinMeter",
    "JoinQuality",
    "Jumps",
    "Library",
    "PoseFeatures",
    "Preparing",
    "Spread",
    "Targets",
    "Transitions",
    "Verdict",
    "assess",
    "authored_targets",
    "build_action_library",
    "build_avoidance_library",
    "build_hierarchy",
    "build_library",
    "build_preparation_library",
    "builtin_library",
    "find_avoiding_transitions",
    "find_targets",
    "find_transitions",
    "fold",
    "hierarchy_table",
    "load_library",
    "marked_targets",
    "pose_features",
    "save_library",
    "strongest_component",
]
