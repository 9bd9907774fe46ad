"""What happens in the clips: foot contacts, effective hits and actions, found without hand work;
and how like a person they move.
"""

from kumite.annotate.action_file import read_actions, write_actions
from kumite.annotate.actions import (
    DIRECTIONS,
    DIRECTIONS_OF,
    KINDS,
    NO_LIMB,
    Actions,
    ActionSettings,
    find_actions,
    shorter_rests,
)
from kumite.annotate.contacts import Contacts, find_contacts
from kumite.annotate.likeness import Likeness, measure_likeness
from kumite.annotate.strikes import Strikes, find_strikes, only_blows

__all__ = [
    "DIRECTIONS",
    "DIRECTIONS_OF",
    "KINDS",
    "NO_LIMB",
    "ActionSettings",
    "Actions",
    "Contacts",
    "Likeness",
    "Strikes",
    "find_actions",
    "find_contacts",
    "find_strikes",
    "measure_likeness",
    "only_blows",
    "read_actions",
    "shorter_rests",
    "write_actions",
]
