"""The motion graph: pose distance, transitions, components, the action table, the library file."""

from kumite.graph.assess import (
    Assessment,
    JoinQuality,
    Spread,
    Verdict,
    assess,
    assess_library,
)
from kumite.graph.avoiding import build_avoidance, find_avoiding_transitions
from kumite.graph.builtin import builtin_layer, builtin_library
from kumite.graph.distance import PoseFeatures, pose_features
from kumite.graph.errands import build_preparation
from kumite.graph.finding import find_targets, marked_targets
from kumite.graph.hierarchy import (
    Hierarchy,
    Targets,
    authored_targets,
    build_hierarchy,
    hierarchy_table,
)
from kumite.graph.joins import JoinBound, JoinMeter, Jumps
from kumite.graph.layer import Layer, build_frames
from kumite.graph.library import Library, build_library
from kumite.graph.library_file import load_library, save_library
from kumite.graph.preparing import Preparing
from kumite.graph.table import ActionTable, fold
from kumite.graph.transitions import Transitions, find_transitions, strongest_component
from kumite.graph.whole import build_actions
from kumite.layers import LAYERS

__all__ = [
    "LAYERS",
    "ActionTable",
    "Assessment",
    "Hierarchy",
    "JoinBound",
    "JoinMeter",
    "JoinQuality",
    "Jumps",
    "Layer",
    "Library",
    "PoseFeatures",
    "Preparing",
    "Spread",
    "Targets",
    "Transitions",
    "Verdict",
    "assess",
    "assess_library",
    "authored_targets",
    "build_actions",
    "build_avoidance",
    "build_frames",
    "build_hierarchy",
    "build_library",
    "build_preparation",
    "builtin_layer",
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
